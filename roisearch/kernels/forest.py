"""Sum and peak of every region, kept up to date at the price of the looked-at cells.

Each region is a tree with 16 children a node over its cells in Morton order, so that a node is also a small
box on the map: the same tree answers 'how much mass is in region 3', 'where is its most probable cell' and,
by branch and bound, 'which cell has the most mass for its distance'. Like the belief's total, every number is
recomputed from the weights and never adjusted, so it cannot drift.

Arrays (see `roisearch.forest.Forest`): `cell_of` [slots] the cell in a slot, -1 for padding; `slot_of`
[cells] its inverse, -1 for a cell in no region; nodes 0 .. slots / 16 - 1 are the leaves, node j over slots
16 j .. 16 j + 15; `first`, `last` [nodes] the children of an inner node; `parent` [nodes], -1 for a root;
`box` [nodes, 4] the rows and columns covered, inclusive: row_min, row_max, col_min, col_max; `root`
[regions].
"""

from __future__ import annotations

import numpy as np

from roisearch.kernels.compiled import kernel
from roisearch.kernels.handover import Layout, array
from roisearch.kernels.records import Floats, Forest, Ints

TOUCHED = Layout(
    cols=np.int64,
    cell_of=(np.int64, 1),
    slot_of=(np.int64, 1),
    first=(np.int64, 1),
    last=(np.int64, 1),
    parent=(np.int64, 1),
    sums=(np.float64, 1),
    peaks=(np.float64, 1),
)
opened = TOUCHED.opener()


@kernel
def _renew(
    node: int,
    weights: Floats,
    cell_of: Ints,
    first: Ints,
    last: Ints,
    sums: Floats,
    peaks: Floats,
) -> None:
    """Recompute one node from its children."""
    total = 0.0
    peak = -1.0
    if node * 16 < cell_of.size:
        for slot in range(node * 16, node * 16 + 16):
            cell = cell_of[slot]
            if cell < 0:
                break
            total += weights[cell]
            peak = max(peak, weights[cell])
    else:
        for child in range(first[node], last[node]):
            total += sums[child]
            peak = max(peak, peaks[child])
    sums[node] = total
    peaks[node] = peak


@kernel
def grow(
    weights: Floats,
    cell_of: Ints,
    first: Ints,
    last: Ints,
    sums: Floats,
    peaks: Floats,
) -> None:
    """Fill `sums` and `peaks` [nodes] of the whole forest."""
    for node in range(first.size):
        _renew(node, weights, cell_of, first, last, sums, peaks)


@kernel
def touch(cells: Ints, weights: Floats, parcel: int) -> None:
    """Renew the nodes above the changed `cells` [k, 2]; `parcel` is what `TOUCHED` packed."""
    given = opened(parcel)
    cell_of, slot_of, parent = array(given.cell_of), array(given.slot_of), array(given.parent)
    first, last = array(given.first), array(given.last)
    sums, peaks = array(given.sums), array(given.peaks)
    for look in range(cells.shape[0]):
        slot = slot_of[cells[look, 0] * given.cols + cells[look, 1]]
        if slot < 0:
            continue
        node = slot >> 4
        while node >= 0:
            _renew(node, weights, cell_of, first, last, sums, peaks)
            node = parent[node]


@kernel
def peak_cell(root: int, weights: Floats, forest: Forest) -> int:
    """The most probable cell below `root`, the first in slot order among equals; -1 when all is zero."""
    peak = forest.peaks[root]
    if peak <= 0.0:
        return -1
    node = root
    while node * 16 >= forest.cell_of.size:
        for child in range(forest.first[node], forest.last[node]):
            if forest.peaks[child] == peak:
                node = child
                break
    for slot in range(node * 16, node * 16 + 16):
        if weights[forest.cell_of[slot]] == peak:
            return int(forest.cell_of[slot])
    return -1


@kernel
def find_peak(root: int, weights: Floats, cell_of: Ints, first: Ints, last: Ints, peaks: Floats) -> int:
    """`peak_cell` to be called from Python."""
    return peak_cell(root, weights, Forest(cell_of, first, last, last.reshape(-1, 1), last, peaks))
