"""Several searchers on one belief: each plans with what the others are going to look at taken as flown.

The searchers decide one after another, whenever one of them is free. Whoever decides is told the *committed* looks of
the others: those of the plans they made last, each at the moment at which it will be made. It then plans what is best
for the search as a whole given these, and its new plan is what the others are told when their turn comes. So the plans
are improved in turn, one by one (block coordinate descent on the expected time of all together), and who searches what
follows from the search: no area is cut up, and none of the searchers has to start at the same place or time as
another, fly as fast or see as far.

What is committed is no evidence. The belief changes by reports alone; a look whose time has passed is dropped, whether
it was reported or not, and with a searcher that leaves all of its looks go.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from roisearch.allocation import Allocation
from roisearch.belief import Belief
from roisearch.decision import Decision, SearchState
from roisearch.fov import FieldOfView
from roisearch.planners.base import Planner, Progress
from roisearch.planners.lookahead.others import OthersLooks
from roisearch.planners.lookahead.settings import LookaheadSettings
from roisearch.registry import make_planner
from roisearch.searcher import NO_LOOKS, Cooperative, Searcher, expecting

DEFAULT = "puct-regions-lite"
LEAST_HORIZON = 1000
"""Steps that each of many looks ahead at least."""
AHEAD_S = 600.0
"""How far ahead committed looks count for a planner that cannot tell when they are made, in seconds, unless told.

