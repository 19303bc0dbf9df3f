"""Sharing a search out among several searchers at once: the start of a fleet's plans; see `roisearch.Fleet.allocate`.

Plans that are improved in turn get no better when two of them would have to change together. So whole sets of plans are
tried, and judged as one by what all expect of them: sets in which each begins with a region drawn for it, and sets in
which each plans on its own share of the mass alone. The latter matter where many meet at one hill: each that plans by
itself would fly to its top. A share is where a plan comes from, and binds nobody: the plans are improved in turn on the
whole map, and what one leaves another takes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from roisearch.belief import Belief
from roisearch.decision import SearchState
from roisearch.planners.lookahead.others import MOST, OthersLooks
from roisearch.planners.lookahead.thinking import Kept
from roisearch.searcher import NO_LOOKS, Cooperative, Searcher

PROMISING, ROUNDS = 4, 4
"""Sets of plans that are improved, and how often each of the searchers plans for that."""
CUTS = 16
"""Ways in which the mass is cut into shares."""
AT_ONCE = 1e-6
"""Steps from now after which what is out of a share counts as looked at: before the first of its own."""
NO_SWEEP = 1.0
"""Down to this share of its largest worth no region is swept first: the plan is the rollout's rule alone."""


def shares(mass: NDArray[np.float64], rates: Sequence[float], rng: np.random.Generator) -> NDArray[np.int64]:
    """Cut the map into as many shares as there are rates, with that part of the mass in each, along random lines.

    Args:
        mass: float [rows, cols]. rates: how much of it each can search, beside the others.

    Returns:
        int [rows, cols], the number of each cell's share; -1 where there is no mass, or hardly any of a large map's.
    """
    flat = mass.ravel()
    cells = np.flatnonzero(flat > 0.0)
    if cells.size > MOST:
        cells = cells[np.argpartition(flat[cells], -MOST)[-MOST:]]
    of = np.full(flat.size, -1, dtype=np.int64)
    parts = [(cells, rng.permutation(len(rates)))]
    while parts:
        cells, names = parts.pop()
        if len(names) == 1:
            of[cells] = names[0]
            continue
        angle = rng.uniform(0.0, 2.0 * np.pi)
        rows, cols = np.divmod(cells, mass.shape[1])
        cells = cells[np.argsort(rows * np.sin(angle) + cols * np.cos(angle), kind="stable")]
        some, rest = np.split(names, [len(names) // 2])
        both = [sum(rates[name] for name in each) for each in (some, names)]
        so_far = np.cumsum(flat[cells])
        line = int(np.searchsorted(so_far, so_far[-1] * both[0] / both[1])) if cells.size else 0
        parts += [(cells[:line], some), (cells[line:], rest)]
    return of.reshape(mass.shape)


class Allocation:
    """Shares a search out among the `crew`: those that can reckon with each other, by their names.

    Args:
        crew: their planners. searchers: all there are, by their names.
        tell: tells one of the crew what all others are going to look at. plan: lets one plan and keep to that.
        belief, states, rng, now_s: as of `roisearch.Fleet.allocate`.
    """

    def __init__(
        self,
        crew: Mapping[str, Cooperative],
        searchers: Mapping[str, Searcher],
        tell: Callable[[str], None],
        plan: Callable[[str], object],
        belief: Belief,
        states: Mapping[str, SearchState],
        rng: np.random.Generator,
        now_s: float,
    ) -> None:
        self._crew, self._searchers, self._tell, self._plan = crew, searchers, tell, plan
        self._belief, self._states, self._rng, self._now_s = belief, states, rng, now_s
        self._regions = 0

    def make(self, openings: int) -> None:
        """Try so many openings, and `CUTS` shares, and leave all with the best plans."""
        best, kept = self._improved(), self._kept()
        self._regions = min(planner.regions for planner in self._crew.values())  # all have planned by now
        ways = [self._open] * openings + [self._cut] * CUTS if self._regions and openings else []
        tried = [(way(), self._kept()) for way in ways]
        for _, plans in sorted(tried, key=lambda each: each[0])[:PROMISING]:
            self._take_up(plans)
            expected = self._improved()
            if expected < best:
                best, kept = expected, self._kept()
        self._take_up(kept)

    def _kept(self) -> list[Kept]:
        return [planner.kept() for planner in self._crew.values()]

    def _take_up(self, kept: Sequence[Kept]) -> None:
        for (name, planner), plan in zip(self._crew.items(), kept, strict=True):
            self._tell(name)
            planner.take_up(plan)
            self._commit(name, planner)

    def _open(self) -> float:
        """Let each sweep a region first, down to a share of its worth; what is then expected, in seconds."""
        for name in self._crew:
            self._searchers[name].looks = NO_LOOKS
        for name, planner in self._crew.items():
            region, share = (
                1 + int(self._rng.integers(self._regions)),
                float(10.0 ** -self._rng.uniform(0.3, 1.7)),
            )
            self._tell(name)
            planner.open_with(region, share)
            self._commit(name, planner)
        return self._expected()

    def _cut(self) -> float:
        """Let each plan on a share of its own, as if all else had been seen; what is then expected, in seconds."""
        mass = self._belief.probability()
        of = shares(mass, [1.0 / self._searchers[name].step_s for name in self._crew], self._rng)
        for number, (name, planner) in enumerate(self._crew.items()):
            elsewhere = np.argwhere((of >= 0) & (of != number))
            count = len(elsewhere)
            gone = OthersLooks(np.full(count, AT_ONCE), elsewhere, np.ones(count))
            planner.reckon_with_others(gone, len(self._crew))
            planner.open_with(1, NO_SWEEP)
            self._commit(name, planner)
        self._take_up(self._kept())
        return self._expected()

    def _improved(self) -> float:
        """What is expected after each has planned a few times, in seconds."""
        for _ in range(ROUNDS):
            for name in self._crew:
                self._plan(name)
        return self._expected()

    def _expected(self) -> float:
        """By the one that was told of all others' last plans."""
        name, planner = list(self._crew.items())[-1]
        return planner.expected() * self._searchers[name].step_s

    def _commit(self, name: str, planner: Cooperative) -> None:
        state, shape = self._states[name], self._belief.shape
        self._searchers[name].commit(planner.committed(), state, shape, self._now_s)
