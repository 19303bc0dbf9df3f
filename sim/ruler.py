"""The exact ruler: the detection curve of a planner, without waiting for luck.

The planner is run as if the target stayed undetected. For each cell u is the mass that is still undetected
there; every look at the cell adds p_tp * u to F and leaves (1 - p_tp) * u. F(t) is then the distribution of
the time of the first true hit over all targets and all true detections, for this one sequence of looks.
With p_tn < 1 false alarms are drawn at every cell looked at; F is exact for them as drawn, except that a
target's own cell cannot give a false alarm, which the drawn sequence ignores.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from roisearch import Belief, Decision, FieldOfView, Planner, SearchState
from roisearch.fov import HEADINGS, MOVES


@dataclass(frozen=True)
class Ruler:
    """How a curve is measured.

    Attributes:
        p_tp, p_tn: of every cell of the field of view.
        fov: what is seen; the planner must have been made for the same.
        deadline_s: handed to `plan`.
        stop_below: stop when less than this is undetected, and count F as constant from there on, which can only
            overstate the expected time.
        follow: a path that was given without thinking (`Effort.iterations` = 0) is flown to its end before the next
            plan, which saves time where a planner that keeps its plan would only repeat it.
    """

    p_tp: float
    p_tn: float = 1.0
    fov: FieldOfView = field(default_factory=FieldOfView.point)
    deadline_s: float | None = None
    stop_below: float = 0.0
    follow: bool = False


def detection_curve(
    planner: Planner,
    prior: NDArray[np.float64],
    start: tuple[int, int],
    steps: int,
    ruler: Ruler,
    rng: np.random.Generator,
    *,
    heading: str = "north",
    searchable: NDArray[np.bool_] | None = None,
) -> NDArray[np.float64]:
    """F of `planner` on `prior`, float [steps + 1]; it plans at every step, unless the ruler follows."""
    p_tp = ruler.p_tp
    belief = Belief(prior, searchable=searchable)
    undetected = belief.probability()
    state = SearchState(start, heading)
    curve = np.zeros(steps + 1)
    found = 0.0
    ahead: list[tuple[int, int]] = []
    for step in range(1, steps + 1):
        if not ahead:
            decision = planner.plan(belief, state, rng, deadline_s=ruler.deadline_s)
            ahead = unthought(decision, state.cell) if ruler.follow else [decision.path[0]]
        cell = ahead.pop(0)
        move = MOVES.index((cell[0] - state.cell[0], cell[1] - state.cell[1]))
        state = SearchState(cell, HEADINGS[move])
        seen = ruler.fov.cells(cell, state.heading, belief.shape)
        rows, cols = seen[:, 0], seen[:, 1]
        found += p_tp * float(undetected[rows, cols].sum())
        undetected[rows, cols] *= 1.0 - p_tp
        curve[step] = found
        # A perfect detector leaves nothing in the end, and no belief could explain one more miss.
        if 1.0 - found < ruler.stop_below or (p_tp == 1.0 and not undetected.any()):
            curve[step:] = found
            break
        if len(seen):
            belief.observe(seen, rng.random(len(seen)) >= ruler.p_tn, p_tp, ruler.p_tn)
    return np.minimum(curve, 1.0)


def unthought(decision: Decision, at: tuple[int, int]) -> list[tuple[int, int]]:
    """The cells to fly before the next plan: one, or if nothing was thought all until a cell comes again."""
    cells = [decision.path[0]]
    if decision.effort.iterations == 0:
        for cell in decision.path[1:]:
            if cell == at or cell in cells:
                break
            cells.append(cell)
    return cells
