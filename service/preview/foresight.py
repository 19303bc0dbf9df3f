"""The search that lies ahead, if the target is not detected: the real planner flown over a copy of the belief.

What a look is worth does not depend on what it reports, so POS along the path is exact (see `roisearch.bounds`). The
path is one that the planner may take: with `false_alarms`, the simulated detector raises as many as p_tn says, and
the planner looks again, as it will in the air.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from roisearch import SearchState
from service.evidence.observe import Footprint, Reading, observe
from service.evidence.passes import Passes
from service.mission.navigator import Cell, heading_between
from service.preview.pace import cell_seconds, leg_seconds
from service.search import Search

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
    settings, shape = search.settings, search.grid.frame.shape
    flight, cell_m = settings.flight, search.grid.frame.cell_m
    cells, pos, stops = [start], [], []
    heading, alarms, flown = "north", 0, 0.0
    passes = Passes()

    def look() -> bool:
        """Look from the last cell; True when the detector raised an alarm."""
        nonlocal alarms
        seen, p_tp, p_tn = search.fov.looks(cells[-1], heading, shape)
        hits: dict[Cell, float] = {}
        if false_alarms:
            draws = rng.random(len(seen)) >= p_tn
            for (row, col), alarm, tp, tn in zip(seen.tolist(), draws, p_tp, p_tn, strict=True):
                if alarm and (row, col) not in passes:
                    hits[row, col] = float(tp / (1.0 - tn))
        whole = np.ones(len(seen))
        reading = Reading(Footprint(seen, whole, whole > 0.0, p_tp, p_tn), hits)
        observation = observe(passes, "foresight", flown, reading)
        passes.settle()
        if observation is not None:
            search.apply(observation)
        pos.append(search.record.pos)
        alarms += len(hits)
        return bool(hits)

    look()
    while pos[-1] < until and flown < most_s and len(cells) <= most_steps:
        state = SearchState(cell=cells[-1], heading=heading)
        decision = search.planner.plan(search.belief, state, rng)  # without a deadline: the same every time
        for cell in decision.path[:HEED]:
            turned = heading_between(cells[-1], cell)
            flown += leg_seconds(cell_m, flight) if turned != heading else cell_m / flight.speed_mps
            heading = turned
            cells.append(cell)
            if look():
                stops.append(len(cells) - 1)
                break
            if pos[-1] >= until:
                break
        told(flown, pos[-1])
    seconds = cell_seconds(cells, stops, cell_m, flight)
    return Foresight(tuple(cells), seconds, np.array(pos), alarms)
