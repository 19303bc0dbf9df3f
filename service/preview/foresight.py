"""The search that lies ahead, if the target is not detected: the real planner flown over a copy of the belief.

What a look is worth does not depend on what it reports, so POS along the path is exact (see `roisearch.bounds`). The
path is one that the planner may take: with `false_alarms`, the simulated detector raises as many as p_tn says, and
the planner looks again, as it will in the air. How long the path takes says the motion that the planner plans by.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from roisearch import SearchState
from roisearch.directions import direction_between, direction_index
from service.evidence.cover import covered_p_tp
from service.evidence.observe import Footprint, Reading, observe
from service.evidence.passes import Passes
from service.geometry import Cell
from service.search import Search

MOSTLY = 0.5
"""A cell that is seen in fewer of the directions is foreseen not to be."""
HEED = 8
"""Cells of a decision that are flown before the next, if there is no alarm: the planner keeps to its plan anyway."""


@dataclass(frozen=True, eq=False)
class Foresight:
    """A path and what comes of it.

    Attributes:
        cells: the cells entered in order, the start first.
        seconds: when each is entered, float [n], the first at 0.
        pos: probability of success after its look, float [n].
        alarms: how many false alarms the simulated detector raised.
    """

    cells: tuple[Cell, ...]
    seconds: NDArray[np.float64]
    pos: NDArray[np.float64]
    alarms: int

    def when(self, pos: float) -> float | None:
        """Seconds until POS reaches a level; None when it does not on this path."""
        at = int(np.searchsorted(self.pos, pos))
        return float(self.seconds[at]) if at < len(self.pos) else None

    def pos_at(self, seconds: float) -> float:
        """POS after so many seconds."""
        return float(self.pos[max(0, int(np.searchsorted(self.seconds, seconds, side="right")) - 1)])


class Simulated:
    """A search that is flown, which is used up by it: the cells entered, POS after each, the false alarms, and
    about how long it took."""

    def __init__(self, search: Search, start: Cell, rng: np.random.Generator, *, false_alarms: bool) -> None:
        self.search, self.cells, self.heading = search, [start], "north"
        self.pos: list[float] = []
        self.alarms, self.flown_s = 0, 0.0
        self._began = search.known.time or 0.0  # it goes on after what was flown before
        self._rng, self._false_alarms, self._passes = rng, false_alarms, Passes()
        self._look()

    def enter(self, cell: Cell) -> bool:
        """Look from the next cell; True when the detector raised an alarm."""
        before, self.heading = self.heading, direction_between(self.cells[-1], cell)
        self.cells.append(cell)
        self.flown_s += self._move_seconds(before)
        return self._look()

    def _look(self) -> bool:
        search = self.search
        seen, p_tp, p_tn = search.fov.looks(self.cells[-1], self.heading, search.grid.frame.shape)
        if search.in_sight is not None:
            shown = search.in_sight[seen[:, 0], seen[:, 1]] >= MOSTLY
            seen, p_tp, p_tn = seen[shown], p_tp[shown], p_tn[shown]
        if search.grid.visibility is not None:
            p_tp = covered_p_tp(p_tp, p_tn, search.grid.visibility[seen[:, 0], seen[:, 1]])
        hits: dict[Cell, float] = {}
        if self._false_alarms:
            draws = self._rng.random(len(seen)) >= p_tn
            for (row, col), alarm, tp, tn in zip(seen.tolist(), draws, p_tp, p_tn, strict=True):
                if alarm and (row, col) not in self._passes:
                    hits[row, col] = float(tp / (1.0 - tn))
        whole = np.ones(len(seen))
        reading = Reading(Footprint(seen, whole, whole > 0.0, p_tp, p_tn), hits)
        observation = observe(self._passes, "foresight", float(len(self.cells)), reading)
        self._passes.settle()
        if observation is not None:
            search.take(
                observation, self._began + self.flown_s
            )  # a target that walks has walked on until then
        self.pos.append(search.record.pos)
        self.alarms += len(hits)
        return bool(hits)

    def _move_seconds(self, before: str) -> float:
        """About how long the last move took, the corner before it included."""
        motion, heights = self.search.motion, self.search.heights
        turned = (direction_index(self.heading) - direction_index(before) + 4) % 8 - 4
        metres = motion.pace.diagonal_m if direction_index(self.heading) % 2 else motion.pace.straight_m
        seconds = metres / motion.speed_mps + (motion.corner_seconds(45 * abs(turned)) if turned else 0.0)
        if heights is None:
            return seconds
        return max(seconds, float(motion.upright_s(heights[self.cells[-1]] - heights[self.cells[-2]])))

    def foresight(self) -> Foresight:
        """What was flown so far, timed by the motion that the planner plans by."""
        cells = self.cells
        flown = self.search.arrivals(cells[1:], cells[0]) if len(cells) > 1 else np.zeros(0)
        seconds = np.concatenate([[0.0], flown])
        return Foresight(tuple(cells), seconds, np.array(self.pos), self.alarms)


def foresee(
    search: Search,
    start: Cell,
    *,
    most_s: float,
    until: float,
    most_steps: int,
    rng: np.random.Generator,
    false_alarms: bool = True,
    told: Callable[[float, float], None] = lambda seconds, pos: None,
) -> Foresight:
    """Fly `search`, which is used up by it, from `start` until POS is `until`, or for so many seconds or steps.

    `told` hears how far it is, in seconds of flight and POS.
    """
    flight = Simulated(search, start, rng, false_alarms=false_alarms)
    while flight.pos[-1] < until and flight.flown_s < most_s and len(flight.cells) <= most_steps:
        state = SearchState(cell=flight.cells[-1], heading=flight.heading)
        decision = search.planner.plan(search.belief, state, rng)  # without a deadline: the same every time
        for cell in decision.path[:HEED]:
            if flight.enter(cell) or flight.pos[-1] >= until:
                break
        told(flight.flown_s, flight.pos[-1])
    return flight.foresight()
