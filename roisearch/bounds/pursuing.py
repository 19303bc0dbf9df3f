"""A target that walks: what no searcher finds of it, its own ways included, and on small maps the best that there is.

Setting. The target walks as `roisearch.Walk` says, by ticks. The searcher begins at a cell and takes `step_s` or more
to enter a neighbouring one; entering is a look, which detects with p_tp. What is maximised is J = sum of h(t) times
what a look at time t adds to F, with h never rising: h = 1 up to a time T gives F(T), h(t) = T - t gives T minus the
expected time to the first detection restricted to T.

1. *Layers.* Any flight has looks at least `step_s` apart, so at most one in each step ((s - 1) step_s, s step_s].
   Within a step it is either before a tick or after it. So each look of a flight is in a *layer*, a step and a number
   of ticks, and no two of them in layers of one step. Looks of one layer see the same distribution of targets. Its
   gain h is that of the earliest moment at which a look can be in it: with four neighbours all steps are alike and
   that is the end of the step; with eight, where a diagonal takes longer, it is the layer's beginning, and the cell
   of a searcher that is under way is the last one that it entered, so that it may wait for a step without a look.
2. *Looks count less and less.* A target on the way w, which has the probability P(w), is detected by N looks on its
   way with the probability D(N) = 1 - (1 - p_tp)^N. Of a flight x, 1 where it looks and else 0, the looks up to layer
   l on the way w are N_l(x, w) = sum over k <= l of x(k, w_k), and F_l(x) = sum over w of P(w) D(N_l(x, w)). J = sum
   over l of (h_l - h_{l+1}) F_l, with weights that are not negative.
3. *Tangents.* D is concave on the whole numbers: for all whole numbers N and k

       D(N) <= D(k) + p_tp (1 - p_tp)^k (N - k).

   k may be another one for each way and layer, and may be drawn: on both sides the mean is taken. Draw it as the
   number of *guessed* looks on the way up to the layer, each made by itself with the chance b(l, c), 0 to 1. Then all
   means are products along the way, and are summed over all ways by filtering: the right side, summed with all
   weights, is a constant plus the sum over l, c of g(l, c) x(l, c), where g(l, c) is p_tp times the mass that goes
   through c in layer l, each part of it counted by its chance to be missed by all guessed looks up to each later
   layer, times that layer's weight (a pass forth and one back); and the constant is J of the guessed looks less the
   sum of b (1 - p_tp) / (1 - p_tp b) g.
4. *Paths.* So J(x) <= constant + g x for every flight, and the largest g x of all flights is a longest path through
   the layers, by dynamic programming. That holds for whatever b; the least over all that were tried is **the bound**.
   With b = 0 it is the mean number of looks at the target.

b is mixed of longest paths, each of which makes its own looks count less in the next round. Splitting flights up is
the idea of Washburn's bound ('Search for a moving target: the FAB algorithm', Operations Research 31, 1983), b = 0
with paths that of Martins ('A new branch-and-bound procedure for computing optimal search paths', Naval Postgraduate
School, 1993), and a bound of that kind prunes the search for the optimum in Eagle and Yee ('An optimal
branch-and-bound procedure for the constrained path, moving target search problem', Operations Research 38, 1990), as
here in `best_flight`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from roisearch.bounds.pursuing_kernels import Layers, best_path, limit_from, linear, walked_on
from roisearch.kernels.records import Floats
from roisearch.walk import Walk, Ways

_SLOWEST = 0.02
"""The least part of a new path that is mixed in."""


@dataclass(frozen=True)
class Hunt:
    """A search for a target that walks.

    Attributes:
        walk: how the target walks.
        start: (row, col), where the searcher begins; no look is made there before it is entered again.
        p_tp: of a look.
        step_s: the least time to enter a neighbouring cell, seconds.
        until_s: for how long it searches.
        diagonal: whether it moves to eight neighbours, some of which may take longer; else to four, all alike.

    Raises: ValueError when a value is out of range.
    """

    walk: Walk
    start: tuple[int, int] = (0, 0)
    p_tp: float = 0.9
    step_s: float = 3.125
    until_s: float = 1500.0
    diagonal: bool = True

    def __post_init__(self) -> None:
        if not 0.0 < self.p_tp <= 1.0:
            raise ValueError(f"p_tp must be above 0 and at most 1, not {self.p_tp}")
        if not 1e-6 <= self.step_s <= self.until_s < math.inf:
            raise ValueError(
                f"a search lasts for a step or longer, not {self.until_s} s with steps of {self.step_s} s"
            )

    @property
    def steps(self) -> int:
        """The most steps that end in time."""
        return round(self.until_s * 1e6) // round(self.step_s * 1e6)


def layers_of(hunt: Hunt, ways: Ways, counts: str) -> Layers:
    """The layers of a search; `counts`: "found", all that is found by the end alike, or "seconds", sooner for more."""
    if counts not in ("found", "seconds"):
        raise ValueError(f"what counts is 'found' or 'seconds', not '{counts}'")
    step_us, tick_us, until_us = round(hunt.step_s * 1e6), ways.walk.tick_us, round(hunt.until_s * 1e6)
    step, ticks, gain, gone = [], [], [], 0
    for number in range(-(-until_us // step_us) if hunt.diagonal else hunt.steps):
        begin, end = number * step_us, min((number + 1) * step_us, until_us)
        for count in range((begin if hunt.diagonal else end) // tick_us, end // tick_us + 1):
            step.append(number)
            ticks.append(count - gone)
            earliest = max(begin, count * tick_us) if hunt.diagonal else end
            gain.append((until_us - earliest) / 1e6 if counts == "seconds" else 1.0)
            gone = count
    whole = np.array(step, dtype=np.int64), np.array(ticks, dtype=np.int64), np.array(gain)
    return Layers(*whole, ways.into, ways.stops, hunt.p_tp, hunt.diagonal)


@dataclass(frozen=True)
class PursuitBound:
    """What no flight reaches.

    Attributes:
        most: no flight's J is above; of "found" that is F at the end.
        seconds: of "seconds": no flight's expected time, restricted to the search, is below. Else not a number.
    """

    most: float
    seconds: float


def pursuit(
    prior: NDArray[np.float64],
    hunt: Hunt,
    *,
    counts: str = "found",
    searchable: NDArray[np.bool_] | None = None,
    iterations: int = 60,
) -> PursuitBound:
    """The bound of the module's text: what no searcher finds of a target that walks.

    Args:
        prior: float [rows, cols], not negative; scaled to sum to 1.
        counts: "found" bounds F at the end, "seconds" the expected time, restricted to the end.
        searchable: bool [rows, cols], where the target may be; None: everywhere.
        iterations: how many b are tried; each takes some passes over layers times cells.

    Raises:
        ValueError: when the start is off the map, or an argument is out of range.
    """
    problem = Chase.of(prior, hunt, counts, searchable)
    if iterations < 1:
        raise ValueError(f"iterations must be at least 1, not {iterations}")
    most, _ = _least(problem, iterations)
    return PursuitBound(most, hunt.until_s - most if counts == "seconds" else math.nan)


@dataclass(frozen=True, eq=False)
class Chase:
    """A prior, float [cells], the cell where the searcher starts, and its layers, on a map of `shape`."""

    mass: Floats
    start: int
    layers: Layers
    shape: tuple[int, int]

    @classmethod
    def of(
        cls, prior: NDArray[np.float64], hunt: Hunt, counts: str, searchable: NDArray[np.bool_] | None
    ) -> Chase:
        """Checked; ValueError when something cannot be."""
        mass = np.array(prior, dtype=np.float64)
        if mass.ndim != 2 or not np.isfinite(mass).all() or (mass < 0.0).any():
            raise ValueError("the prior must be a map of rows and columns, finite and not negative")
        if searchable is not None:
            mass = mass * searchable
        if mass.sum() <= 0.0:
            raise ValueError("the prior holds no probability where the target can be")
        (rows, cols), (row, col) = mass.shape, hunt.start
        if not (0 <= row < rows and 0 <= col < cols):
            raise ValueError(f"the start {hunt.start} is not on the map of {rows} x {cols} cells")
        layers = layers_of(hunt, hunt.walk.ways((rows, cols), searchable), counts)
        return cls((mass / mass.sum()).ravel(), row * cols + col, layers, (rows, cols))


def _least(problem: Chase, iterations: int) -> tuple[float, NDArray[np.float64]]:
    """The least bound, and the b, float [n, cells], that gave it."""
    layers, cells = problem.layers, problem.mass.size
    n, steps = layers.step.size, int(layers.step[-1]) + 1
    guess, choice = np.zeros((n, cells)), np.zeros((steps, cells), dtype=np.int8)
    before, path, nobody = np.zeros((2, n, cells)), np.zeros(n, dtype=np.int64), np.zeros(cells)
    least, best = float(layers.gain[0]), guess
    for i in range(iterations):
        bound = linear(guess, problem.mass, nobody, layers, before)
        bound += best_path(before[0], problem.start, layers, choice, path)
        if bound < least:
            least, best = bound, guess.copy()
        looks, part = np.flatnonzero(path >= 0), max(1.0 / (i + 1), _SLOWEST)
        guess *= 1.0 - part
        guess[looks, path[looks]] += part
    return least, best


@dataclass(frozen=True, eq=False)
class BestFlight:
    """The best there is: its J, the cells it enters, int [steps, 2], and how many flights were begun to know that."""

    most: float
    path: NDArray[np.int64]
    tried: int


def best_flight(
    prior: NDArray[np.float64],
    hunt: Hunt,
    *,
    counts: str = "found",
    searchable: NDArray[np.bool_] | None = None,
    most_tried: int = 1_000_000,
) -> BestFlight:
    """The flight with the largest J of all, on a map so small that all can be tried; arguments as of `pursuit`.

    As nothing is detected until the end, what will be known at each moment is known before: a plan is a path, and the
    best path is found depth first, most promising move first, without those that cannot be better by the bound.

    Raises:
        ValueError: also for a searcher that flies diagonals, whose steps differ, and when `most_tried` do not do.
    """
    if hunt.diagonal:
        raise ValueError("the best flight is known for four neighbours only: give diagonal=False")
    problem = Chase.of(prior, hunt, counts, searchable)
    search = _DepthFirst(problem, _least(problem, 40)[1], most_tried)
    search.go_on(np.stack([problem.mass, np.zeros(problem.mass.size)]), problem.start, 0.0)
    cells = np.array(search.best, dtype=np.int64)
    return BestFlight(search.most, np.stack(np.divmod(cells, problem.shape[1]), axis=1), search.tried)


class _DepthFirst:
    """See `best_flight`."""

    def __init__(self, problem: Chase, guess: NDArray[np.float64], most_tried: int) -> None:
        self._layers, self._shape, self._guess = problem.layers, problem.shape, guess
        self._room = np.zeros((2, *guess.shape)), np.zeros(guess.shape, dtype=np.int8)
        self._most_tried = most_tried
        self._path: list[int] = []
        self.best: list[int] = []
        self.most, self.tried = -1.0, 0

    def go_on(self, mass: NDArray[np.float64], place: int, found: float) -> None:
        """Try all that may come after the path so far; `mass` [2, cells] is undetected, walking and stopped."""
        depth, layers = len(self._path), self._layers
        if depth == layers.step.size:
            if found > self.most:
                self.most, self.best = found, list(self._path)
            return
        self.tried += 1
        if self.tried > self._most_tried:
            raise ValueError(
                f"the best flight is not known after {self._most_tried} were begun; take fewer steps"
            )
        walked_on(mass, int(layers.ticks[depth]), layers)
        for limit, cell, gained, after in sorted(self._moves(mass, place, depth), key=lambda each: -each[0]):
            if found + limit > self.most * (1.0 + 1e-12):
                self._path.append(cell)
                self.go_on(after, cell, found + gained)
                self._path.pop()

    def _moves(
        self, mass: NDArray[np.float64], place: int, depth: int
    ) -> Iterator[tuple[float, int, float, NDArray[np.float64]]]:
        """Each next cell: the most that is found from now on, the cell, what it finds, and what is undetected then."""
        (rows, cols), layers = self._shape, self._layers
        row, col = divmod(place, cols)
        for r, c in ((row - 1, col), (row, col + 1), (row + 1, col), (row, col - 1)):
            if 0 <= r < rows and 0 <= c < cols:
                cell, after = r * cols + c, mass.copy()
                gained = float(layers.gain[depth] * layers.p_tp * mass[:, cell].sum())
                after[:, cell] *= 1.0 - layers.p_tp
                rest = limit_from(after, cell, depth + 1, self._guess, layers, *self._room)
                yield gained + rest, cell, gained, after
