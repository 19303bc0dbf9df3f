"""How the probability of success grows if the search goes on and reports nothing: the expected course."""

from __future__ import annotations

import heapq
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from roisearch.belief import Belief
from roisearch.decision import Cell, SearchState
from roisearch.directions import direction_between
from roisearch.fleet import Fleet
from roisearch.fov import FieldOfView
from roisearch.planners.base import Planner


@dataclass(frozen=True, eq=False)
class Standing:
    """Where a search stands.

    Attributes:
        belief: where the target may be; a forecast does not change it.
        undetected: float [rows, cols], the prior mass that no look so far would have detected.
        state: where the drone is.
        visibility: float [rows, cols], what a look finds there as a share of the field of view's p_tp; None: all.
    """

    belief: Belief
    undetected: NDArray[np.float64]
    state: SearchState
    visibility: NDArray[np.float64] | None = None


class Course(NamedTuple):
    """The `cells` that are entered, n of them, and what is `gained` in POS: float [n + 1], a zero first."""

    cells: tuple[Cell, ...]
    gained: NDArray[np.float64]


def expected_pos(
    now: Standing,
    planner: Planner,
    fov: FieldOfView,
    *,
    steps: int,
    until: float = 1.0,
    heed: int = 4,
    deadline_s: float | None = None,
) -> Course:
    """The cells entered from here on, and what is gained in POS by each of them, n <= `steps` at most.

    The planner flies on as it would, and every look of the simulated flight misses. What a look is worth
    does not depend on what it reports (see `roisearch.bounds`): it detects the target with its p_tp times the
    mass of the cell that no look has detected yet. A hit would make the real flight look again and so be longer.

    Args:
        now: where the search stands.
        planner: asked every `heed` steps; one of its own, for it may keep a plan.
        until: the simulation ends when so much is gained, or when the target would be detected for sure.
        deadline_s: for each of its decisions, see `Planner.plan`.
    """
    thought, left = now.belief.copy(), now.undetected.copy()
    cell, heading = now.state.cell, now.state.heading
    path: list[Cell] = []
    gained = [0.0]
    rng = np.random.default_rng(0)
    while len(gained) <= steps and gained[-1] < until:
        decision = planner.plan(thought, SearchState(cell=cell, heading=heading), rng, deadline_s=deadline_s)
        for ahead in decision.path[:heed]:
            heading, cell = direction_between(cell, ahead), ahead
            path.append(cell)
            gain, sure = _look(thought, left, fov, cell, heading, now.visibility)
            gained.append(gained[-1] + gain)
            if sure:
                return Course(tuple(path[:steps]), np.array(gained[: steps + 1]))
    return Course(tuple(path[:steps]), np.array(gained[: steps + 1]))


@dataclass(frozen=True, eq=False)
class Flyer:
    """One of several that search together, for a forecast.

    Attributes:
        planner: one of its own, for it may keep a plan. fov: what it sees.
        state: where it is.
        step_s: seconds that it takes from cell to cell, about.
        arrivals: the seconds at which the cells of a path are entered, from a cell and a heading: float [n].
        visibility: as of `Standing`.
    """

    planner: Planner
    fov: FieldOfView
    state: SearchState
    step_s: float
    arrivals: Callable[[Sequence[Cell], SearchState], NDArray[np.float64]]
    visibility: NDArray[np.float64] | None = None


class JointCourse(NamedTuple):
    """What is `gained` in POS by all of them together, and at which `seconds`: float [n + 1] each, zeros first."""

    seconds: NDArray[np.float64]
    gained: NDArray[np.float64]


def expected_pos_together(
    belief: Belief,
    undetected: NDArray[np.float64],
    flyers: Sequence[Flyer],
    *,
    steps: int,
    until: float = 1.0,
    heed: int = 4,
    deadline_s: float | None = None,
) -> JointCourse:
    """The same for several on one belief, who know of one another's plans as in a `Fleet`; `steps` of all together.

    Whoever is free first decides next and flies `heed` cells, whose looks the others know from then on.
    """
    thought, left, rng, fleet = belief.copy(), undetected.copy(), np.random.default_rng(0), Fleet()
    for number, flyer in enumerate(flyers):
        fleet.join(str(number), fov=flyer.fov, step_s=flyer.step_s, planner=flyer.planner)
    states, free = [flyer.state for flyer in flyers], [(0.0, number) for number in range(len(flyers))]
    looks: list[tuple[float, float]] = []
    gained = 0.0
    while free and len(looks) < steps and gained < until:
        at, number = heapq.heappop(free)
        flyer, state = flyers[number], states[number]
        decision = fleet.plan(str(number), thought, state, rng, now_s=at, deadline_s=deadline_s)
        path = decision.path[:heed]
        if not path:
            continue
        seconds = flyer.arrivals(path, state)
        for cell, when in zip(path, seconds.tolist(), strict=True):
            state = SearchState(cell=cell, heading=direction_between(state.cell, cell))
            gain, sure = _look(thought, left, flyer.fov, cell, state.heading, flyer.visibility)
            looks.append((at + when, gain))
            gained += gain
            if sure:
                return _in_time(looks)
        states[number] = state
        heapq.heappush(free, (looks[-1][0], number))
    return _in_time(looks[:steps])


def _in_time(looks: list[tuple[float, float]]) -> JointCourse:
    seconds, gains = np.array([(0.0, 0.0), *sorted(looks)]).T
    return JointCourse(seconds, np.cumsum(gains))


def _look(
    thought: Belief,
    left: NDArray[np.float64],
    fov: FieldOfView,
    cell: Cell,
    heading: str,
    visibility: NDArray[np.float64] | None,
) -> tuple[float, bool]:
    """Look in vain from a cell; what that gains in POS, and whether no miss could explain it."""
    seen, p_tp, p_tn = fov.looks(cell, heading, thought.shape)
    rows, cols = seen[:, 0], seen[:, 1]
    gain = left[rows, cols] * p_tp
    if visibility is not None:  # a target that is hidden is reported as rarely as no target
        gain *= visibility[rows, cols]
        p_tp = 1.0 - p_tn + visibility[rows, cols] * (p_tp - (1.0 - p_tn))
    left[rows, cols] -= gain
    sure = bool((p_tp == 1.0).all()) and _nowhere_else(thought, seen)
    if not sure:
        thought.observe(seen, np.zeros(len(seen), dtype=np.bool_), p_tp, p_tn)
    return float(gain.sum()), sure


def steps_until(gained: NDArray[np.float64], wanted: float) -> int | None:
    """The first step at which `gained` (float [n + 1]) reaches `wanted`; None when it does not."""
    step = int(np.searchsorted(gained, wanted))
    return step if step < len(gained) else None


def _nowhere_else(belief: Belief, cells: NDArray[np.int64]) -> bool:
    """Whether the target can only be in one of `cells`."""
    there = np.count_nonzero(belief.mass_at(cells))
    return belief.outside == 0.0 and there == np.count_nonzero(belief.weights)
