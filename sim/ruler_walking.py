"""The exact ruler for a target that walks: F(t) by forward filtering, over all targets and all their walks.

As `sim.ruler_seconds`, but what is still undetected walks on between two looks: it is the mass of the targets that no
look so far has detected, each where it is by now (Brown, 'Optimal search for a moving target in discrete time and
space', Operations Research 28, 1980). A look adds p_tp times what is there to F. There are no false alarms, so one
flight is all flights. The aircraft turns at full speed: each cell takes its length.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from roisearch import Belief, Motion, Planner, SearchState, Walk
from roisearch.decision import Cell
from roisearch.detection import DetectionRecord
from roisearch.directions import direction_between, direction_index


@dataclass(frozen=True)
class Chase:
    """How a flight after a target that walks is flown.

    Attributes:
        walk: how the target walks.
        motion: of the aircraft, without the time to speed up and to turn.
        start: where it begins, at full speed.
        p_tp: of a look.
        until_s: for how long it flies.
        believes: whether the planner's belief walks as the target does; else it takes the target as still.
        ahead_s: by how much later than now it takes the belief that it plans on, seconds.
    """

    walk: Walk
    motion: Motion
    start: Cell = (0, 0)
    p_tp: float = 0.9
    until_s: float = 1800.0
    believes: bool = True
    ahead_s: float = 0.0


@dataclass(frozen=True, eq=False)
class Course:
    """The cells entered, int [n, 2], at `times`, float [n], and `found`, float [n]: F after each look."""

    path: NDArray[np.int64]
    times: NDArray[np.float64]
    found: NDArray[np.float64]

    def at(self, seconds: float) -> float:
        """F at a time."""
        return float(np.concatenate([[0.0], self.found])[np.searchsorted(self.times, seconds, side="right")])

    def expected(self, cap_s: float) -> float:
        """Expected seconds to the first detection, restricted to `cap_s`: the area above F."""
        times = np.minimum(np.concatenate([[0.0], self.times, [cap_s]]), cap_s)
        return float(np.diff(times) @ (1.0 - np.concatenate([[0.0], self.found])))


def chase(
    planner: Planner, prior: NDArray[np.float64], rng: np.random.Generator, how: Chase, *, stride: int = 1
) -> Course:
    """Fly `planner` over `prior`, float [rows, cols], planning after every `stride` cells, as if nothing was found."""
    belief = Belief(prior, walk=how.walk if how.believes else None)
    truth = DetectionRecord(prior / prior.sum(), walk=how.walk)
    state, time = SearchState(how.start, "east"), 0.0
    path: list[Cell] = []
    times, found = [], []
    ahead: list[Cell] = []
    while True:
        if not ahead:
            thought = belief
            if how.ahead_s > 0.0:
                thought = belief.copy()
                thought.drift(how.ahead_s)
            ahead = list(planner.plan(thought, state, rng).path[:stride])
        cell = ahead.pop(0)
        direction = direction_between(state.cell, cell)
        passed = step_seconds(how.motion, direction)
        time += passed
        if time > how.until_s:
            break
        state = SearchState(cell, direction, how.motion.speed_mps)
        belief.drift(passed)
        truth.drift(passed)
        seen = np.array([cell], dtype=np.int64)
        truth.look(seen, np.array([how.p_tp]))
        belief.observe(seen, False, how.p_tp, 1.0)
        path.append(cell)
        times.append(time)
        found.append(truth.pos)
    return Course(np.array(path, dtype=np.int64).reshape(-1, 2), np.array(times), np.array(found))


def step_seconds(motion: Motion, direction: str) -> float:
    """What a step takes at full speed."""
    pace = motion.pace
    return (pace.diagonal_m if direction_index(direction) % 2 else pace.straight_m) / motion.speed_mps


def teleported(prior: NDArray[np.float64], how: Chase) -> Course:
    """What looks without ways between them find: one in the time of each straight step, where most is undetected."""
    truth = DetectionRecord(prior / prior.sum(), walk=how.walk)
    step_s = how.motion.cell_m / how.motion.speed_mps
    times = step_s * np.arange(1.0, how.until_s // step_s + 1.0)
    path, found = [], []
    for _ in times:
        truth.drift(step_s)
        cell = divmod(int(truth.undetected().argmax()), prior.shape[1])
        truth.look(np.array([cell], dtype=np.int64), np.array([how.p_tp]))
        path.append(cell)
        found.append(truth.pos)
    return Course(np.array(path, dtype=np.int64).reshape(-1, 2), times, np.array(found))
