"""A round of annealing: the looks of a plan are put in a better order while its next steps are flown.

It takes a copy of the plan from some steps ahead on, anneals it (`roisearch.kernels.order`), and makes it the plan in
the end if it is better then. The temperature falls with the iterations, or with the way to where the round begins,
whichever is further: when the drone is there, the round is over.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from roisearch.kernels import order
from roisearch.kernels.plans import LENGTH, NOW, Desk, Tree

PROPOSALS = 8
"""Proposals of one iteration, per step of the horizon: they take about as long as a simulation of the tree search."""
COLD = 0.001
"""Temperature at the end of a round, in steps."""
LONGEST = 1000
"""Most looks in a stretch that is drawn by its length."""


class Annealer:
    """See the module's text.

    Attributes:
        is_open: whether a round is on.
        hold: where on the path it begins.
    """

    def __init__(self, horizon: int, desk: Desk) -> None:
        n = horizon + 2
        share = np.arange(order.LENGTHS) / order.LENGTHS
        chart = desk.chart

        def counts(*shape: int) -> NDArray[np.int32]:
            return np.zeros(shape, dtype=np.int32)

        self._looks = order.Looks(
            rows=chart.rows, cols=chart.cols, legal=chart.legal, is_open=chart.is_open,
            number=counts(n), row=counts(n), col=counts(n), worth=np.zeros(n), step=np.zeros(n), worths=np.zeros(n),
            moments=np.zeros(n), place=counts(n), action=np.zeros(n, dtype=np.int64), near=counts(n, order.NEAR),
            nears=counts(n), besides=counts(n), spare_number=counts(n), spare_row=counts(n), spare_col=counts(n),
            spare_worth=np.zeros(n), last=counts(chart.mass.size), before=counts(n),
            lengths=(LONGEST**share).astype(np.int64),
        )  # fmt: skip
        self._proposals = PROPOSALS * horizon
        self._desk = desk
        self.is_open = False
        self.hold = 0
        self._n, self._whole = 0, 0.0
        self._hot = self._done = 0.0  # where the temperature began, and how far the round is, 0 to 1
        self._iterations = self._made = self._way = 0

    def begin(self, pose: tuple[int, int, int], tree: Tree, hold: int, iterations: int, hot: float) -> None:
        """Begin a round of at most so many iterations on the path of `tree` from index `hold` on."""
        self.hold = min(int(tree.mark[LENGTH]), hold)
        self._n, self._whole = order.line_up(*pose, self._desk.chart, tree, self.hold, self._looks)
        self._hot, self._done = hot, 0.0
        self._iterations, self._made = iterations, 0
        self._way = self.hold - 1 - int(tree.mark[NOW])
        self.is_open = True

    def go_on(self, tree: Tree) -> bool:
        """One iteration; whether the round is over."""
        self._made += 1
        left = self.hold - 1 - int(tree.mark[NOW])
        flown = 1.0 - left / self._way if self._way > 0 else 1.0
        before, self._done = self._done, min(1.0, max(self._made / self._iterations, flown))
        hot, cold = (self._hot * (COLD / self._hot) ** done for done in (before, self._done))
        order.anneal(self._n, self._whole, self._looks, self._desk.random, self._proposals, hot, cold)
        return self._done >= 1.0

    def end(self, pose: tuple[int, int, int], tree: Tree) -> bool:
        """End the round; whether the plan has become better."""
        d = self._desk
        self.is_open = False
        return order.lay(
            *pose, self._n, self._looks, d.chart, tree, d.rules, d.labels, d.home, d.wave, self.hold
        )
