"""How long it takes to this much POS if the search goes on and nothing is reported: an estimate, and its basis.

A search by the index rule is simulated from where the aircraft is, every look a miss, at the pace that the flight has
had so far. The index rule is near the default planner and cheap enough to fly thousands of steps in a moment.
It runs in a thread of its own, on copies.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from roisearch import SearchState, make_planner
from roisearch.forecast import expected_pos, steps_until
from service.search import Search

GOALS = (0.5, 0.75, 0.95)
MOST_STEPS = 6000
LEAST_PAUSE_S = 2.0
BASIS = "if the search goes on, reports nothing and keeps its pace; simulated with the index rule"


@dataclass(frozen=True)
class Forecast:
    """What a simulation said: gains in POS per step from `pos`, float [n + 1], of a start at `flown` seconds."""

    pos: float
    flown: float
    reachable: float
    gained: NDArray[np.float64]

    def to_goals(self, pos: float, flown: float, pace_s: float) -> dict[str, Any]:
        """Seconds from now to each goal at `pace_s` seconds a step; None where it is not in reach."""
        goals = []
        for goal in GOALS:
            steps = steps_until(self.gained, goal - self.pos)
            left = None if steps is None else max(0.0, steps * pace_s - (flown - self.flown))
            goals.append({"pos": goal, "reached": pos >= goal, "seconds": 0.0 if pos >= goal else left})
        return {"goals": goals, "reachable": self.reachable, "basis": BASIS}


class Estimator:
    """Keeps a forecast of one search up to date while somebody asks for it."""

    def __init__(self, search: Search, monotonic: Callable[[], float]) -> None:
        """`monotonic`: seconds of the wall, that forecasts do not follow each other too closely."""
        self._search, self._monotonic = search, monotonic
        grid = search.grid
        self._planner = make_planner("index", fov=search.fov, flyable=grid.flyable, regions=search.regions)
        self._thread = ThreadPoolExecutor(max_workers=1, thread_name_prefix="forecast")
        self._running: Future[Forecast] | None = None
        self._last: Forecast | None = None
        self._of: tuple[float, int] | None = None
        self._at = -LEAST_PAUSE_S

    def warm_up(self) -> None:
        """Compile what a forecast needs."""
        self._planner.warm_up()

    def latest(self, cell: tuple[int, int], heading: str, flown: float) -> Forecast | None:
        """The last forecast; a new one is begun when the search has gone on since."""
        if self._running is not None and self._running.done():
            self._last, self._running = self._running.result(), None
        search = self._search
        key = (search.belief.total, search.record.looks)
        if self._running is None and key != self._of and self._monotonic() - self._at >= LEAST_PAUSE_S:
            self._of, self._at = key, self._monotonic()
            belief, left, pos = search.belief.copy(), search.record.undetected(), search.record.pos
            sensor, state = (
                search.settings.sensor,
                SearchState(cell=search.nearest_flyable(cell), heading=heading),
            )
            reachable = pos + float(left[search.grid.flyable].sum())

            def think() -> Forecast:
                gained = expected_pos(
                    belief,
                    left,
                    state,
                    self._planner,
                    search.fov,
                    p_tp=sensor.p_tp,
                    p_tn=sensor.p_tn,
                    steps=MOST_STEPS,
                    until=min(GOALS[-1], reachable - 1e-3) - pos,
                )
                return Forecast(pos, flown, reachable, gained)

            self._running = self._thread.submit(think)
        return self._last
