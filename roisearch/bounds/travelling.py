"""A bound on the expected time that counts travel: what no walk can beat, wherever its looks are.

The release bound lets the searcher jump to any cell that it could have reached by now. On maps with several hills
that forgets the ways between them. This bound keeps the walk, and forgets something else: that a look can be made
once.

**Looks as units.** The k-th look at cell c finds the target with probability w(k, c) = m_c p (1 - p)^(k - 1); made
at step t it shortens E[min(T, N)] by w(k, c) (N - t), N being the number of steps. Looks beyond the K-th together
shorten it by at most (1 - p)^K N, since they find what K looks have missed.

**Prices.** Let every unit have a price l(k, c) >= 0, and let a walk use any unit as often as it likes, paying each
time. For every walk that uses each unit at most once, what it earns is at most what it earns after paying plus the
sum of all prices. So with V the most that any walk earns after paying,

    E[min(T, N)]  >=  N - sum of l - V - (1 - p)^K N                                                      (1)

for *every* l >= 0: poor prices make the bound loose, never wrong. V is a dynamic program over (step, cell), because
a walk that pays needs no memory (`roisearch.bounds.walks`). A look at c is worth nothing before the walk can be
there, which the walk sees to by itself.

**Which prices.** A linear program over hills and blocks of time says what a step in each hill is worth at each time
(`roisearch.bounds.prices`); a look's price is the most that it earns beyond that. With such prices a step in a hill
earns no more than it is worth there, and the walk has to travel to earn in another.

**Branching.** At any step a walk is in exactly one hill (every cell belongs to the nearest). So the walks fall into
classes by where they are at that step, (1) holds in each class with prices of its own, and the least of the
classes' bounds is a bound for all. The class with the least bound is divided next, where its linear program is
least sure; the bound never falls, and can be had at any time.

The result is never below the release bound, of which the larger is taken. False alarms change which walk is flown
and not what looks are worth, so it holds for every p_tn.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from roisearch.bounds.counting import expected_time, release, release_steps
from roisearch.bounds.prices import Plan, Schedule, hills_of, look_prices, nearest_labels
from roisearch.bounds.walks import best_walk
from roisearch.kernels.records import Floats, Ints
from roisearch.regions import segment_regions

CORES = (0.5, 0.3, 0.2, 0.1, 0.05)
"""Where the core of a hill may begin, in parts of its peak; the best is kept."""
BLOCKS = 40
"""Blocks of time of a short search, at least; no block is longer than 40 steps."""
HALVINGS = 2
"""How finely prices between those of a class and those of its part are tried."""
_LEFT = 1e-4  # what so many looks at the target's cell may miss


@dataclass(frozen=True)
class TravelBound:
    """A lower bound on E[min(T, N)] of every walk.

    Attributes:
        expected: the bound, in steps.
        release: the release bound that it starts from, in steps.
        classes: how many classes of walks it was divided into.
        history: the bound after each division, the first before any.
    """

    expected: float
    release: float
    classes: int
    history: tuple[float, ...]


def travel(
    prior: Floats,
    start: tuple[int, int],
    p_tp: float,
    steps: int,
    *,
    divisions: int = 8,
    known: float = math.inf,
    flyable: NDArray[np.bool_] | None = None,
    progress: Callable[[int, float], None] | None = None,
) -> TravelBound:
    """The expected time that no walk of `steps` steps can beat, counting travel between hills.

    Args:
        prior: float [rows, cols], the mass of each cell; it may sum to less than 1.
        start: (row, col) before the first step. p_tp: of a look at the target's cell. steps: N, the cap.
        divisions: how often the worst class of walks is divided; more is tighter, and takes longer.
        known: the expected time of a walk that there is: classes above it need no division.
        flyable: bool [rows, cols], the cells that can be entered. progress: is told (divisions made, bound).

    Raises:
        ValueError: as `roisearch.bounds.release`, and when `steps` is below 1.
    """
    if steps < 1:
        raise ValueError(f"steps must be 1 or more, not {steps}")
    bound = expected_time(release(prior, start, p_tp, steps, flyable=flyable))
    tree = Tree(_Steps.of(prior, start, p_tp, steps, flyable))
    history = [max(bound, tree.least)]
    while tree.least < known and len(history) <= divisions and tree.divide():
        history.append(max(history[-1], tree.least))
        if progress is not None:
            progress(len(history) - 1, history[-1])
    return TravelBound(history[-1], bound, tree.classes, tuple(history))


def worth_of_looks(mass: Floats, p_tp: float) -> tuple[Floats, float]:
    """w of the text above, float [rows, cols, looks], and the probability that as many looks miss the target."""
    looks = 1 if p_tp == 1.0 else math.ceil(math.log(_LEFT) / math.log(1.0 - p_tp))
    worth = mass[:, :, None] * (p_tp * (1.0 - p_tp) ** np.arange(looks))
    return np.ascontiguousarray(worth), (1.0 - p_tp) ** looks * float(mass.sum())


class Problem(Protocol):
    """A map and a cap, as arrays; in steps, or in slots of time that are as long as a step.

    worth: float [rows, cols, looks]; labels: int [rows, cols]; start; steps: the cap; block: steps in one.
    """

    @property
    def worth(self) -> Floats: ...
    @property
    def labels(self) -> Ints: ...
    @property
    def start(self) -> tuple[int, int]: ...
    @property
    def steps(self) -> int: ...
    @property
    def block(self) -> int: ...

    def bound(self, step_worth: Floats, fixed: Ints) -> float:
        """(1) for the walks that are where `fixed` says, int [steps + 1]; inf when there are none."""


@dataclass(frozen=True, eq=False)
class _Steps:
    """A map and a cap, as arrays: worth float [rows, cols, looks]; labels, released int [rows, cols]."""

    worth: Floats
    labels: Ints
    released: Ints
    flyable: NDArray[np.bool_]
    start: tuple[int, int]
    steps: int
    block: int
    beyond: float  # what looks that are not counted may be worth

    @classmethod
    def of(
        cls, prior: Floats, start: tuple[int, int], p_tp: float, steps: int, flyable: NDArray[np.bool_] | None
    ) -> _Steps:
        mass = np.ascontiguousarray(prior, dtype=np.float64)
        worth, beyond = worth_of_looks(mass, p_tp)
        labels = nearest_labels(segment_regions(mass).labels)
        open_ = np.ones(mass.shape, dtype=np.bool_) if flyable is None else np.ascontiguousarray(flyable)
        released = release_steps(mass.shape, start, 0, flyable).reshape(mass.shape)
        block = max(1, min(40, steps // BLOCKS))
        return cls(worth, labels, released, open_, start, steps, block, beyond * steps)

    def bound(self, step_worth: Floats, fixed: Ints) -> float:
        """(1) for the walks that are where `fixed` says, int [steps + 1]; inf when there are none.

        step_worth: float [hills, blocks], from which the prices follow.
        """
        price = look_prices(self.worth, self.labels, self.released, step_worth, self.block, self.steps)
        earned = best_walk(self.worth, price, self.flyable, self.labels, self.start, fixed)
        return self.steps - float(price.sum()) - float(earned) - self.beyond


@dataclass(frozen=True, eq=False)
class _Class:
    """Walks that are in hill `tied[block]` at the middle of each of these blocks, and the best prices known for them.

    `step_worth` float [hills, blocks] gives the prices; `presence`, as of `Plan`, where to divide.
    """

    tied: dict[int, int]
    step_worth: Floats
    presence: Floats


class Tree:
    """The classes of walks, the one with the least bound first."""

    def __init__(self, problem: Problem) -> None:
        self._problem = problem
        free = np.full(problem.steps + 1, -1, dtype=np.int64)
        best = -math.inf
        for core in CORES:
            hills = hills_of(problem.worth, problem.labels, problem.start, core, problem.steps, problem.block)
            schedule = Schedule(hills)
            plan = schedule.solve({})
            bound = -math.inf if plan is None else problem.bound(plan.step_worth, free)
            if plan is not None and bound > best:
                best, self._schedule, root = bound, schedule, _Class({}, plan.step_worth, plan.presence)
        self._heap: list[tuple[float, int, _Class]] = [(best, 0, root)]
        self._made = 1

    @property
    def least(self) -> float:
        """The bound for all walks: the least of the classes'."""
        return self._heap[0][0] if self._heap else math.inf

    @property
    def classes(self) -> int:
        """How many classes there are."""
        return len(self._heap)

    def divide(self) -> bool:
        """Divide the class with the least bound by where its walks are at one more step; False if it cannot be."""
        if not self._heap or (block := _least_sure(self._heap[0][2])) is None:
            return False
        bound, _, worst = heapq.heappop(self._heap)
        for hill in range(self._schedule.hills.count):
            value, part = self._part(worst, bound, {**worst.tied, block: hill})
            if value < math.inf:
                heapq.heappush(self._heap, (value, self._made, part))
                self._made += 1
        return True

    def _part(self, whole: _Class, bound: float, tied: dict[int, int]) -> tuple[float, _Class]:
        """The part of a class that is tied once more, and its bound: `bound` of the whole, or a better one.

        The bound is concave in `step_worth` as long as the prices are (a maximum of linear functions), so it is
        looked for between those of the whole and those of the part's own program, halving twice.
        """
        plan, fixed = self._solve(tied), self._fixed(tied)
        tried: dict[float, float] = {0.0: bound}

        def value(share: float) -> float:
            if share not in tried:
                tried[share] = self._problem.bound(_between(whole.step_worth, plan.step_worth, share), fixed)
            return tried[share]

        share, width = 0.5, 0.5
        for _ in range(HALVINGS):
            share = max((share - width, share, share + width), key=value)
            share, width = min(max(share, 0.5 * width), 1.0 - 0.5 * width), 0.5 * width
        best = max(tried, key=lambda share: tried[share])
        return max(bound, tried[best]), _Class(
            tied, _between(whole.step_worth, plan.step_worth, best), plan.presence
        )

    def _solve(self, tied: dict[int, int]) -> Plan:
        """The coarse program with these ties, or as many of the latest as it can do.

        What it cannot do a walk may: a block is long. Its prices serve all the same.
        """
        while (plan := self._schedule.solve(tied)) is None:
            tied = dict(list(tied.items())[1:])
        return plan

    def _fixed(self, tied: dict[int, int]) -> Ints:
        fixed = np.full(self._problem.steps + 1, -1, dtype=np.int64)
        for block, hill in tied.items():
            fixed[min(int((block + 0.5) * self._problem.block), self._problem.steps)] = hill
        return fixed


def _between(a: Floats, b: Floats, share: float) -> Floats:
    """`a` at 0, `b` at 1."""
    return (1.0 - share) * a + share * b


def _least_sure(walks: _Class) -> int | None:
    """The block in which the program spreads the searcher most evenly over hills; None if it is sure everywhere."""
    there = walks.presence.sum(axis=0)
    share = (walks.presence / np.maximum(there, 1e-12)).clip(1e-12, 1.0)
    doubt = np.where(there > 0.5, -(share * np.log(share)).sum(axis=0), 0.0)
    doubt[list(walks.tied)] = 0.0
    block = int(doubt.argmax())
    return block if doubt[block] > 1e-3 else None
