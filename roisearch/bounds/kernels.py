"""Compiled loops of `roisearch.bounds.counting`: looks taken from a heap, distances around obstacles."""

from __future__ import annotations

import heapq

import numpy as np
from numba import njit
from numpy.typing import NDArray

from roisearch.kernels.records import Floats, Ints

NEVER = np.int64(1) << 60


@njit(cache=True, nogil=True)
def greedy_looks(mass: Floats, released: Ints, looks: Ints, p_tp: float) -> Floats:
    """Detection curve of taking, at every step, the most valuable looks released so far.

    mass: float [n], undetected mass of each cell. released: int [n], first step (from 1) at which a cell
    may be looked at. looks: int [steps], how many looks each step has. Returns float [steps + 1].
    """
    order = np.argsort(released)
    curve = np.zeros(looks.size + 1)
    heap = [0.0]  # negated undetected masses; the zero is a look that is worth nothing
    found = 0.0
    arrived = 0
    for step in range(1, looks.size + 1):
        while arrived < order.size and released[order[arrived]] <= step:
            if mass[order[arrived]] > 0.0:
                heapq.heappush(heap, -mass[order[arrived]])
            arrived += 1
        for _ in range(looks[step - 1]):
            undetected = -heap[0]
            if undetected <= 0.0:
                break
            found += p_tp * undetected
            if p_tp < 1.0:
                heapq.heapreplace(heap, -(1.0 - p_tp) * undetected)
            else:
                heapq.heappop(heap)
        curve[step] = found
    return curve


@njit(cache=True, nogil=True)
def reference_looks(
    mass: Floats, alarms: NDArray[np.bool_], steps: int, looks: int, p_tp: float, p_tn: float
) -> Floats:
    """Detection curve of looking at the most probable cells, with false alarms.

    mass: float [n]. alarms: bool [steps * looks], whether a look at a cell without the target gives a hit.
    The odds of a cell are multiplied by p_tp / (1 - p_tn) on a hit, by (1 - p_tp) / p_tn on a miss. Looks
    of one step are at different cells. Returns float [steps + 1].
    """
    curve = np.zeros(steps + 1)
    undetected = mass.copy()
    heap = [(-mass[cell], cell) for cell in range(mass.size)]
    heapq.heapify(heap)
    found = 0.0
    back = [(0.0, 0) for _ in range(0)]
    for step in range(1, steps + 1):
        for look in range(min(looks, mass.size)):
            weight, cell = heapq.heappop(heap)
            found += p_tp * undetected[cell]
            undetected[cell] *= 1.0 - p_tp
            if alarms[(step - 1) * looks + look]:
                back.append((weight * p_tp / (1.0 - p_tn), cell))
            else:
                back.append((weight * (1.0 - p_tp) / p_tn, cell))
        for entry in back:
            heapq.heappush(heap, entry)
        back.clear()
        curve[step] = found
    return curve


@njit(cache=True, nogil=True)
def shortest_distances(flyable: NDArray[np.bool_], row: int, col: int) -> Ints:
    """Moves from (row, col), through flyable cells to each cell, int [rows, cols]; NEVER if no way."""
    rows, cols = flyable.shape
    distance = np.full((rows, cols), NEVER)
    queue = np.empty((rows * cols, 2), dtype=np.int64)
    distance[row, col] = 0
    queue[0, 0], queue[0, 1] = row, col
    head, tail = 0, 1
    while head < tail:
        at_row, at_col = queue[head, 0], queue[head, 1]
        head += 1
        for step_row, step_col in ((-1, 0), (0, 1), (1, 0), (0, -1)):
            to_row, to_col = at_row + step_row, at_col + step_col
            if not (0 <= to_row < rows and 0 <= to_col < cols and flyable[to_row, to_col]):
                continue
            if distance[to_row, to_col] == NEVER:
                distance[to_row, to_col] = distance[at_row, at_col] + 1
                queue[tail, 0], queue[tail, 1] = to_row, to_col
                tail += 1
    return distance
