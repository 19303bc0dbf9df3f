"""What the door shows of a run, live or replayed. All of it may have to be asked for elsewhere, so all of it waits."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from service.evidence.reports import OrderReceipt, Receipt, Report
from service.geometry import LatLon
from service.news.request import NewsRequest
from service.view.feed import Moment
from service.view.state import HeardState, RunState


class Unanswered(Exception):
    """The flight does not answer: it stands still, or it is ending. What was asked may or may not have been done."""


class ShownMoment(Protocol):
    """A run at one time."""

    async def state(self) -> RunState:
        """Where the search stands."""
        ...

    async def map(self) -> bytes:
        """Belief and POD, cell by cell, as JSON."""
        ...

    async def geojson(self) -> bytes:
        """The map as RFC 7946."""
        ...

    async def picture(self) -> bytes:
        """The map as a PNG."""
        ...

    async def decisions(self, count: int) -> bytes:
        """The last decisions, the newest first, as JSON."""
        ...

    async def moment(self) -> Moment:
        """What there is to see."""
        ...

    async def regions(self) -> dict[str, Any]:
        """The regions as they are drawn at that time, for the page."""
        ...


class TakesWords(Protocol):
    """What takes in what detectors report, operators order, and the field tells."""

    async def submit_all(self, reports: Sequence[Report]) -> list[Receipt]:
        """Detector reports."""
        ...

    async def order(
        self,
        command: str,
        place: tuple[float, float] | None = None,
        aircraft: str | None = None,
        system_id: int | None = None,
    ) -> OrderReceipt:
        """An operator's order, to one aircraft or all; what became of it. Raises BadInput."""
        ...

    async def hear(self, request: NewsRequest) -> HeardState:
        """News from the field. Raises BadInput."""
        ...

    async def withdraw(self, name: str) -> HeardState:
        """News are taken back. Raises BadInput."""
        ...


class ShownRun(ShownMoment, TakesWords, Protocol):
    """A run as the door needs it."""

    def scene(self) -> dict[str, Any]:
        """What a page needs at first."""
        ...

    def written(self, place: LatLon) -> str:
        """A place (latitude, longitude) as the team writes places."""
        ...

    async def kept_picture(self, name: str) -> bytes | None:
        """A JPEG that came with a report, by its name; None when there is none of that name."""
        ...

    def searchable(self) -> NDArray[np.bool_]:
        """The cells that are searched, [rows, cols]."""
        ...

    async def metrics(self) -> bytes:
        """What Prometheus is told."""
        ...

    async def ready(self) -> bool:
        """True while a search can take reports."""
        ...


class PastRun(ShownRun, Protocol):
    """A run that is over, at any of its times."""

    def span(self) -> tuple[float, float]:
        """Its first and last time, seconds since the epoch."""
        ...

    def at(self, time: float) -> ShownMoment:
        """The run as it was at a time."""
        ...
