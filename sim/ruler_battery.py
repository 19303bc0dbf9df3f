"""What one battery finds, exactly: a flight ends where the aircraft would come home too late from the next cell."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from roisearch import Belief, FieldOfView, Motion, Planner, SearchState
from roisearch.decision import Cell
from roisearch.directions import direction_between
from roisearch.endurance import Endurance, straight_home
from roisearch.planners.ending import EndingPlanner
from sim.ruler_seconds import Chance

FOLLOW = 6
"""The most cells of a decision that are flown before the next."""


@dataclass(frozen=True, eq=False)
class Sortie:
    """One battery.

    Attributes:
        path: the cells entered, int [n, 2]; times: seconds from the first take-off at which each was, float [n].
        found: the probability of the first true detection there, float [n].
        homeward: what looks on the straight way home would find beside.
        undetected: what is left, float [rows, cols].
    """

    path: NDArray[np.int64]
    times: NDArray[np.float64]
    found: NDArray[np.float64]
    homeward: float
    undetected: NDArray[np.float64]

    @property
    def pos(self) -> float:
        """The probability of success of the search, way home not counted."""
        return float(self.found.sum())

    @property
    def mean_s(self) -> float:
        """Mean seconds until the target is found, of what is found."""
        return float(self.times @ self.found) / max(self.pos, 1e-12)


@dataclass(frozen=True)
class Battery:
    """From a stand at `home`, which is a cell; on the ground again `seconds` later, `landing_s` of them to land."""

    seconds: float
    home: Cell
    landing_s: float = 45.0


@dataclass(frozen=True)
class BatteryWorld:
    """What is searched, float [rows, cols], with what, and how the aircraft moves."""

    prior: NDArray[np.float64]
    fov: FieldOfView
    motion: Motion


def fly_battery(
    planner: Planner | EndingPlanner, world: BatteryWorld, battery: Battery, rng: np.random.Generator
) -> Sortie:
    """Fly `planner`, as if all looks were in vain but for false alarms, until the battery ends.

    An `EndingPlanner` is told when that is; any other is cut off then. Up to FOLLOW cells of a decision are flown
    before the next, if there is no alarm, as the service flies a leg.
    """
    belief, fov, motion = Belief(world.prior), world.fov, world.motion
    chance = Chance(int(rng.integers(2**63)), belief.shape)
    home_s = straight_home(motion, belief.shape, battery.home, battery.landing_s)
    state, path, now = SearchState(battery.home), [], 0.0
    while True:
        if isinstance(planner, EndingPlanner):
            left = Endurance(battery.seconds - now, home_s)
            decision = planner.plan(belief, state, rng, endurance=left)
        else:
            decision = planner.plan(belief, state, rng)
        for cell in decision.path[:FOLLOW]:
            path.append(cell)
            state = SearchState(cell, direction_between(state.cell, cell), motion.speed_mps)
            seen, p_tp, p_tn = fov.looks(cell, state.heading, belief.shape)
            hits = chance.draw(seen) >= p_tn
            belief.observe(seen, hits, p_tp, p_tn)
            if hits.any():
                break
        now = float(motion.arrivals(path, battery.home)[-1])
        if now + home_s[state.cell] > battery.seconds:
            return cut(path, world, battery)


def cut(path: Sequence[Cell], world: BatteryWorld, battery: Battery) -> Sortie:
    """What the looks along a path find, cell by cell until the first that is too late, and on the way home then."""
    home_s = straight_home(world.motion, world.prior.shape, battery.home, battery.landing_s)
    times = world.motion.arrivals(path, battery.home)
    flown = np.array(path)
    late = np.flatnonzero(times + home_s[flown[:, 0], flown[:, 1]] > battery.seconds)
    count = int(late[0]) if late.size else len(flown)
    undetected = Belief(world.prior).probability()
    found, heading, here = [], "north", battery.home
    for row, col in flown[:count].tolist():
        heading, here = direction_between(here, (row, col)), (row, col)
        found.append(_look(here, heading, undetected, world.fov))
    left = undetected.copy()
    homeward = sum(_look(cell, "north", undetected, world.fov) for cell in straight_cells(here, battery.home))
    return Sortie(flown[:count], times[:count], np.array(found), homeward, left)


def _look(cell: Cell, heading: str, undetected: NDArray[np.float64], fov: FieldOfView) -> float:
    seen, p_tp, _ = fov.looks(cell, heading, undetected.shape)
    rows, cols = seen[:, 0], seen[:, 1]
    gain = float((p_tp * undetected[rows, cols]).sum())
    undetected[rows, cols] *= 1.0 - p_tp
    return gain


def straight_cells(start: Cell, end: Cell) -> list[Cell]:
    """The cells under the straight line between two cells, without the first."""
    count = max(abs(end[0] - start[0]), abs(end[1] - start[1]))
    along = np.arange(1, count + 1)[:, None] / max(1, count)
    cells = np.rint(np.array(start) + along * (np.array(end) - np.array(start))).astype(int)
    return [(row, col) for row, col in cells.tolist()]
