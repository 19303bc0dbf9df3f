"""Which cell of a region an option goes to: its most probable one, or the one most worth its distance."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from roisearch.kernels.compiled import kernel
from roisearch.kernels.forest import peak_cell
from roisearch.kernels.ground import FAR, find_sources, steps_to

PEAK, INDEX = 0, 1


@kernel
def index_cell(
    root: int,
    at: int,
    weights: NDArray[np.float64],
    cell_of: NDArray[np.int64],
    first: NDArray[np.int64],
    last: NDArray[np.int64],
    box: NDArray[np.int64],
    peaks: NDArray[np.float64],
    legal: NDArray[np.uint8],
    cols: int,
    offsets: NDArray[np.int64],
    is_point: bool,
    reach: int,
    worth: NDArray[np.float64],
    forward: NDArray[np.int32],
    stack: NDArray[np.int64],
) -> int:
    """The cell below `root` with the largest weight * worth[steps from `at`], by branch and bound; -1 if none.

    `worth` [steps] falls with the number of steps; steps ** (-1 / alpha) makes it the argmax of m ** alpha /
    steps. A node is skipped when even its peak, as near as its box and the sensor's reach allow, is no better
    than the best cell so far. `forward` [cells], steps from `at` around obstacles, is empty on open ground.
    """
    best, best_cell = 0.0, -1
    sources = np.empty(4 * offsets.shape[1], dtype=np.int64)
    no_fields = np.empty((0, 0), dtype=np.int32)
    row, col = at // cols, at % cols
    top = 0
    stack[0] = root
    while top >= 0:
        node = stack[top]
        top -= 1
        apart = max(box[node, 0] - row, 0, row - box[node, 1]) + max(
            box[node, 2] - col, 0, col - box[node, 3]
        )
        if peaks[node] * worth[min(max(apart - reach, 1), worth.size - 1)] <= best:
            continue
        if node * 16 >= cell_of.size:
            for child in range(last[node] - 1, first[node] - 1, -1):
                top += 1
                stack[top] = child
            continue
        for slot in range(node * 16, node * 16 + 16):
            cell = cell_of[slot]
            if cell < 0:
                break
            apart = max(abs(cell // cols - row) + abs(cell % cols - col) - reach, 1)
            if weights[cell] * worth[min(apart, worth.size - 1)] <= best:
                continue
            steps = FAR
            if is_point and forward.size == 0:
                steps = steps_to(at, cell, 0, cols, True, sources, 0, no_fields)
            else:
                count = find_sources(cell, legal, cols, offsets, sources)
                if forward.size == 0:
                    steps = steps_to(at, cell, 0, cols, False, sources, count, no_fields)
                else:
                    for i in range(count):
                        steps = min(steps, forward[sources[i]] + 1)
            if steps >= FAR:
                continue
            score = weights[cell] * worth[min(steps, worth.size - 1)]
            if score > best:
                best, best_cell = score, cell
    return best_cell


@kernel
def choose_goals(
    rule: int,
    at: int,
    roots: NDArray[np.int64],
    goals: NDArray[np.int64],
    sources: NDArray[np.int64],
    counts: NDArray[np.int64],
    weights: NDArray[np.float64],
    cell_of: NDArray[np.int64],
    first: NDArray[np.int64],
    last: NDArray[np.int64],
    box: NDArray[np.int64],
    peaks: NDArray[np.float64],
    legal: NDArray[np.uint8],
    cols: int,
    offsets: NDArray[np.int64],
    is_point: bool,
    reach: int,
    worth: NDArray[np.float64],
    forward: NDArray[np.int32],
    stack: NDArray[np.int64],
) -> None:
    """Fill `goals` [regions] (-1: nothing to find there), and their `sources` [regions, 4 k] and `counts`."""
    for region in range(roots.size):
        goal = -1
        if roots[region] >= 0:
            if rule == PEAK:
                goal = peak_cell(roots[region], weights, cell_of, first, last, peaks)
            else:
                goal = index_cell(
                    roots[region], at, weights, cell_of, first, last, box, peaks, legal, cols, offsets, is_point,
                    reach, worth, forward, stack,
                )  # fmt: skip
        goals[region] = goal
        counts[region] = 0
        if goal >= 0:
            counts[region] = find_sources(goal, legal, cols, offsets, sources[region])
