"""The run as the door process knows it: asked for over the border, written out here.

What takes long, the texts and pictures of maps, another process makes (`drawing`), once for all who ask for it.
"""

from __future__ import annotations

import asyncio
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from service.border.asking import DEED_S, LOOK_S, Asking
from service.border.drawer import Sight
from service.border.drawing import Drawing
from service.border.limits import MOST_FRAMES, MOST_IN_A_FRAME, MOST_NEWS, MOST_ORDERS, MOST_TEXT
from service.border.memory import SharedMap
from service.border.rounds import Rounds
from service.drawing import RegionsRow
from service.entries import read_last_entries
from service.evidence.images import Images, brings
from service.evidence.reports import OrderReceipt, Receipt, Report
from service.geometry import LatLon
from service.news.request import NewsRequest
from service.telling.searched import POD_AT_LEAST, Outline, outlines
from service.view.feed import Moment
from service.view.scene import SearchGround
from service.view.state import HeardState, RunState

MOST_WAITING = 20_000
"""Reports that wait for their turn at the border."""


@dataclass
class _Wanted:
    """What those who wait for the next look want to see beside the state."""

    moment: bool = False
    arrays: bool = False
    digest: bool = False


@dataclass(frozen=True)
class _Look:
    """What the last look showed."""

    ready: bool
    moment: Moment
    digest: str