Three searchers that plan in seconds, from one corner of 100 x 100 cells of 25 m, on three priors (1000 to 1002):
0.40 of one searcher's time with these ten minutes, 0.46 with two minutes and 0.46 with 25.
"""


class Fleet:
    """Plans for several searchers on one belief; see the module's text.

    Args:
        planner: the name of every searcher's planner unless `join` says otherwise; see `make_planner`.
        ahead_s: a planner that cannot reckon with *when* the others look (see `Cooperative`) takes as flown, on a copy
            of the belief, what they look at within so many seconds.
        size: about how many searchers there are going to be. Together they look as far ahead as one would alone, so
            the default planner's `horizon` is by so much shorter, unless it is given, and a decision takes no longer.
        options: of the planners, as `make_planner` takes them.

    Raises:
        ValueError: when `ahead_s` is below 0 or `size` below 1.
    """

    def __init__(
        self, planner: str = DEFAULT, *, ahead_s: float = AHEAD_S, size: int = 1, **options: Any
    ) -> None:
        if size < 1:
            raise ValueError(f"size must be 1 searcher or more, not {size}")
        self._horizon = LookaheadSettings().horizon
        if size > 1:
            self._horizon = max(LEAST_HORIZON, self._horizon // size)
        if not 0.0 <= ahead_s < float("inf"):
            raise ValueError(f"ahead_s must be 0 or more seconds and finite, not {ahead_s}")
        self._planner, self._ahead_s, self._options = planner, ahead_s, options
        self._searchers: dict[str, Searcher] = {}

    @property
    def searchers(self) -> tuple[str, ...]:
        """The names of those that search, in the order in which they joined."""
        return tuple(self._searchers)

    def join(
        self,
        name: str,
        *,
        fov: FieldOfView,
        step_s: float = 1.0,
        planner: str | Planner | None = None,
        **options: Any,
    ) -> None:
        """A searcher more. It has no plan before it decides for the first time.

        Args:
            name: what it is called from now on.
            fov: what it sees.
            step_s: seconds that it takes from a cell to the next; with a `motion` what its path takes on the whole.
            planner: the name of its planner; None: the fleet's. Or its planner itself, which then takes no options.
            options: of its planner, in place of the fleet's.

        Raises:
            ValueError: when the name is taken, step_s is not above 0, or there is no such planner or option.
        """
        if name in self._searchers:
            raise ValueError(f"there is a searcher '{name}' already")
        if not 0.0 < step_s < float("inf"):
            raise ValueError(f"step_s must be above 0 seconds and finite, not {step_s}")
        if planner is None or isinstance(planner, str):
            chosen = {"planner": planner or self._planner, **self._options, **options}
            planner = make_planner(chosen["planner"], fov=fov, **self._looking_ahead(chosen))
        elif options:
            raise ValueError(f"a planner that is made already takes no options: {', '.join(options)}")
        self._searchers[name] = Searcher(planner, fov, step_s)

    def replace(self, name: str, planner: Planner) -> None:
        """It plans with another planner from now on (other ground may be flown over, say); its looks stay.

        Raises: KeyError: when there is no searcher of that name.
        """
        self._known(name).planner = planner

    def _looking_ahead(self, options: dict[str, Any]) -> dict[str, Any]:
        """The options with a horizon, where the planner has one."""
        by_default = options["planner"] == DEFAULT and not options.keys() & {"preset", "motion"}
        rest = {key: value for key, value in options.items() if key != "planner"}
        return {"horizon": self._horizon, **rest} if by_default else rest

    def leave(self, name: str) -> None:
        """A searcher less: what it was going to look at is open to the others again.

        Raises: KeyError: when there is none of that name.
        """
        self._known(name)
        del self._searchers[name]

    def forget(self, name: str) -> None:
        """It stays, but does not fly its plan (it holds, say): its committed looks are open to the others again.

        Raises: KeyError: when there is none of that name.
        """
        self._known(name).looks = NO_LOOKS

    def committed(self, name: str) -> OthersLooks:
        """The looks of the plan that `name` made last, `when` in seconds on the fleet's clock.

        Raises: KeyError: when there is none of that name.
        """
        return self._known(name).looks

    def plan(
        self,
        name: str,
        belief: Belief,
        state: SearchState,
        rng: np.random.Generator,
        *,
        now_s: float,
        deadline_s: float | None = None,
    ) -> Decision:
        """Where `name` goes next, given what the others are going to look at.

        A searcher alone plans as its planner does without a fleet, to the last bit.

        Args:
            belief: what is known to all. state, rng, deadline_s: as `Planner.plan`.
            now_s: the time at which `name` is in that state, on one clock for all searchers.

        Raises:
            KeyError: when there is no searcher of that name.
            ValueError: as `Planner.plan`.
        """
        planner = self._known(name).planner
        beside = self.beside(name, belief, now_s=now_s)
        decision = planner.plan(beside, state, rng, deadline_s=deadline_s)
        self.commit(name, decision, state, belief.shape, now_s=now_s)
        return decision

    def beside(self, name: str, belief: Belief, *, now_s: float) -> Belief:
        """What the planner of `name` is to plan on, with what the others are going to look at: for who asks it by
        itself and then says `commit`. A planner that can reckon with the others is told of them; for another one it is
        a copy of the belief, on which they have looked in vain.

        Raises: KeyError: when there is no searcher of that name.
        """
        searcher = self._known(name)
        if isinstance(searcher.planner, Cooperative):
            together = len(self._searchers) > 1
            if together or searcher.was_told:
                self._tell(name, searcher.planner, now_s)
            searcher.was_told = together
            return belief
        others = self._others(name, now_s)
        return expecting(belief, others, self._ahead_s) if len(others.when) else belief

    def commit(
        self, name: str, decision: Decision, state: SearchState, shape: tuple[int, int], *, now_s: float
    ) -> None:
        """`name` has decided in `state`, on a map of `shape`, and is going to fly its plan from `now_s` on.

        Raises: KeyError: when there is no searcher of that name.
        """
        searcher = self._known(name)
        searcher.commit(searcher.going_to(decision, self._ahead_s), state, shape, now_s)

    def allocate(
        self,
        belief: Belief,
        states: Mapping[str, SearchState],
        rng: np.random.Generator,
        *,
        now_s: float,
        openings: int = 48,
    ) -> None:
        """Share the search out anew: plans in which each begins with another region, judged as one by what all expect.

        Plans that are improved in turn get no better when two of them would have to change at once. So this tries
        `openings` drawn at random, and shares of the mass for each to begin with, improves the most promising in turn,
        and keeps the best, or the present plans; see `roisearch.allocation`. It takes about as long as a hundred
        decisions, so it is for the start of a search, and when one joins or leaves.
        Searchers that are not in `states`, or whose planner is not `Cooperative`, keep their plans.

        Raises: as `plan`.
        """
        crew = {name: self._known(name).planner for name in states}
        able = {name: planner for name, planner in crew.items() if isinstance(planner, Cooperative)}
        if len(able) > 1:

            def plan(name: str) -> None:
                self.plan(name, belief, states[name], rng, now_s=now_s)

            def tell(name: str) -> None:
                self._tell(name, able[name], now_s)

            Allocation(able, self._searchers, tell, plan, belief, states, rng, now_s).make(openings)

    def _tell(self, name: str, planner: Cooperative, now_s: float) -> None:
        """Tell the planner of `name` what the others are going to look at."""
        others, step_s = self._others(name, now_s), self._searchers[name].step_s
        planner.reckon_with_others(others._replace(when=others.when / step_s), len(self._searchers))

    def warm_up(self, progress: Progress | None = None) -> None:
        """Compile every kernel that the planners will use."""
        for searcher in self._searchers.values():
            searcher.planner.warm_up(progress)

    def _known(self, name: str) -> Searcher:
        """The searcher of that name."""
        if name not in self._searchers:
            raise KeyError(f"there is no searcher '{name}'; there is {', '.join(self._searchers) or 'none'}")
        return self._searchers[name]

    def _others(self, name: str, now_s: float) -> OthersLooks:
        """What all but `name` are going to look at, `when` in seconds from now."""
        to_come = []
        for other, searcher in self._searchers.items():
            if other != name:
                looks = searcher.looks
                later = looks.when > now_s
                to_come.append((looks.when[later] - now_s, looks.cells[later], looks.p_tp[later]))
        return (
            OthersLooks(*(np.concatenate(part) for part in zip(*to_come, strict=True)))
            if to_come
            else NO_LOOKS
        )
