"""What is thought between two steps: the plan is searched, put in a better order, and challenged.

The search over sweeps (`roisearch.kernels.plans`) climbs to a plan that no single tried line makes better. Annealing
(`roisearch.kernels.order`) then puts its looks in a better order. Another start leads to another such plan, a point or
two better or worse: a *challenger*. It keeps the plan's next steps, which are flown in the meantime. From there it
goes on by the rollout's rule, to be searched and annealed as the plan was, or as the plan does, to be annealed from a
higher temperature. It becomes the plan when it is the better one in the end. So this is an iterated local search.
"""

from __future__ import annotations

from roisearch.kernels import plans
from roisearch.kernels.plans import EXPECTED, LEFT, LENGTH, NOW, UNDETECTED, Desk, Tree
from roisearch.planners.anneal import Annealer
from roisearch.planners.challenge import Challenger
from roisearch.planners.sweep_settings import SweepSettings

Pose = tuple[int, int, int]

SOON, AHEAD = 8, 64
"""Steps ahead of the drone from which on a plan is annealed, at first and at most: twice as many in each round."""
PLAN_ROUND, CHALLENGER_ROUND, COPY_ROUND = 512, 256, 384
"""Iterations of a round of annealing, at most: of the plan, of a challenger that was searched, of a copied one."""
WARM, HOT = 0.1, 0.2
"""Temperatures, in steps, at which a round begins: on what the search made, and to leave an annealed plan."""
COPIES = 0.3
"""Part of the challengers that begin as copies of the plan."""
PROMISING = 1.02
"""A searched challenger is annealed when its expected time is below so many times the plan's, which is annealed."""


