"""How the probability of success grows if the search goes on and reports nothing: the expected course."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from roisearch.belief import Belief
from roisearch.decision import SearchState
from roisearch.fov import HEADINGS, MOVES, FieldOfView
from roisearch.planners.base import Planner


def expected_pos(
    belief: Belief,
    undetected: NDArray[np.float64],
    state: SearchState,
    planner: Planner,
    fov: FieldOfView,
    *,
    p_tp: float,
    p_tn: float,
    steps: int,
    until: float = 1.0,
    heed: int = 4,
) -> NDArray[np.float64]:
    """What is gained in POS after each step from here, float [n + 1] with n <= `steps` and a zero first.

    The planner flies on as it would, and every look of the simulated flight misses. What a look is worth
    does not depend on what it reports (see `roisearch.bounds`): it detects the target with p_tp times the mass of
    the cell that no look has detected yet. A hit would make the real flight look again and so be longer.

    Args:
        belief: where the target may be; not changed.
        undetected: float [rows, cols], the prior mass that no look so far would have detected.
        planner: asked every `heed` steps; one of its own, for it may keep a plan.
        until: the simulation ends when so much is gained, or when the target would be detected for sure.
    """
    thought, left = belief.copy(), undetected.copy()
    cell, heading = state.cell, state.heading
    gained = [0.0]
    rng = np.random.default_rng(0)
    misses = np.zeros(1, dtype=np.bool_)
    while len(gained) <= steps and gained[-1] < until:
        decision = planner.plan(thought, SearchState(cell=cell, heading=heading), rng)
        for ahead in decision.path[:heed]:
            heading, cell = _heading(cell, ahead), ahead
            seen = fov.cells(cell, heading, belief.shape)
            rows, cols = seen[:, 0], seen[:, 1]
            gain = left[rows, cols] * p_tp
            left[rows, cols] -= gain
            gained.append(gained[-1] + float(gain.sum()))
            if p_tp == 1.0 and _nowhere_else(thought, seen):  # which no miss could explain
                return np.array(gained[: steps + 1])
            thought.observe(seen, misses, p_tp, p_tn)
    return np.array(gained[: steps + 1])


def steps_until(gained: NDArray[np.float64], wanted: float) -> int | None:
    """The first step at which `gained` (float [n + 1]) reaches `wanted`; None when it does not."""
    step = int(np.searchsorted(gained, wanted))
    return step if step < len(gained) else None


def _nowhere_else(belief: Belief, cells: NDArray[np.int64]) -> bool:
    """Whether the target can only be in one of `cells`."""
    there = np.count_nonzero(belief.mass_at(cells))
    return belief.outside == 0.0 and there == np.count_nonzero(belief.weights)


def _heading(here: tuple[int, int], there: tuple[int, int]) -> str:
    return HEADINGS[MOVES.index((there[0] - here[0], there[1] - here[1]))]
