"""A replayed run at the door: each answer is worked out in a thread, one after the other, for its own time."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray
from prometheus_client import generate_latest

from service.errors import BadInput
from service.evidence.reports import OrderReceipt, Receipt, Report
from service.geometry import LatLon
from service.news.request import NewsRequest
from service.view.feed import Moment
from service.view.maps import geojson_text, map_text
from service.view.replay import ReplayView
from service.view.state import HeardState, RunState

_T = TypeVar("_T")


@dataclass(frozen=True, eq=False)
class _Then:
    """The run at a time. The view is one and is set to each time in turn, so only one looks at it at once."""

    view: ReplayView
    turn: asyncio.Lock
    time: float

    async def _look(self, what: Callable[[ReplayView], _T]) -> _T:
        def look() -> _T:
            return what(self.view.at(self.time))

        async with self.turn:
            return await asyncio.to_thread(look)

    async def state(self) -> RunState:
        """Where the search stood."""
        return await self._look(ReplayView.state)

    async def map(self) -> bytes:
        """Belief and POD, cell by cell, as JSON."""
        return await self._look(
            lambda view: map_text(view.ground_now(), view.seen(), view.search.belief.digest())
        )

    async def geojson(self) -> bytes:
        """The map as RFC 7946."""
        return await self._look(lambda view: geojson_text(view.ground_now(), view.seen()))

    async def picture(self) -> bytes:
        """The map as a PNG."""
        draw = await self._look(ReplayView.picture)  # of a copy: others look meanwhile
        return await asyncio.to_thread(draw)

    async def decisions(self, count: int) -> bytes:
        """The last decisions until then, the newest first, as JSON."""
        return await self._look(lambda view: json.dumps(view.decisions(count)).encode())

    async def moment(self) -> Moment:
        """What there was to see."""
        return await self._look(lambda view: view.moment().copied())

    async def regions(self) -> dict[str, Any]:
        """The regions as they were drawn."""
        return await self._look(lambda view: view.ground_now().described_regions())


class Replayed(_Then):
    """A run that is over, at its end and at any of its times; it takes neither reports nor orders."""

    def __init__(self, view: ReplayView) -> None:
        super().__init__(view, asyncio.Lock(), view.span()[1])

    def span(self) -> tuple[float, float]:
        """Its first and last time, seconds since the epoch."""
        return self.view.span()

    def at(self, time: float) -> _Then:
        """The run as it was at a time."""
        return _Then(self.view, self.turn, time)

    def scene(self) -> dict[str, Any]:
        """What a page needs at first; the regions, as they were at the start."""
        return self.view.ground.describe()

    def written(self, place: LatLon) -> str:
        """A place as the team writes places."""
        return self.view.ground.written(place)

    async def kept_picture(self, name: str) -> bytes | None:
        """A JPEG that came with a report."""
        return await asyncio.to_thread(self.view.images.read, name)

    def searchable(self) -> NDArray[np.bool_]:
        """The cells that are searched, [rows, cols]."""
        return self.view.ground.grid.searchable

    async def metrics(self) -> bytes:
        """What Prometheus is told."""
        return generate_latest(self.view.registry)

    async def ready(self) -> bool:
        """A replay takes no reports."""
        return False

    async def submit_all(self, reports: Sequence[Report]) -> list[Receipt]:
        """A replay takes no reports."""
        return [Receipt(id=each.id, status="refused", reason="this is a replay") for each in reports]

    async def order(
        self,
        command: str,
        place: tuple[float, float] | None = None,
        aircraft: str | None = None,
        system_id: int | None = None,
    ) -> OrderReceipt:
        """A replay takes no orders."""
        state = str((await self.state())["state"])
        return OrderReceipt(state=state, refused="this is a replay")

    async def hear(self, request: NewsRequest) -> HeardState:
        """A replay takes no news."""
        raise BadInput("this is a replay: it takes no news")

    async def withdraw(self, name: str) -> HeardState:
        """A replay takes no news."""
        raise BadInput("this is a replay: it takes no news")
