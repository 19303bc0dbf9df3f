"""The world of a trial, compiled: the drone enters a cell, and the detector says what it saw there."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from roisearch.kernels.compiled import kernel


class Truth(NamedTuple):
    """Where the target is, and what counts."""

    target: int  # flat index of its cell, -1 when there is none
    covered: bool  # having the target in view is finding it
    silent: bool  # the detector says of the target's cell what it would say of any other one


class View(NamedTuple):
    """The field of view: [4, k, 2], [k], [k]."""

    offsets: NDArray[np.int64]
    p_tp: NDArray[np.float64]
    p_tn: NDArray[np.float64]


class Ground(NamedTuple):
    """What all looks so far have left, [rows, cols] each; every look updates it."""

    undetected: NDArray[np.float64]  # the mass of each cell that all of them would have missed
    seen: NDArray[np.bool_]  # which cells have been looked at


class Sight(NamedTuple):
    """An observation, [k, 2], [k], [k], [k]; every look writes into it."""

    cells: NDArray[np.int64]
    hits: NDArray[np.bool_]
    tp: NDArray[np.float64]
    tn: NDArray[np.float64]

    @staticmethod
    def of(k: int) -> Sight:
        """Room for one of k cells."""
        return Sight(np.zeros((k, 2), dtype=np.int64), np.zeros(k, dtype=np.bool_), np.zeros(k), np.zeros(k))


@kernel
def look(
    cell: tuple[int, int],
    heading: int,
    truth: Truth,
    view: View,
    draws: NDArray[np.float64],
    ground: Ground,
    sight: Sight,
) -> tuple[int, bool, float, int, int]:
    """One look from a cell (row, col). `draws` are uniform numbers, one for each cell of the field of view.

    Returns:
        How many cells were seen, whether the target was found, the probability that this look detects the
        target, how many cells were seen for the first time, and how many hits were false.
    """
    rows, cols = ground.undetected.shape
    count, fresh, false_alarms = 0, 0, 0
    found = False
    gained = 0.0
    for i in range(view.offsets.shape[1]):
        r, c = cell[0] + view.offsets[heading, i, 0], cell[1] + view.offsets[heading, i, 1]
        if r < 0 or c < 0 or r >= rows or c >= cols:
            continue
        here = r * cols + c == truth.target
        p_tp = view.p_tp[i]
        detects = 1.0 if truth.covered and p_tp > 0.0 else p_tp
        gained += detects * ground.undetected[r, c]
        ground.undetected[r, c] *= 1.0 - detects
        if not ground.seen[r, c]:
            ground.seen[r, c] = True
            fresh += 1
        if here:
            found = found or draws[i] < detects
        if here and not truth.silent:
            hit = draws[i] < detects
        else:
            hit = draws[i] >= view.p_tn[i]
            false_alarms += hit and not here
        sight.cells[count, 0], sight.cells[count, 1] = r, c
        sight.hits[count] = hit
        sight.tp[count] = p_tp
        sight.tn[count] = view.p_tn[i]
        count += 1
    return count, found, gained, fresh, false_alarms
