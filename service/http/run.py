"""What the door shows of a run, live or replayed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from prometheus_client import CollectorRegistry

from service.evidence.reports import Receipt, Report
from service.view.feed import Moment


class Run(Protocol):
    """A run as the door needs it."""

    registry: CollectorRegistry

    def state(self) -> dict[str, Any]:
        """Where the search stands."""
        ...

    def map(self) -> dict[str, Any]:
        """Belief and POD, cell by cell."""
        ...

    def geojson(self) -> dict[str, Any]:
        """The map as RFC 7946."""
        ...

    def picture(self) -> Callable[[], bytes]:
        """What draws the map as it is now, as a PNG."""
        ...

    def decisions(self, count: int) -> list[dict[str, Any]]:
        """The last decisions, the newest first."""
        ...

    def scene(self) -> dict[str, Any]:
        """What does not change during the run."""
        ...

    def searchable(self) -> NDArray[np.bool_]:
        """The cells that are searched, [rows, cols]."""
        ...

    def moment(self) -> Moment:
        """What there is to see now."""
        ...

    async def moment_at(self, at: float) -> Moment:
        """What there was to see at a time, in seconds since the epoch; a live run only knows now."""
        ...

    def ready(self) -> bool:
        """True while a search can take reports."""
        ...

    async def submit_all(self, reports: Sequence[Report]) -> list[Receipt]:
        """Detector reports."""
        ...

    async def order(self, command: str, place: tuple[float, float] | None = None) -> str:
        """An operator's order; the state after it."""
        ...


class PastRun(Run, Protocol):
    """A run that is over, at any of its times."""

    def span(self) -> tuple[float, float]:
        """Its first and last time, seconds since the epoch."""
        ...

    def at(self, time: float) -> Run:
        """The run as it was at a time."""
        ...