class Thinking:
    """See the module's text.

    Args:
        tree: room for the plan.
        desk: what the kernels work on.
        anneals: whether plans are annealed: with a point field of view.

    Attributes:
        tree: the plan.
        challenger: the other one.
        stale: iterations since the plan got better.
        rough: whether the plan is still to be annealed.
    """

    def __init__(self, tree: Tree, desk: Desk, settings: SweepSettings, anneals: bool) -> None:
        self.tree = tree
        self.challenger = Challenger(tree)
        self.stale = 0
        self.rough = anneals
        self._desk = desk
        self._settings = settings
        self._annealer = Annealer(settings.horizon, desk) if anneals else None
        self._ahead = SOON

    def plans(self) -> list[Tree]:
        """The plan, and the challenger's when there is one."""
        return [self.tree, self.challenger.tree] if self.challenger.is_open else [self.tree]

    def is_restless(self) -> bool:
        """Whether more thinking may make the plan better."""
        s = self._settings
        return self.stale < s.patience or self.rough or self.challenger.lost < s.restarts

    def iterate(self, pose: Pose) -> None:
        """One iteration, from where the plan is flown to."""
        if self.stale < self._settings.patience:
            self.stale = 0 if self.search(pose, self.tree, 0) else self.stale + 1
        elif self.rough and self._annealer is not None:
            self._smooth(pose, self._annealer)
        else:
            self._challenge(pose)

    def search(self, pose: Pose, tree: Tree, hold: int) -> bool:
        """One iteration of the tree search of a plan, from index `hold` of its path on; whether it got better."""
        d = self._desk
        return plans.iterate(*pose, d.chart, tree, d.rules, d.labels, d.home, d.wave, d.random, hold)

    def _smooth(self, pose: Pose, annealer: Annealer) -> None:
        """Anneal the plan, which the search has just left."""
        if not annealer.is_open:
            annealer.begin(pose, self.tree, int(self.tree.mark[NOW]) + self._ahead, PLAN_ROUND, WARM)
            self._ahead = min(2 * self._ahead, AHEAD)
        elif annealer.go_on(self.tree):
            annealer.end(pose, self.tree)
            self.rough = self._ahead < AHEAD

    def _challenge(self, pose: Pose) -> None:
        """Begin a challenger, or search or anneal it; it is judged when that is done, or when its search has won."""
        rival, annealer = self.challenger, self._annealer
        if not rival.is_open:
            self._begin(pose)
        elif annealer is not None and annealer.is_open:
            if annealer.go_on(rival.tree):
                annealer.end(pose, rival.tree)
                self._judge()
        else:
            rival.stale = 0 if self.search(pose, rival.tree, rival.leaves) else rival.stale + 1
            if rival.beats(self.tree):
                self._judge()
            elif rival.stale >= self._settings.patience:
                if annealer is not None and rival.beats(self.tree, PROMISING):
                    annealer.begin(pose, rival.tree, rival.leaves, CHALLENGER_ROUND, WARM)
                else:
                    self._judge()

    def _begin(self, pose: Pose) -> None:
        """Begin a challenger."""
        rival, d = self.challenger, self._desk
        copied = self._annealer is not None and plans.draw(d.random) < COPIES
        rival.begin(self.tree, plans.draw(d.random), copied)
        row, col, heading = pose
        where = (d.chart, rival.tree, d.rules, d.labels, d.home)
        if not copied:
            left = int(self.tree.mark[LENGTH] - self.tree.mark[NOW])
            plans.extend(row, col, heading, *where, left, d.wave)
        plans.settle_root(row, col, *where)
        if copied and self._annealer is not None:
            self._annealer.begin(pose, rival.tree, rival.leaves, COPY_ROUND, HOT)

    def _judge(self) -> None:
        """The challenger is done: it becomes the plan, or is forgotten."""
        if self.challenger.beats(self.tree):
            self.tree = self.challenger.replace(self.tree)
            if self._annealer is None:
                self.stale = 0  # it may have won in the midst of its search
            else:
                self.rough = True  # from nearer ahead than where it left the plan
        else:
            self.challenger.lose()

    def flown(self, area: float) -> None:
        """The plan was flown for some steps, which took `area` off its expected time."""
        self.challenger.follow(self.tree, area)
        if self._annealer is not None and self.tree.mark[NOW] >= self._annealer.hold:
            self._annealer.is_open = False

    def carried_on(self) -> None:
        """The plan has become longer: think about it again, in proportion to what it leaves undetected."""
        left, now = self.tree.value[LEFT], self.tree.value[UNDETECTED]
        share = left / now if now > 0.0 else 0.0
        self.stale = min(self.stale, int((1.0 - share) * self._settings.patience))
        self._forget(int((1.0 - share) * self._settings.restarts))

    def replanned(self) -> None:
        """The plan is another one."""
        self.stale, self._ahead = 0, SOON
        self._forget(0)

    def _forget(self, lost: int) -> None:
        """There is no challenger any more, at most `lost` count as lost, and the plan is still to be annealed."""
        self.challenger.forget(lost)
        self.rough = self._annealer is not None
        if self._annealer is not None:
            self._annealer.is_open = False

    def corrected(self, undetected: float, pose: Pose) -> None:
        """The belief is not what the plans expected."""
        for tree in self.plans():
            tree.value[UNDETECTED] = undetected
            tree.value[EXPECTED] = plans.evaluate(*pose, self._desk.chart, tree, self._desk.rules)

    def shift(self) -> None:
        """Forget the flown part of the plans."""
        flown = int(self.tree.mark[NOW])
        self.challenger.leaves -= flown
        if self._annealer is not None:
            self._annealer.hold -= flown
        for tree in self.plans():
            plans.shift(tree)

    def exercise(self, pose: Pose) -> None:
        """Use every kernel once: a challenger and, where plans are annealed, a round of one iteration."""
        self.stale = self._settings.patience
        d, tree = self._desk, self.tree
        if self._annealer is not None:
            self._annealer.begin(pose, tree, int(tree.mark[NOW]), 1, WARM)
            self._annealer.go_on(tree)
            self._annealer.end(pose, tree)
        self.rough = False
        self._begin(pose)
        self.search(pose, tree, 0)
        plans.extend(*pose, d.chart, tree, d.rules, d.labels, d.home, 80, d.wave)
