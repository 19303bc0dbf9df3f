"""The exact ruler for several searchers on one belief: the detection curve of all their looks merged, without luck.

As `sim.ruler`: every searcher flies as if the target stayed undetected, and a look at a cell with the mass u undetected
there adds p_tp * u to F at the moment when it is made, whoever makes it; (1 - p_tp) * u is left for all. So no look is
counted twice, and F is exact. Time runs from arrival to arrival: whoever has flown what it decided on decides again.

A flight ends when less than `tail` is undetected, so expected times are of the targets that are found first: the mean
of T over the first 1 - tail of F. A curve that lies above another one at every t has the smaller such mean, so the mean
of a bound is a bound of the mean.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from roisearch import Belief, SearchState
from roisearch.decision import Cell
from roisearch.directions import direction_between
from roisearch.fov import FieldOfView

Decide = Callable[[int, Belief, Sequence[SearchState], float], Sequence[Cell]]
"""The cells that a searcher, by its number, enters next, for the belief, the states of all and the time in seconds."""


@dataclass(frozen=True)
class Aircraft:
    """One of those that search: where it starts, what it sees, and the seconds that it takes from cell to cell."""

    start: Cell
    fov: FieldOfView = field(default_factory=lambda: FieldOfView.point(0.9, 1.0))
    step_s: float = 1.0


@dataclass(frozen=True, eq=False)
class Flights:
    """The looks of all: when they were made, seconds, float [n], rising; and what each added to F, float [n]."""

    times: NDArray[np.float64]
    found: NDArray[np.float64]

    def expected(self, tail: float) -> float:
        """Mean seconds until the target is detected, of the first 1 - tail; infinite when less was found."""
        return expected_of_first(self.times, self.found, tail)


def expected_of_first(times: NDArray[np.float64], found: NDArray[np.float64], tail: float) -> float:
    """The mean of `times` over the first 1 - tail of what is `found`, both float [n]; infinite when there is less."""
    total = np.minimum(np.cumsum(found), 1.0 - tail)
    if not total.size or total[-1] < 1.0 - tail - 1e-9:
        return float("inf")
    return float(times @ np.diff(total, prepend=0.0)) / (1.0 - tail)


def fly_together(
    aircraft: Sequence[Aircraft], prior: NDArray[np.float64], decide: Decide, *, tail: float, most_s: float
) -> Flights:
    """Fly all of them until less than `tail` is undetected, or for `most_s` seconds."""
    belief = Belief(prior)
    undetected, left = belief.probability(), 1.0
    states = [SearchState(each.start) for each in aircraft]
    ahead: list[list[Cell]] = [[] for _ in aircraft]
    arrivals: list[tuple[float, int]] = []
    free, now = list(range(len(aircraft))), 0.0
    times, found = [], []
    while True:
        for i in free:
            ahead[i] = list(decide(i, belief, states, now))
        free = []
        for i in range(len(aircraft)):
            if not any(i == other for _, other in arrivals):
                heapq.heappush(arrivals, (now + aircraft[i].step_s, i))
        now = arrivals[0][0]
        while arrivals and arrivals[0][0] == now:
            i = heapq.heappop(arrivals)[1]
            cell = ahead[i].pop(0)
            states[i] = SearchState(cell, direction_between(states[i].cell, cell))
            seen, p_tp, p_tn = aircraft[i].fov.looks(cell, states[i].heading, belief.shape)
            rows, cols = seen[:, 0], seen[:, 1]
            times.append(now)
            found.append(float((p_tp * undetected[rows, cols]).sum()))
            undetected[rows, cols] *= 1.0 - p_tp
            left -= found[-1]
            if len(seen) and left > 1e-12:
                belief.observe(seen, False, p_tp, p_tn)
            if not ahead[i]:
                free.append(i)
        if left < tail or now >= most_s:
            return Flights(np.array(times), np.array(found))
