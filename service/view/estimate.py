"""How long it takes to this much POS if the search goes on and nothing is reported: an estimate, and its basis.

A search by the planner that flies is simulated from where the aircraft is, every look a miss, and timed by the motion
that the planner plans by. It runs in a thread of its own, on copies, with a planner of its own that makes one plan and
thinks no more, so that thousands of steps take a moment. Where several aircraft search, all that do are simulated
together.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from roisearch import Belief, SearchState
from roisearch.forecast import Flyer, Standing, expected_pos, expected_pos_together, steps_until
from service.geometry import Cell
from service.search import Search
from service.view.state import EstimateState, GoalState

Floats = NDArray[np.float64]
GOALS = (0.5, 0.75, 0.95)
MOST_STEPS = 6000
HEED = 8  # cells of a decision that are flown before the next
LEAST_PAUSE_S = 5.0
BASIS = (
    "if the search goes on and reports nothing; simulated with {planner} at the speeds that are known by now"
)
TOGETHER = ", for the {count} aircraft that search now"
STOPPED = ", and as if the target stopped now"


@dataclass(frozen=True)
class Forecast:
    """What a simulation by `planner` said: gains in POS from `pos` on, and the seconds from `flown` on at which they
    are there, float [n + 1] each; `crew`: the names of who flies."""

    pos: float
    flown: float
    reachable: float
    gained: Floats
    seconds: Floats
    planner: str
    basis: str = BASIS
    crew: tuple[str, ...] = ("",)

    def to_goals(self, pos: float, flown: float) -> EstimateState:
        """Seconds from now to each goal; None where it is not in reach."""
        goals: list[GoalState] = []
        for goal in GOALS:
            step = steps_until(self.gained, goal - self.pos)
            left = None if step is None else max(0.0, float(self.seconds[step]) - (flown - self.flown))
            goals.append({"pos": goal, "reached": pos >= goal, "seconds": 0.0 if pos >= goal else left})
        return {"goals": goals, "reachable": self.reachable, "basis": self.basis.format(planner=self.planner)}


class SearchingAircraft(NamedTuple):
    """Who searches: the search as it has it, and the cell and heading that it has."""

    search: Search
    cell: Cell
    heading: str


class Estimator:
    """Keeps a forecast of one search up to date while somebody asks for it."""

    def __init__(self, monotonic: Callable[[], float]) -> None:
        """`monotonic`: seconds of the wall, that forecasts do not follow each other too closely."""
        self._monotonic = monotonic
        self._thread = ThreadPoolExecutor(max_workers=1, thread_name_prefix="forecast")
        self._running: Future[Forecast] | None = None
        self._last: Forecast | None = None
        self._of: tuple[float, int, tuple[str, ...]] | None = None
        self._at = -LEAST_PAUSE_S

    def latest(self, crew: Sequence[SearchingAircraft], flown: float) -> Forecast | None:
        """The last forecast; a new one is begun when the search has gone on since, or others fly it."""
        if self._running is not None and self._running.done():
            self._last, self._running = self._running.result(), None
        known, names = crew[0].search.known, tuple(each.search.aircraft for each in crew)
        if self._last is not None and self._last.crew != names:
            self._last = None
        key = (known.belief.total, known.record.looks, names)
        if self._running is None and key != self._of and self._monotonic() - self._at >= LEAST_PAUSE_S:
            self._of, self._at = key, self._monotonic()
            belief, left, pos = known.belief.copy(), known.record.undetected(), known.record.pos
            think = _of_one if len(crew) == 1 else _of_several
            self._running = self._thread.submit(think, list(crew), belief, left, pos, flown)
        return self._last


def _state(of: SearchingAircraft) -> SearchState:
    return SearchState(cell=of.search.grid.nearest_flyable(of.cell), heading=of.heading)


def _of_one(
    crew: list[SearchingAircraft], belief: Belief, left: Floats, pos: float, flown: float
) -> Forecast:
    search, state, thinking = crew[0].search, _state(crew[0]), crew[0].search.foreseeing()
    reachable = pos + float(left[search.grid.flyable].sum())
    course = expected_pos(
        Standing(belief, left, state, search.visibility),
        thinking.planner,
        search.fov,
        steps=MOST_STEPS,
        until=min(GOALS[-1], reachable - 1e-3) - pos,
        heed=HEED,
        deadline_s=thinking.deadline_s,
    )
    arrivals = search.arrivals(course.cells, state.cell, state.heading, search.motion.speed_mps)
    seconds = np.concatenate([[0.0], arrivals])
    basis = BASIS if belief.walks is None else BASIS + STOPPED
    names = (search.aircraft,)
    return Forecast(pos, flown, reachable, course.gained, seconds, thinking.planner.name, basis, names)


def _of_several(
    crew: list[SearchingAircraft], belief: Belief, left: Floats, pos: float, flown: float
) -> Forecast:
    thinking = [each.search.foreseeing() for each in crew]
    flyers = [
        Flyer(
            mind.planner,
            one.search.fov,
            _state(one),
            one.search.grid.frame.cell_m / one.search.motion.speed_mps,
            partial(_arrivals, one.search),
            one.search.visibility,
        )
        for one, mind in zip(crew, thinking, strict=True)
    ]
    reachable = pos + float(left[crew[0].search.grid.flyable].sum())
    course = expected_pos_together(
        belief,
        left,
        flyers,
        steps=MOST_STEPS,
        until=min(GOALS[-1], reachable - 1e-3) - pos,
        heed=HEED,
        deadline_s=thinking[0].deadline_s,
    )
    basis = BASIS + TOGETHER.format(count=len(crew)) + ("" if belief.walks is None else STOPPED)
    names = tuple(each.search.aircraft for each in crew)
    planner = thinking[0].planner.name
    return Forecast(pos, flown, reachable, course.gained, course.seconds, planner, basis, names)


def _arrivals(search: Search, path: Sequence[Cell], state: SearchState) -> Floats:
    return search.arrivals(path, state.cell, state.heading, search.motion.speed_mps)
