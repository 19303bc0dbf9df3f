"""A plan made beside the flight, with more time than a decision has, while the aircraft flies on by a hasty one."""

from __future__ import annotations

import logging
from collections.abc import Callable
from concurrent.futures import Executor, Future

import numpy as np

from roisearch import Belief, SearchState
from roisearch.planners.base import Hasty, Planner

log = logging.getLogger("roisearch")


class Drafting:
    """Has one planner at a time made in a thread, in the place of the one that flies.

    Attributes:
        under_way: the planner that is being made, or is ready to be taken; None: neither.
    """

    def __init__(self, thread: Executor) -> None:
        self._thread = thread
        self._instead_of: Planner | None = None
        self.under_way: Future[Planner] | None = None

    def begin(self, instead_of: Planner, make: Callable[[], Planner]) -> None:
        """Have a planner made, plan and all, in the place of the one that flies."""
        self._instead_of, self.under_way = instead_of, self._thread.submit(make)

    def taken(self, flies: Planner) -> Planner | None:
        """The planner that was made, once; None while there is none, or where another one `flies` by now than that in
        whose place it was made: the ground is another one then."""
        if self.under_way is None or not self.under_way.done():
            return None
        made, self.under_way = self.under_way, None
        if flies is not self._instead_of:
            return None
        if failure := made.exception():
            log.error(
                "a plan that was made beside the flight has failed, and the search goes on by the hasty one: %s",
                failure,
            )
            _is_good_enough(flies)  # another try would fail as well
            return None
        return made.result()


def plan_at_leisure(
    planner: Planner, belief: Belief, state: SearchState, rng: np.random.Generator, deadline_s: float | None
) -> None:
    """Make a first plan with as much time as there is, which is as good as it gets."""
    planner.plan(belief, state, rng, deadline_s=deadline_s)
    _is_good_enough(planner)


def _is_good_enough(planner: Planner) -> None:
    """No other plan is to be made in the place of this planner's."""
    if isinstance(planner, Hasty):
        planner.hasty = False
