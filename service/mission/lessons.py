"""What a flight tells of how the aircraft moves: when it was nearest to the middle of each cell that it was sent over.

Pure: places and times in, flown paths out (`roisearch.motion_fit` learns from these).
"""

from __future__ import annotations

import itertools
import math
from collections import deque
from collections.abc import Sequence

from roisearch.directions import direction_between
from roisearch.motion_fit import Flown
from service.geometry import Cell

NEAR = 0.45
"""Cells from the middle: nearer than this the aircraft flies over the cell."""
EACH = 60
"""Cells that are flown from one lesson to the next."""
KEPT = 240
"""Cells flown that a lesson tells of, the last ones."""
CORNERS = 6
"""Fewer corners than this do not tell what one costs."""
UNSURE = 1
"""Cells after a beginning that are left out: how fast it came there is not known."""
FEWEST = 4
_STEP = (1.0, math.sqrt(2.0))  # from a cell to one of its neighbours


class Lessons:
    """Follows the flight along the legs that are committed."""

    def __init__(self) -> None:
        self._flights: deque[Flown] = deque()
        self._since = 0
        self._path: list[Cell] = []
        self._times: list[float] = []
        self._ahead: deque[Cell] = deque()
        self._best = (math.inf, 0.0)  # nearest so far to the next cell, and when

    def begin(self) -> None:
        """What was committed is not flown any more; what was flown of it stays."""
        self._close()
        self._ahead.clear()

    def commit(self, cells: Sequence[Cell]) -> None:
        """The aircraft is sent over these cells, after those before."""
        self._ahead.extend(cells)

    def at(self, place: tuple[float, float], time: float) -> None:
        """The aircraft is there, in rows and columns, at a time in seconds."""
        if self._times and time < self._times[-1]:
            self.begin()
        while self._ahead:
            away = math.dist(place, self._ahead[0])
            if away < NEAR:
                self._best = min(self._best, (away, time))
                return
            if math.isfinite(self._best[0]):
                self._over(self._ahead.popleft(), self._best[1])
                self._best = (math.inf, 0.0)
            elif len(self._ahead) > 1 and math.dist(place, self._ahead[1]) < NEAR:
                self._close()  # it was never over this one
                self._ahead.popleft()
            else:
                return

    def _over(self, cell: Cell, time: float) -> None:
        """It flew over a cell. One that is no neighbour of the last, to which it was sent across others, begins a
        flight of its own."""
        if self._path and math.dist(self._path[-1], cell) not in _STEP:
            self._close()
        self._path.append(cell)
        self._times.append(time)
        self._since += 1

    def take(self) -> tuple[Flown, ...]:
        """What was flown, when that is enough for another lesson; else nothing."""
        if self._since < EACH:
            return ()
        flights = list(self._flights)
        if (open_ := self._flown()) is not None:
            flights.append(open_)
        if sum(_corners(flight) for flight in flights) < CORNERS:
            return ()
        self._since = 0
        return tuple(flights)

    def _close(self) -> None:
        if (flown := self._flown()) is not None:
            self._flights.append(flown)
            while sum(len(flight.path) for flight in self._flights) - len(self._flights[0].path) > KEPT:
                self._flights.popleft()
        self._path, self._times, self._best = [], [], (math.inf, 0.0)

    def _flown(self) -> Flown | None:
        if len(self._path) < UNSURE + FEWEST:
            return None
        before, start = self._path[UNSURE - 1], self._path[UNSURE]
        path, times = self._path[UNSURE + 1 :], self._times[UNSURE + 1 :]
        return Flown(start, direction_between(before, start), tuple(path), tuple(times))


def _corners(flight: Flown) -> int:
    cells = [flight.start, *flight.path]
    directions = [direction_between(a, b) for a, b in itertools.pairwise(cells)]
    return sum(a != b for a, b in itertools.pairwise(directions))
