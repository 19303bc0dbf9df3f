"""A second plan, grown beside the one that is flown: iterated local search over plans.

The search over sweeps climbs to a plan that no single tried line makes better. Another start leads to another such
plan, a point or two better or worse. So when the plan has not got better for long, a *challenger* is made: it keeps
the plan's next steps, which are flown in the meantime, and goes on from there by the rollout's rule. It is searched as
the plan is, but only from the place on where it leaves it, and becomes the plan as soon as it is the better one.
"""

from __future__ import annotations

import numpy as np

from roisearch.kernels import plans
from roisearch.kernels.plans import EXPECTED, LENGTH, LOSS, N_A, NODES, NOW, UNDETECTED

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

    def __init__(self, tree: plans.Tree) -> None:
        own = ("path", "action", "mark", "at", "stats", "worths", "value")
        self.tree = tree._replace(**{name: np.zeros_like(getattr(tree, name)) for name in own})
        self.is_open = False
        self.leaves = self.stale = self.lost = 0

    def begin(self, tree: plans.Tree, share: float) -> None:
        """Keep the plan as far as `share`, 0 to 1, says; it is for the caller to carry it on from there."""
        own, now, length = self.tree, int(tree.mark[NOW]), int(tree.mark[LENGTH])
        least, most = LEAVES
        self.leaves = min(length, now + int(least * (most / least) ** share))
        for mine, its in ((own.path, tree.path), (own.action, tree.action)):
            mine[now : self.leaves] = its[now : self.leaves]
        own.mark[NOW], own.mark[LENGTH], own.mark[NODES] = now, self.leaves, 0
        own.value[:] = tree.value
        self.is_open, self.stale = True, 0

    def follow(self, tree: plans.Tree, area: float) -> None:
        """The plan was flown for some steps, which took `area` off its expected time, and so was the challenger's."""
        own = self.tree
        own.mark[NOW] = tree.mark[NOW]
        own.value[EXPECTED] -= area
        own.value[UNDETECTED] = tree.value[UNDETECTED]
        if own.mark[NOW] >= self.leaves:
            self.lose()

    def beats(self, tree: plans.Tree) -> bool:
        """Whether it is better than the plan, as far as both go."""
        own, margin = self.tree, 1.0 - 1e-9
        return bool(
            own.mark[LENGTH] == tree.mark[LENGTH] and own.value[EXPECTED] < margin * tree.value[EXPECTED]
        )

    def replace(self, tree: plans.Tree) -> plans.Tree:
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

    def forget(self, lost: int = 0) -> None:
        """The plan has changed: there is no challenger any more, and at most `lost` count as lost against it."""
        self.is_open, self.lost = False, min(self.lost, lost)
