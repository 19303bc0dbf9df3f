"""A round of annealing: the looks of a plan are put in a better order while its next steps are flown.

It takes a copy of the plan from some steps ahead on, anneals it (`order`, beside this file), and makes it the plan in
the end if it is better then. The temperature falls with the iterations, or with the way to where the round begins,
whichever is further: when the drone is there, the round is over.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from roisearch.kernels.records import Pose
from roisearch.planners.lookahead import order
from roisearch.planners.lookahead.chart import Chart
from roisearch.planners.lookahead.plans import LENGTH, NOW, Desk, PlanTree

PROPOSALS = 8
"""Proposals of one iteration, per step of the horizon: they take about as long as a simulation of the tree search."""
COLD = 0.001
"""Temperature at the end of a round, in steps."""
LONGEST = 1000
"""Most looks in a stretch that is drawn by its length."""


def make_looks(chart: Chart, n: int) -> order.Looks:
    """Room for a row of at most `n` looks, place 0 included, on a chart."""
    share = np.arange(order.LENGTHS) / order.LENGTHS

    def counts(*shape: int) -> NDArray[np.int32]:
        return np.zeros(shape, dtype=np.int32)

    return order.Looks(
        rows=chart.rows, cols=chart.cols, legal=chart.legal, is_open=chart.is_open,
        number=counts(n), row=counts(n), col=counts(n), worth=np.zeros(n), step=np.zeros(n), worths=np.zeros(n),
        moments=np.zeros(n), place=counts(n), action=np.zeros(n, dtype=np.int64), near=counts(n, order.NEAR),
        nears=counts(n), besides=counts(n), spare_number=counts(n), spare_row=counts(n), spare_col=counts(n),
        spare_worth=np.zeros(n), last=counts(chart.mass.size), before=counts(n),
        lengths=(LONGEST**share).astype(np.int64),
    )  # fmt: skip


class Annealer:
    """See the module's text.

    Attributes:
        is_open: whether a round is on.
        hold: where on the path it begins.
        made: iterations of it so far.
    """

    def __init__(self, horizon: int, desk: Desk) -> None:
        self._looks = make_looks(desk.chart, horizon + 2)
        self._proposals = PROPOSALS * horizon
        self._desk = desk
        self.is_open = False
        self.hold = 0
        self._n, self._whole = 0, 0.0
        self._hot = self._done = 0.0  # where the temperature began, and how far the round is, 0 to 1
        self.made = 0
        self._iterations = self._way = 0

    def begin(self, pose: Pose, tree: PlanTree, hold: int, iterations: int, hot: float) -> None:
        """Begin a round of at most so many iterations on the path of `tree` from index `hold` on."""
        self.hold = min(int(tree.mark[LENGTH]), hold)
        self._n, self._whole = order.line_up(pose, tree, self._desk, self.hold, self._looks)
        self._hot, self._done = hot, 0.0
        self._iterations, self.made = iterations, 0
        self._way = self.hold - 1 - int(tree.mark[NOW])
        self.is_open = True

    def go_on(self, tree: PlanTree) -> bool:
        """One iteration; whether the round is over."""
        self.made += 1
        left = self.hold - 1 - int(tree.mark[NOW])
        flown = 1.0 - left / self._way if self._way > 0 else 1.0
        before, self._done = self._done, min(1.0, max(self.made / self._iterations, flown))
        hot, cold = (self._hot * (COLD / self._hot) ** done for done in (before, self._done))
        order.anneal(self._n, self._whole, self._looks, self._desk.random, self._proposals, hot, cold)
        return self._done >= 1.0

    def end(self, pose: Pose, tree: PlanTree) -> bool:
        """End the round; whether the plan has become better."""
        self.is_open = False
        return order.lay(pose, self._n, self._looks, tree, self._desk, self.hold)
