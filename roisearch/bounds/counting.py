"""What no searcher can beat, computed exactly, so that a planner can be judged in 'x % above the bound'.

Setting. A static target is in cell c with probability m_c. Step t = 1, 2, ... moves the searcher one cell
and looks at the cells of its field of view; a look at the target's cell detects it with probability p_tp,
independently of every other look. F(t) is the probability that the target is detected within t steps. All
curves here are arrays F of length steps + 1 with F[0] = 0. The stopping rule is *first true hit*: a search
ends when the target's cell gives a hit.

F depends on the looks and on nothing else: after n_c(t) looks at each cell c

    F(t) = sum over c of  m_c * (1 - (1 - p_tp) ** n_c(t))
         = sum over c and k = 1 .. n_c(t) of  w(c, k),     w(c, k) = m_c * p_tp * (1 - p_tp) ** (k - 1).

So the k-th look at c is worth w(c, k), whenever it is made, and w falls with k. A false alarm changes which
looks a planner makes, not what they are worth: the bounds below hold for every p_tn.

**Teleport bound** (`teleport`). At most one look per step, anywhere. Then F(t) is a sum of at most t
different w(c, k), hence at most the sum of the t largest; that sum is attained for every t at once by
looking in descending order of w, which is a legal order because w falls with k (Chew 1967, A sequential
search procedure; Stone 1975, Theory of Optimal Search, chapter 4).

**Release bound** (`release`). One look per step, and no look at c before step r_c = max(1, distance(start,
c)), since a searcher enters one neighbouring cell per step. *The greedy order, at every step the most
valuable look released so far, maximises F(t) for every t.* Proof by exchange. Fix t and let S be any legal
order that agrees with greedy before step s <= t, where greedy makes look j and S makes i (or none). If S
makes j at a later step s' <= t, swap the two: i was released by s, so it is at s' too, and F(t) is
unchanged. If S does not make j by t, put j in place of i: F(t) does not fall, since w(j) >= w(i). Either
way S now agrees with greedy one step longer. That the k-th look at a cell follows the (k-1)-th holds by w
falling with k. A heap does it in O(n log n).

**Multi-cell bounds** (`multi_cell`). A footprint has at most K cells, and none further from the searcher
than `reach` (in moves). p_tp may differ between the cells of a footprint; p below is the largest of them,
which can only raise F: a target looked at with p_1, ..., p_k is missed with (1 - p_1)...(1 - p_k) >= (1 -
p) ** k.

1. *K looks per step, released.* Every look at c is at step max(1, distance(start, c) - reach) or later, and
   K are made per step. The exchange above goes through with K slots per step.
2. *New ground.* Let n be the largest number of cells in a footprint that are in none of the M footprints
   before it, over every sequence of moves (`new_cells`; M = 4, found by trying all of them). A first look
   at a cell is at a cell in none of the footprints before, so at most n per step are made once M steps have
   passed, and at most K before. So after t steps at most J(t) = K min(t, M) + n max(0, t - M) cells have
   been looked at, and at most K t looks made. For given numbers J of cells and L of looks, F(t) is largest
   on the J most probable cells (putting a more probable cell in place of another raises every w), and there
   it is at most the sum of the J largest first looks plus the L - J largest later ones among any cells.
   Precisely, F(t) <= max over j <= J(t) of A(j) + B(K t - j), with A and B the running sums of the sorted
   first and later looks. Both are concave, so the best j is where the next first look is worth less than
   the next later one.
3. *Both, apart.* First looks are released and at most n per step (K in the first M); later looks are
   released and at most K per step. Greedy is best for each by itself, and F(t) is at most the sum of the
   two.

The bound is the least of the three at each t.

**Teleporting reference with false alarms** (`teleport_reference`). With p_tn < 1 the searcher does not know
which hits are true. The reference looks at its most probable cell at every step, updates by Bayes' rule and
goes on until the first true hit. It is a yardstick and no bound (the teleport bound is one, and ignores the
time that a false alarm costs). For the rule that stops at the first *acceptance*, looking at the most
probable cell is optimal (Smith and Walsh 1971); for first-true-hit stopping the order of Chew is.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from roisearch.bounds.kernels import greedy_looks, reference_looks, shortest_distances
from roisearch.fov import HEADINGS, MOVES
from roisearch.kernels.records import Floats, Ints

MEMORY = 4  # footprints that `new_cells` looks back on


class Footprints(Protocol):
    """What a field of view must tell: the cells it sees from a pose (`roisearch.FieldOfView` does)."""

    def cells(self, cell: tuple[int, int], heading: str, shape: tuple[int, int]) -> NDArray[np.integer]:
        """The cells seen, int [k, 2], clipped at the border of a map of this shape."""
        ...


def teleport(prior: Floats, p_tp: float, steps: int, *, looks: int = 1) -> Floats:
    """The best detection curve of a searcher that can look anywhere at any step.

    prior: float [rows, cols], the mass of each cell (it may sum to less than 1; the rest is never found).
    p_tp: probability that one look at the target's cell detects it. looks: looks per step.
    Returns F, float [steps + 1]. Raises ValueError for a mass or p_tp that is no probability.
    """
    mass = checked_mass(prior)
    check(p_tp, steps, looks)
    released = np.ones(mass.size, dtype=np.int64)
    return greedy_looks(mass, released, np.full(steps, looks, dtype=np.int64), float(p_tp))


def release(
    prior: Floats,
    start: tuple[int, int],
    p_tp: float,
    steps: int,
    *,
    looks: int = 1,
    reach: int = 0,
    flyable: NDArray[np.bool_] | None = None,
) -> Floats:
    """The best detection curve when cell c cannot be looked at before step distance(start, c).

    prior, p_tp, steps, looks: as `teleport`. start: (row, col) of the searcher before its first step.
    reach: how many moves away a cell can be seen from (0: only from itself). flyable: bool [rows, cols];
    when given and reach is 0, distances go around the cells that cannot be entered. Returns F, float [steps
    + 1]. Raises ValueError for a start off the map or not flyable.
    """
    mass = checked_mass(prior)
    check(p_tp, steps, looks)
    released = release_steps(prior.shape, start, reach, flyable)
    return greedy_looks(mass, released, np.full(steps, looks, dtype=np.int64), float(p_tp))


def multi_cell(
    prior: Floats, start: tuple[int, int], fov: Footprints, p_tp: float, steps: int, *, memory: int = MEMORY
) -> Floats:
    """An upper bound on the detection curve of a searcher with this field of view (see the module's text).

    p_tp: the largest one of the field of view. Returns F, float [steps + 1].
    """
    mass = checked_mass(prior)
    check(p_tp, steps, 1)
    offsets = _offsets(fov)
    most = max(len(seen) for seen in offsets.values())
    reach = max((int(np.abs(seen).sum(axis=1).max()) for seen in offsets.values() if len(seen)), default=0)
    if most == 0:
        return np.zeros(steps + 1)
    fresh = new_cells(fov, memory=memory)
    released = release_steps(prior.shape, start, reach, None)
    all_looks = np.full(steps, most, dtype=np.int64)
    first_looks = np.where(np.arange(steps) < memory, most, fresh).astype(np.int64)

    released_looks = greedy_looks(mass, released, all_looks, float(p_tp))
    # p_tp = 1 leaves a cell one look, so `first` is made of first looks; `later` starts from what they left.
    first = greedy_looks(mass * p_tp, released, first_looks, 1.0)
    later = greedy_looks(mass * (1.0 - p_tp), released, all_looks, float(p_tp))
    new_ground = _new_ground(mass, np.cumsum(first_looks), np.cumsum(all_looks), float(p_tp))
    return np.minimum(np.minimum(released_looks, first + later), new_ground)


def new_cells(fov: Footprints, *, memory: int = MEMORY) -> int:
    """The most cells that one step can see which none of the `memory` steps before it saw."""
    offsets = _offsets(fov)
    most = 0
    for headings in itertools.product(HEADINGS, repeat=memory + 1):
        at = np.zeros(2, dtype=np.int64)
        before: set[tuple[int, int]] = set()
        for step, heading in enumerate(headings):
            at = at + MOVES[HEADINGS.index(heading)]
            seen = {(int(row), int(col)) for row, col in offsets[heading] + at}
            if step == memory:
                most = max(most, len(seen - before))
            before |= seen
    return most


def teleport_reference(
    prior: Floats,
    p_tp: float,
    p_tn: float,
    steps: int,
    rng: np.random.Generator,
    *,
    draws: int = 20,
    looks: int = 1,
) -> Floats:
    """Mean detection curve of the searcher that looks at its `looks` most probable cells at every step.

    False alarms are drawn from rng with probability 1 - p_tn per look, `draws` times over; the search stops
    at the first true hit. Returns F, float [steps + 1].
    """
    mass = checked_mass(prior)
    check(p_tp, steps, looks)
    if not 0.0 < p_tn <= 1.0:
        raise ValueError(f"p_tn must be above 0 and at most 1, not {p_tn}")
    total = np.zeros(steps + 1)
    for _ in range(draws):
        alarms = rng.random(steps * looks) >= p_tn
        total += reference_looks(mass, alarms, steps, looks, float(p_tp), float(p_tn))
    return total / draws


def expected_time(curve: Floats) -> float:
    """Mean of min(T, steps), T the step of detection: the sum of 1 - F(t) over t = 0 .. steps - 1."""
    return float(np.sum(1.0 - np.asarray(curve)[:-1]))


def quantiles(curve: Floats, levels: Iterable[float] = (0.05, 0.25, 0.5, 0.75, 0.95)) -> Floats:
    """The first step at which F reaches each level; inf where it never does. Returns float [len(levels)]."""
    wanted = np.asarray(list(levels), dtype=np.float64)
    steps = np.searchsorted(np.asarray(curve), wanted - 1e-12).astype(np.float64)
    return np.where(steps >= len(curve), np.inf, steps)


def _new_ground(mass: Floats, cells: Ints, looks: Ints, p_tp: float) -> Floats:
    """Bound 2 of the module's text; cells, looks: int [steps], the limits after each step."""
    steps = len(looks)
    most_looks = int(looks[-1]) if steps else 0
    worth = np.sort(mass)[::-1] * p_tp
    first = np.concatenate([[0.0], np.cumsum(worth)])
    one_each = np.ones(most_looks, dtype=np.int64)
    later = greedy_looks(mass * (1.0 - p_tp), np.ones(mass.size, dtype=np.int64), one_each, p_tp)
    values = np.zeros(steps + 1)
    taken = 0
    for step in range(steps):
        limit = min(int(cells[step]), mass.size, int(looks[step]))
        # The best number of first looks never falls with the step, as both limits grow.
        while taken < limit and (
            first[taken + 1] - first[taken]
            >= later[min(looks[step] - taken, most_looks)] - later[looks[step] - taken - 1]
        ):
            taken += 1
        values[step + 1] = first[taken] + later[looks[step] - taken]
    return values


def _offsets(fov: Footprints) -> dict[str, Ints]:
    """The cells seen relative to the searcher's, int [k, 2], for each heading."""
    middle = 1 << 20
    shape = (2 * middle + 1, 2 * middle + 1)
    return {h: np.asarray(fov.cells((middle, middle), h, shape), dtype=np.int64) - middle for h in HEADINGS}


def release_steps(
    shape: tuple[int, ...], start: tuple[int, int], reach: int, flyable: NDArray[np.bool_] | None
) -> Ints:
    """The first step at which each cell can be looked at, int [rows * cols]; a huge one where never."""
    rows, cols = shape
    if not (0 <= start[0] < rows and 0 <= start[1] < cols):
        raise ValueError(f"the start {start} is not on the map of {rows} x {cols} cells")
    if flyable is not None and reach == 0:
        if not flyable[start]:
            raise ValueError(f"the start {start} is not flyable")
        distance = shortest_distances(np.ascontiguousarray(flyable, dtype=np.bool_), start[0], start[1])
    else:
        row, col = np.indices((rows, cols))
        distance = np.abs(row - start[0]) + np.abs(col - start[1])
    return np.maximum(1, distance.ravel() - reach).astype(np.int64)


def checked_mass(prior: Floats) -> Floats:
    """The mass of each cell, float [rows * cols]; ValueError when it is no probability."""
    if prior.ndim != 2:
        raise ValueError(f"the prior must have rows and columns, not shape {prior.shape}")
    mass = np.ascontiguousarray(prior, dtype=np.float64).ravel()
    if not np.all(np.isfinite(mass)) or np.any(mass < 0.0) or mass.sum() > 1.0 + 1e-6:
        raise ValueError("the prior must be finite, not negative, and sum to at most 1")
    return mass


def check(p_tp: float, steps: int, looks: int) -> None:
    """ValueError for a p_tp that is no probability, or numbers of steps and looks that cannot be."""
    if not 0.0 < p_tp <= 1.0:
        raise ValueError(f"p_tp must be above 0 and at most 1, not {p_tp}")
    if steps < 0 or looks < 1:
        raise ValueError(f"steps must be 0 or more and looks 1 or more, not {steps} and {looks}")