class DistantRun:
    """A run in another process, as the door needs it (`service.http.run.ShownRun`)."""

    def __init__(self, asking: Asking, shared: SharedMap, ground: SearchGround, journal: Path) -> None:
        self._asking, self._shared, self._ground, self._journal = asking, shared, ground, journal
        self._outlining = asyncio.Lock()
        self._images = Images(journal.parent)
        self._wanted = _Wanted()
        self._rows: dict[str, list[list[float]]] = {"hits": [], "curve": []}
        self._tracks: list[list[list[float]]] = []
        nothing = cast(RunState, {})  # nobody is shown it: the first look brings another
        self._last = Moment(
            nothing, np.zeros(shared.shape[0] * shared.shape[1]), 1.0, np.zeros(shared.shape), [], [], []
        )
        self._looks = Rounds(self._look)
        self._metrics = Rounds(lambda: self._asking.ask("metrics", LOOK_S))
        self._frames = asyncio.Semaphore(MOST_FRAMES)
        self._orders = asyncio.Semaphore(MOST_ORDERS)
        self._news = asyncio.Semaphore(MOST_NEWS)
        self._waiting = 0
        self._drawing = Drawing()
        self._map = Rounds(lambda: self._draw("map", digest=True))
        self._geojson = Rounds(lambda: self._draw("geojson"))
        self._picture = Rounds(lambda: self._draw("picture"))

    # ---- looking

    async def state(self) -> RunState:
        """Where the search stands."""
        return (await self._looks.next()).moment.state

    async def ready(self) -> bool:
        """True while a search can take reports."""
        return (await self._looks.next()).ready

    async def moment(self) -> Moment:
        """What there is to see now."""
        return (await self._see()).moment

    async def searched(self) -> list[Outline]:
        """The ground that was searched, outlined, which takes long on a large map."""
        looked = (await self.moment()).pod >= POD_AT_LEAST
        return await asyncio.to_thread(outlines, self._ground.grid.frame, looked)

    def scene(self) -> dict[str, Any]:
        """What a page needs at first."""
        return self._ground.describe()

    async def regions(self) -> dict[str, Any]:
        """The regions as they are drawn now."""
        return (await self._ground_of(self._last)).described_regions()

    async def _ground_of(self, moment: Moment) -> SearchGround:
        """The ground with the regions of a moment, or of a later one, as the journal has them."""
        async with self._outlining:
            if moment.state["drawn"]["number"] > self._ground.drawn:
                last = await asyncio.to_thread(read_last_entries, self._journal, RegionsRow, 1)
                for entry in last:
                    assert isinstance(entry.said, RegionsRow)
                    self._ground = await asyncio.to_thread(self._ground.redrawn, entry.said.drawing)
            return self._ground

    def written(self, place: LatLon) -> str:
        """A place as the team writes places."""
        return self._ground.written(place)

    async def kept_picture(self, name: str) -> bytes | None:
        """A JPEG that came with a report."""
        return await asyncio.to_thread(self._images.read, name)

    def searchable(self) -> NDArray[np.bool_]:
        """The cells that are searched, [rows, cols]."""
        return self._ground.grid.searchable

    async def metrics(self) -> bytes:
        """What Prometheus is told."""
        return str((await self._metrics.next())["text"]).encode()

    async def decisions(self, count: int) -> bytes:
        """The last decisions with their reasons and options, the newest first, from the journal, as JSON."""
        return await self._drawing.decisions(self._journal, count)

    async def map(self) -> bytes:
        """Belief and POD, cell by cell, as JSON."""
        return await self._map.next()

    async def geojson(self) -> bytes:
        """The map as RFC 7946."""
        return await self._geojson.next()

    async def picture(self) -> bytes:
        """The map as a PNG."""
        return await self._picture.next()

    async def _see(self, *, digest: bool = False) -> _Look:
        wanted = self._wanted
        wanted.moment = wanted.arrays = True
        wanted.digest |= digest
        return await self._looks.next()

    async def _look(self) -> _Look:
        wanted, self._wanted = self._wanted, _Wanted()
        since = {name: len(rows) for name, rows in self._rows.items()}
        known = {**since, "tracks": [len(rows) for rows in self._tracks]}
        said = await self._asking.ask("look", LOOK_S, **vars(wanted), since=known)
        moment = replace(self._last, state=said["state"])
        if wanted.moment:
            for name, news in said["rows"].items():
                self._rows[name][news["from"] :] = news["rows"]
            self._tracks += [[] for _ in said["tracks"][len(self._tracks) :]]
            for rows, news in zip(self._tracks, said["tracks"], strict=True):
                rows[news["from"] :] = news["rows"]
            moment = replace(moment, total=said["total"], tracks=self._tracks, **self._rows)  # type: ignore[arg-type]
        if wanted.arrays:
            weights, pod = self._shared.read()
            moment = replace(moment, weights=weights, pod=pod)
        self._last = moment
        return _Look(said["ready"], moment, said.get("digest", ""))

    async def _draw(self, kind: str, *, digest: bool = False) -> bytes:
        look = await self._see(digest=digest)
        ground = await self._ground_of(look.moment)
        return await self._drawing.draw(kind, ground, Sight(look.moment, look.digest))

    def end(self) -> None:
        """Nobody asks any more."""
        self._drawing.end()

    # ---- reports and orders

    async def submit_all(self, reports: Sequence[Report]) -> list[Receipt]:
        """Detector reports; each receipt comes when its report is on disk. Raises JournalLost, Unanswered."""
        if self._waiting + len(reports) > MOST_WAITING:
            why = f"{MOST_WAITING} reports are waiting already; send it again, and more slowly"
            return [Receipt(id=each.id, status="refused", reason=why) for each in reports]
        self._waiting += len(reports)
        try:
            receipts: list[Receipt] = []
            reports = await self._without_images(reports)
            for texts in _frames(reports):
                async with self._frames:  # in turn: who sends many lets the others in between
                    said = await self._asking.ask("reports", DEED_S, reports=texts)
                receipts += [Receipt.model_validate(each) for each in said["receipts"]]
            return receipts
        finally:
            self._waiting -= len(reports)

    async def _without_images(self, reports: Sequence[Report]) -> Sequence[Report]:
        """The reports with addresses in place of their pictures, which the flight never sees."""
        if not any(map(brings, reports)):
            return reports
        return await asyncio.to_thread(lambda: [self._images.keep(each) for each in reports])

    async def order(
        self,
        command: str,
        place: tuple[float, float] | None = None,
        aircraft: str | None = None,
        system_id: int | None = None,
    ) -> OrderReceipt:
        """An operator's order; what became of it. Raises BadInput, JournalLost, Unanswered."""
        order: dict[str, Any] = {"command": command, "aircraft": aircraft, "system_id": system_id}
        if place is not None:
            order |= {"lat": place[0], "lon": place[1]}
        async with self._orders:
            said = await self._asking.ask("order", DEED_S, order=order)
        return OrderReceipt.model_validate(said["receipt"])

    async def hear(self, request: NewsRequest) -> HeardState:
        """News from the field. Raises BadInput, JournalLost, Unanswered."""
        news = request.model_dump(exclude_unset=True)
        async with self._news:
            return cast(HeardState, (await self._asking.ask("hear", DEED_S, news=news))["heard"])

    async def withdraw(self, name: str) -> HeardState:
        """News are taken back. Raises BadInput, JournalLost, Unanswered."""
        async with self._news:
            return cast(HeardState, (await self._asking.ask("withdraw", DEED_S, name=name))["heard"])


def _frames(reports: Sequence[Report]) -> Iterator[list[str]]:
    """Reports as texts, so many at a time as go into a frame."""
    texts: list[str] = []
    length = 0
    for report in reports:
        text = report.model_dump_json(by_alias=True, exclude_unset=True)
        if texts and (len(texts) == MOST_IN_A_FRAME or length + len(text) > MOST_TEXT):
            yield texts
            texts, length = [], 0
        texts.append(text)
        length += len(text)
    if texts:
        yield texts
