"""What is thought between two steps: the plan is searched, put in a better order, and challenged.

The search over sweeps (`plans`) climbs to a plan that no single tried line makes better. Annealing (`order`) then puts
its looks in a better order. Another start leads to another such plan, a point or
two better or worse: a *challenger*. It keeps the plan's next steps, which are flown in the meantime. From there it
goes on by the rollout's rule, to be searched and annealed as the plan was, or as the plan does, to be annealed from a
higher temperature. It becomes the plan when it is the better one in the end. So this is an iterated local search.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from roisearch.kernels.draws import draw_unit
from roisearch.kernels.records import Ints, Pose
from roisearch.planners.lookahead import plans
from roisearch.planners.lookahead.anneal import Annealer
from roisearch.planners.lookahead.challenge import Challenger
from roisearch.planners.lookahead.desk import room_for_regions
from roisearch.planners.lookahead.plans import (
    EXPECTED,
    LEFT,
    LENGTH,
    NODES,
    NOW,
    UNDETECTED,
    Desk,
    PlanTree,
)
from roisearch.planners.lookahead.settings import LookaheadSettings
from roisearch.planners.lookahead.sweeps import ANYWHERE
from roisearch.regions import Regions

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


class Kept(NamedTuple):
    """A plan that was kept: int [k], the cells of its path, and what each step belongs to."""

    path: Ints
    action: Ints


class Thinking:
    """See the module's text.

    Args:
        tree: room for the plan.
        desk: what the kernels work on.
        anneals: whether plans are annealed: with a point field of view.

    Attributes:
        tree: the plan.
        challenger: the other one.
        desk: as given.
        annealer: where plans are annealed, None if they are not.
        stale: iterations since the plan got better.
        rough: whether the plan is still to be annealed.
    """

    def __init__(self, tree: PlanTree, desk: Desk, settings: LookaheadSettings, anneals: bool) -> None:
        self.tree = tree
        self.challenger = Challenger(tree)
        self.stale = 0
        self.rough = anneals
        self.desk = desk
        self._settings = settings
        self.annealer = Annealer(settings.horizon, desk) if anneals else None
        self._ahead = SOON

    def plans(self) -> list[PlanTree]:
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
        elif self.rough and self.annealer is not None:
            self._smooth(pose, self.annealer)
        else:
            self._challenge(pose)

    def search(self, pose: Pose, tree: PlanTree, hold: int) -> bool:
        """One iteration of the tree search of a plan, from index `hold` of its path on; whether it got better."""
        return plans.iterate(pose, tree, self.desk, hold)

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
        rival, annealer = self.challenger, self.annealer
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
        rival, d = self.challenger, self.desk
        copied = self.annealer is not None and draw_unit(d.random) < COPIES
        rival.begin(self.tree, draw_unit(d.random), copied)
        if not copied:
            left = int(self.tree.mark[LENGTH] - self.tree.mark[NOW])
            plans.extend(pose, rival.tree, d, left)
        plans.settle_root(pose, rival.tree, d)
        if copied and self.annealer is not None:
            self.annealer.begin(pose, rival.tree, rival.leaves, COPY_ROUND, HOT)

    def _judge(self) -> None:
        """The challenger is done: it becomes the plan, or is forgotten."""
        if self.challenger.beats(self.tree):
            self.tree = self.challenger.replace(self.tree)
            if self.annealer is None:
                self.stale = 0  # it may have won in the midst of its search
            else:
                self.rough = True  # from nearer ahead than where it left the plan
        else:
            self.challenger.lose()

    def flown(self, area: float) -> None:
        """The plan was flown for some steps, which took `area` off its expected time."""
        self.challenger.follow(self.tree, area)
        if self.annealer is not None and self.tree.mark[NOW] >= self.annealer.hold:
            self.annealer.is_open = False

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
        self.rough = self.annealer is not None
        if self.annealer is not None:
            self.annealer.is_open = False

    def corrected(self, undetected: float, pose: Pose) -> None:
        """The belief is not what the plans expected."""
        for tree in self.plans():
            tree.value[UNDETECTED] = undetected
            tree.value[EXPECTED] = plans.evaluate(pose, tree, self.desk)

    def others_planned(self) -> None:
        """Other searchers have planned since: there may be something better than the plan again."""
        self.challenger.lost = min(self.challenger.lost, self._settings.restarts - 1)

    def open_with(self, pose: Pose, region: int, share: float, *, whatever: bool) -> None:
        """Begin with a sweep of `region`; see `plans.open_with`."""
        if plans.open_with(pose, self.tree, self.desk, region, share, whatever):
            self.replanned()

    def kept(self) -> Kept:
        """The plan from now on, to be taken up again."""
        now, length = self.tree.mark[NOW], self.tree.mark[LENGTH]
        return Kept(self.tree.path[now:length].copy(), self.tree.action[now:length].copy())

    def take_up(self, kept: Kept, pose: Pose) -> None:
        """Make the plan what it was when it was `kept`; since then nothing was flown."""
        now, tree = int(self.tree.mark[NOW]), self.tree
        end = now + kept.path.size
        tree.path[now:end], tree.action[now:end] = kept.path, kept.action
        tree.mark[LENGTH], tree.mark[NODES] = end, 0
        tree.value[EXPECTED] = plans.evaluate(pose, tree, self.desk)
        self.replanned()

    def redrawn(self, regions: Regions) -> None:
        """The map has other regions: the plan stays, its nodes and the challenger are of the old ones."""
        tree = self.tree
        room = room_for_regions(tree.at.size, regions.count)
        self.tree = tree._replace(stats=room.stats, worths=room.worths, scores=room.scores)
        gone = ~np.isin(tree.action, (ANYWHERE, *regions.numbers))
        tree.action[gone] = ANYWHERE
        tree.mark[NODES] = 0
        self.challenger = Challenger(self.tree)
        self.replanned()

    def shift(self) -> None:
        """Forget the flown part of the plans."""
        flown = int(self.tree.mark[NOW])
        self.challenger.leaves -= flown
        if self.annealer is not None:
            self.annealer.hold -= flown
        for tree in self.plans():
            plans.shift(tree)

    def exercise(self, pose: Pose) -> None:
        """Use every kernel once: a challenger and, where plans are annealed, a round of one iteration."""
        self.stale = self._settings.patience
        tree = self.tree
        if self.annealer is not None:
            self.annealer.begin(pose, tree, int(tree.mark[NOW]), 1, WARM)
            self.annealer.go_on(tree)
            self.annealer.end(pose, tree)
        self.rough = False
        self._begin(pose)
        self.search(pose, tree, 0)
        plans.extend(pose, tree, self.desk, 80)
