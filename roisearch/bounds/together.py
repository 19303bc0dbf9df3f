"""The release bound of several searchers on one belief: one look a step each, and none before it can be reached.

Setting. As in `roisearch.bounds.counting`, with searchers i = 1 .. N, each with a start, a moment s_i from which on it
flies (0 for those that are there from the beginning) and its own pace: it takes k_i steps at least from a cell to a
neighbouring one. A look is worth the same whoever makes it, and F(t) is the probability that the target is detected
within t steps by any of them.

Give searcher i a slot for one look at each of the moments s_i + j k_i, j = 1, 2, ... Any flight of it fits into them:

1. Put a look that it makes at x into the slot j = floor((x - s_i) / k_i). Two of its looks are at least k_i apart, and
   the first is not made before s_i + k_i; so j is at least 1, no two looks share a slot, and none is later than it was.
2. Nobody looks at cell c before r_c = min over i of s_i + k_i max(1, distance(start_i, c)). A look at c at x has
   x - s_i >= k_i distance(start_i, c), so its slot is not before r_c either.

So whatever they fly, what they have found by t is at most what looks in slots up to t find, each slot holding one
look that is released by then. **At every t that is largest when each slot, in the order of time, takes the most
valuable look released so far**, by the exchange in `counting`, which asks nothing of how many slots a step has: let S
agree with greedy before a slot where greedy makes look j and S makes i, or none. If S makes j in a later slot, swap
the two (i was released by then), and F does not fall at any t; if it does not make j at all, put j in place of i.
Either way w(j) >= w(i), and S agrees with greedy one slot longer.

Slots and releases between two steps count by the next whole one, which changes F at no whole step. For one searcher
from the beginning with k = 1 the bound is `release`; for N of them at one start it is `release` with N looks a step.
That they have to travel from look to look it does not count: they teleport, as there.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from roisearch.bounds.counting import check, checked_mass, release_steps
from roisearch.bounds.kernels import NEVER, greedy_looks
from roisearch.kernels.records import Floats, Ints


@dataclass(frozen=True)
class Start:
    """Where and when a searcher of a point field of view begins, and its pace.

    Attributes:
        cell: (row, col).
        step: after which step it is there; 0 from the beginning.
        pace: steps that it takes to enter a neighbouring cell, above 0.
    """

    cell: tuple[int, int]
    step: float = 0.0
    pace: float = 1.0

    def __post_init__(self) -> None:
        if not (0.0 <= self.step < math.inf and 0.0 < self.pace < math.inf):
            raise ValueError(
                f"a searcher begins at step 0 or later with a pace above 0, not {self.step}, {self.pace}"
            )


def release_together(prior: Floats, starts: Sequence[Start], p_tp: float, steps: int) -> Floats:
    """The best detection curve that any flights of these searchers together can have (see the module's text).

    Args:
        prior: float [rows, cols], the mass of each cell; it may sum to less than 1.
        starts: one for each searcher. p_tp: of a look at the target's cell, the largest of all searchers'.
        steps: for how many.

    Returns:
        F, float [steps + 1].

    Raises:
        ValueError: when there is no searcher, a start is off the map, or a mass or p_tp is no probability.
    """
    mass = checked_mass(prior)
    check(p_tp, steps, 1)
    if not starts:
        raise ValueError("a bound for several searchers needs at least one of them")
    released = np.full(mass.size, NEVER, dtype=np.int64)
    made = np.zeros(steps + 1, dtype=np.int64)
    for start in starts:
        moves = release_steps(prior.shape, start.cell, 0, None)
        released = np.minimum(released, _earliest(start, moves))
        own = np.floor((np.arange(steps + 1) - start.step) / start.pace + 1e-9)
        made += np.maximum(own, 0.0).astype(np.int64)
    return greedy_looks(mass, released, np.diff(made), float(p_tp))


def _earliest(start: Start, moves: Ints) -> Ints:
    """The step by which looks after so many `moves` count: the next whole one."""
    moments = np.ceil(start.step + start.pace * moves - 1e-9)
    first: Ints = np.maximum(1, moments).astype(np.int64)
    return first
