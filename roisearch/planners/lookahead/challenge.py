"""A second plan, grown beside the one that is flown; see `roisearch.planners.lookahead.thinking`."""

from __future__ import annotations

import numpy as np

from roisearch.planners.lookahead import plans
from roisearch.planners.lookahead.plans import EXPECTED, LENGTH, LOSS, N_A, NODES, NOW, UNDETECTED

LEAVES = (96, 960)
"""After how many steps a challenger leaves the plan, drawn evenly in the logarithm."""


class Challenger:
    """See the module's text.

    Attributes:
        tree: its plan and nodes; what is room for trials in it is shared with the plan that it was made from.
        is_open: whether there is one at present.
        leaves: where on the path it leaves the plan.
        stale: iterations since it got better.
        lost: challengers in a row that did not become the plan.
    """

    def __init__(self, tree: plans.PlanTree) -> None:
        own = ("path", "action", "mark", "at", "stats", "worths", "value")
        self.tree = tree._replace(**{name: np.zeros_like(getattr(tree, name)) for name in own})
        self.is_open = False
        self.leaves = self.stale = self.lost = 0

    def begin(self, tree: plans.PlanTree, share: float, whole: bool) -> None:
        """Leave the plan where `share`, 0 to 1, says.

        It is a copy of the `whole` plan, or ends there, for the caller to carry it on.
        """
        own, now, length = self.tree, int(tree.mark[NOW]), int(tree.mark[LENGTH])
        least, most = LEAVES
        self.leaves = min(length, now + int(least * (most / least) ** share))
        end = length if whole else self.leaves
        for mine, its in ((own.path, tree.path), (own.action, tree.action)):
            mine[now:end] = its[now:end]
        own.mark[NOW], own.mark[LENGTH], own.mark[NODES] = now, end, 0
        own.value[:] = tree.value
        self.is_open, self.stale = True, 0

    def follow(self, tree: plans.PlanTree, area: float) -> None:
        """The plan was flown for some steps, which took `area` off its expected time, and so was the challenger's."""
        own = self.tree
        own.mark[NOW] = tree.mark[NOW]
        own.value[EXPECTED] -= area
        own.value[UNDETECTED] = tree.value[UNDETECTED]
        if own.mark[NOW] >= self.leaves:
            self.lose()

    def beats(self, tree: plans.PlanTree, margin: float = 1.0 - 1e-9) -> bool:
        """Whether its expected time is below `margin` times the plan's, as far as both go."""
        own = self.tree
        return bool(
            own.mark[LENGTH] == tree.mark[LENGTH] and own.value[EXPECTED] < margin * tree.value[EXPECTED]
        )

    def replace(self, tree: plans.PlanTree) -> plans.PlanTree:
        """Become the plan: returns its tree. What was tried at the root of the old one is still known."""
        new, self.tree = self.tree, tree
        root = new.stats[0]
        root[:] = tree.stats[0]
        root[:-1, LOSS] += (root[:-1, N_A] > 0.0) * (tree.value[EXPECTED] - new.value[EXPECTED])
        self.is_open, self.lost = False, 0
        return new

    def lose(self) -> None:
        """It did not get better than the plan, or not in time."""
        self.lost += self.is_open
        self.is_open = False

    def forget(self, lost: int) -> None:
        """The plan has changed: there is no challenger any more, and at most `lost` count as lost against it."""
        self.is_open, self.lost = False, min(self.lost, lost)
