"""The belief's arithmetic: multiply the odds of the looked-at cells, keep the total as a tree of sums.

Weights are unnormalised. Their sum is kept as a tree with 16 children a node over the cells in row-major
order, and a changed cell recomputes the sums above it: four of them for 40 000 cells, six for 16 million. A
total that is *recomputed* and never *adjusted* is a pure function of the weights: it cannot drift, however
many looks there were, and two beliefs with the same weights have the same total to the last bit.

`offsets[l]` is where level l + 1 starts in `sums`; the last level has one node, the total.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from roisearch.kernels.compiled import allocating_kernel, kernel
from roisearch.kernels.handover import Layout, array

FANOUT = 16
MOST_COUNTED = 32_000

WEIGHTS = Layout(
    # [rows * cols] by rows, and their sums and offsets as in this module's first lines
    weights=(np.float64, 1),
    sums=(np.float64, 1),
    offsets=(np.int64, 1),
    cols=np.int64,
)
opened = WEIGHTS.opener()

OK, OUT_OF_MAP, BAD_PROBABILITY, IMPOSSIBLE, CERTAIN = 0, 1, 2, 3, 4


def tree_offsets(cells: int) -> NDArray[np.int64]:
    """Where each level of the sum tree over `cells` leaves starts, and where the last ends: [levels + 1]."""
    offsets = [0]
    size = cells
    while True:
        size = -(-size // FANOUT)
        offsets.append(offsets[-1] + size)
        if size == 1:
            return np.array(offsets, dtype=np.int64)


@kernel
def sum_up(weights: NDArray[np.float64], sums: NDArray[np.float64], offsets: NDArray[np.int64]) -> None:
    """Fill `sums` from `weights` [cells]: every level, every node."""
    for level in range(offsets.size - 1):
        below = weights if level == 0 else sums[offsets[level - 1] : offsets[level]]
        for node in range(offsets[level + 1] - offsets[level]):
            total = 0.0
            for child in range(node * 16, min(node * 16 + 16, below.size)):
                total += below[child]
            sums[offsets[level] + node] = total


@kernel
def resum(
    cell: int, weights: NDArray[np.float64], sums: NDArray[np.float64], offsets: NDArray[np.int64]
) -> None:
    """Recompute the sums above one changed cell."""
    node = cell >> 4
    total = 0.0
    for child in range(node * 16, min(node * 16 + 16, weights.size)):
        total += weights[child]
    sums[node] = total
    for level in range(1, offsets.size - 1):
        node >>= 4
        start = offsets[level - 1]
        total = 0.0
        for child in range(start + node * 16, min(start + node * 16 + 16, offsets[level])):
            total += sums[child]
        sums[offsets[level] + node] = total


@allocating_kernel
def apply_looks(
    parcel: int,
    outside: float,
    cells: NDArray[np.int64],
    hits: NDArray[np.bool_],
    p_tp: NDArray[np.float64],
    p_tn: NDArray[np.float64],
) -> tuple[int, int]:
    """Multiply the odds of each looked-at cell.

    Args:
        parcel: address of what `WEIGHTS` packed; weights and sums are changed in place.
        outside: weight of 'not in the area'; no look changes it.
        cells: row and column, [k, 2].
        hits, p_tp, p_tn: [k], or [1] for all looks alike.

    Returns:
        (OK, number of hits); or why not, the look at fault, and nothing has changed. CERTAIN is a hit with
        p_tn = 1, whose odds are infinite.
    """
    given = opened(parcel)
    weights, sums, offsets, cols = array(given.weights), array(given.sums), array(given.offsets), given.cols
    rows = weights.size // cols
    found = 0
    for look in range(cells.shape[0]):
        row, col = cells[look, 0], cells[look, 1]
        tp, tn = p_tp[look % p_tp.size], p_tn[look % p_tn.size]
        if row < 0 or col < 0 or row >= rows or col >= cols:
            return OUT_OF_MAP, look
        if not (0.0 <= tp <= 1.0 and 0.0 < tn <= 1.0):
            return BAD_PROBABILITY, look
        if hits[look % hits.size]:
            found += 1
            if tn == 1.0:
                return CERTAIN, look
    before = np.empty(cells.shape[0])
    for look in range(cells.shape[0]):
        cell = cells[look, 0] * cols + cells[look, 1]
        tp, tn = p_tp[look % p_tp.size], p_tn[look % p_tn.size]
        before[look] = weights[cell]
        if hits[look % hits.size]:
            weights[cell] *= tp / (1.0 - tn)
        else:
            weights[cell] *= (1.0 - tp) / tn
        resum(cell, weights, sums, offsets)
    if sums[-1] + outside > 0.0 and np.isfinite(sums[-1]):
        return OK, found
    for look in range(cells.shape[0] - 1, -1, -1):
        cell = cells[look, 0] * cols + cells[look, 1]
        weights[cell] = before[look]
        resum(cell, weights, sums, offsets)
    return IMPOSSIBLE, 0


@kernel
def count_looks(
    tally: NDArray[np.int16], cols: int, cells: NDArray[np.int64], hits: NDArray[np.bool_]
) -> None:
    """Add to `tally` [cells, 2], the misses and hits so far; at MOST_COUNTED it stays."""
    for look in range(cells.shape[0]):
        cell, kind = cells[look, 0] * cols + cells[look, 1], 1 if hits[look % hits.size] else 0
        tally[cell, kind] = min(tally[cell, kind] + 1, MOST_COUNTED)
