"""The best there is, on maps so small that every set of cells can be looked at: for p_tp = 1.

With a perfect detector a second look at a cell is worth nothing, so what is left depends on the *set* of cells
looked at, and a searcher goes straight from one new cell to the next (cells that it enters on its way are new cells
before). With S the set, c the cell and U(S) the mass outside S, the expected time from there on is

    E(S, c) = min over c' outside S of  distance(c, c') U(S) + E(S with c', c')

(Held and Karp's dynamic program, with a rate that falls with what has been seen).
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from roisearch.bounds.kernels import NEVER, shortest_distances

MOST_CELLS = 22


def least_expected_time(
    prior: NDArray[np.float64], start: tuple[int, int], *, flyable: NDArray[np.bool_] | None = None
) -> float:
    """The least expected number of steps until the first look at the target's cell, with p_tp = 1 and four moves.

    prior: float [rows, cols], at most 22 cells with mass, which sum to 1. The start is not looked at before it is
    entered again. Raises ValueError for a larger map, or when mass lies where no walk leads.
    """
    open_ = np.ones(prior.shape, dtype=np.bool_) if flyable is None else np.ascontiguousarray(flyable)
    cells = np.argwhere(prior > 0.0)
    if not 0 < len(cells) <= MOST_CELLS:
        raise ValueError(f"the prior must have mass in 1 to {MOST_CELLS} cells, not in {len(cells)}")
    at = tuple(cells.T)
    away = np.array([shortest_distances(open_, int(row), int(col))[at] for row, col in cells])
    first = shortest_distances(open_, *start)[at].copy()
    there = (cells == np.array(start)).all(axis=1)
    if there.any():  # it has to be left first
        first[there] = 2
    if (first >= NEVER).any():
        raise ValueError("some of the prior lies where no walk from the start leads")
    return float(_held_karp(prior[at].copy(), away, first))


@njit(cache=True, nogil=True)
def _held_karp(mass: NDArray[np.float64], away: NDArray[np.int64], first: NDArray[np.int64]) -> float:
    """mass: float [n]. away: int [n, n], steps between cells. first: int [n], steps from the start."""
    n = mass.size
    whole = (1 << n) - 1
    left = np.zeros(1 << n)  # mass outside a set
    for cells in range(whole - 1, -1, -1):
        lowest = 0
        while cells >> lowest & 1:
            lowest += 1
        left[cells] = left[cells | (1 << lowest)] + mass[lowest]
    best = np.zeros((1 << n, n))
    for cells in range(whole - 1, 0, -1):
        for here in range(n):
            if not cells >> here & 1:
                continue
            least = np.inf
            for there in range(n):
                if not cells >> there & 1:
                    least = min(least, away[here, there] * left[cells] + best[cells | (1 << there), there])
            best[cells, here] = least
    least = np.inf
    for there in range(n):
        least = min(least, first[there] * left[0] + best[1 << there, there])
    return least
