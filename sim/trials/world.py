"""The world of a trial, compiled: the drone enters a cell, and the detector says what it saw there."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from roisearch.kernels.compiled import kernel


@kernel
def look(
    row: int,
    col: int,
    heading: int,
    target: int,
    covered: bool,
    silent: bool,
    offsets: NDArray[np.int64],
    p_tp: NDArray[np.float64],
    p_tn: NDArray[np.float64],
    draws: NDArray[np.float64],
    first: int,
    undetected: NDArray[np.float64],
    seen: NDArray[np.bool_],
    cols: int,
    cells: NDArray[np.int64],
    hits: NDArray[np.bool_],
    tp: NDArray[np.float64],
    tn: NDArray[np.float64],
) -> tuple[int, bool, float, int, int]:
    """One look from (row, col).

    Args:
        target: flat index of the target's cell, -1 when there is none.
        covered: whether having the target in view is finding it.
        silent: whether the detector says of the target's cell what it would say of any other one.
        offsets, p_tp, p_tn: the field of view, [4, k, 2], [k], [k].
        draws: uniform numbers; those from `first` on are used, one for each cell of the field of view.
        undetected: [cells], the mass of each cell that all looks so far would have missed; updated.
        seen: [cells], which cells have been looked at; updated.
        cells, hits, tp, tn: the observation is written here, [k, 2], [k], [k], [k].

    Returns:
        How many cells were seen, whether the target was found, the probability that this look detects the
        target, how many cells were seen for the first time, and how many hits were false.
    """
    rows = undetected.size // cols
    count, fresh, false_alarms = 0, 0, 0
    found = False
    gained = 0.0
    for i in range(offsets.shape[1]):
        r, c = row + offsets[heading, i, 0], col + offsets[heading, i, 1]
        if r < 0 or c < 0 or r >= rows or c >= cols:
            continue
        cell = r * cols + c
        detects = 1.0 if covered and p_tp[i] > 0.0 else p_tp[i]
        gained += detects * undetected[cell]
        undetected[cell] *= 1.0 - detects
        if not seen[cell]:
            seen[cell] = True
            fresh += 1
        if cell == target:
            found = found or draws[first + i] < detects
        if cell == target and not silent:
            hit = draws[first + i] < detects
        else:
            hit = draws[first + i] >= p_tn[i]
            false_alarms += hit and cell != target
        cells[count, 0], cells[count, 1] = r, c
        hits[count] = hit
        tp[count] = p_tp[i]
        tn[count] = p_tn[i]
        count += 1
    return count, found, gained, fresh, false_alarms
