"""The regions of a map as trees over their cells; the shape is built once, the numbers belong to a belief."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from roisearch.kernels import forest as kernels
from roisearch.kernels.looks import FANOUT
from roisearch.walk import Ways


class Forest:
    """For each region 0 .. regions - 1 a tree over its cells, immutable; its arrays: see `kernels.forest`.

    Args:
        labels: int [rows, cols], the region of each cell, negative for none.
        regions: how many regions; one without cells is allowed.
    """

    def __init__(self, labels: NDArray[np.integer], regions: int) -> None:
        self.shape: tuple[int, int] = (labels.shape[0], labels.shape[1])
        flat = labels.ravel()
        cells = np.flatnonzero(flat >= 0)
        rows, cols = cells // self.shape[1], cells % self.shape[1]
        order = np.lexsort((_morton(rows, cols), flat[cells]))
        cells = cells[order]
        self.count: NDArray[np.int64] = np.bincount(flat[cells], minlength=regions).astype(np.int64)
        blocks = -(-self.count // FANOUT)
        starts = np.concatenate(([0], np.cumsum(blocks)))
        self.cell_of: NDArray[np.int64] = np.full(int(starts[-1]) * FANOUT, -1, dtype=np.int64)
        begin = np.concatenate(([0], np.cumsum(self.count)))
        slots = (
            np.arange(cells.size)
            - np.repeat(begin[:-1], self.count)
            + np.repeat(starts[:-1] * FANOUT, self.count)
        )
        self.cell_of[slots] = cells
        self.slot_of: NDArray[np.int64] = np.full(flat.size, -1, dtype=np.int64)
        self.slot_of[cells] = slots
        self._grow_upwards(starts, blocks)

    def _grow_upwards(self, starts: NDArray[np.int64], blocks: NDArray[np.int64]) -> None:
        """Inner nodes, level by level, each region's nodes together, until each region has one root."""
        leaves = int(starts[-1])
        inside = self.cell_of.reshape(-1, FANOUT)
        padded = np.where(inside < 0, inside[:, :1], inside)
        rows, cols = padded // self.shape[1], padded % self.shape[1]
        boxes = [np.stack([rows.min(1), rows.max(1), cols.min(1), cols.max(1)], axis=1)]
        first, last = [np.zeros(leaves, dtype=np.int64)], [np.zeros(leaves, dtype=np.int64)]
        self.root: NDArray[np.int64] = np.where(blocks == 1, starts[:-1], -1)
        total, level_start, level = leaves, starts[:-1].copy(), blocks.copy()
        while (level > 1).any():
            parents = np.where(level > 1, -(-level // FANOUT), 0)
            begin = total + np.concatenate(([0], np.cumsum(parents)))[:-1]
            below = np.concatenate(boxes)
            for region in np.flatnonzero(parents):
                lo = level_start[region] + FANOUT * np.arange(parents[region])
                hi = np.minimum(lo + FANOUT, level_start[region] + level[region])
                span = below[level_start[region] : level_start[region] + level[region]]
                at = lo - level_start[region]
                boxes.append(
                    np.stack(
                        [
                            np.minimum.reduceat(span[:, 0], at),
                            np.maximum.reduceat(span[:, 1], at),
                            np.minimum.reduceat(span[:, 2], at),
                            np.maximum.reduceat(span[:, 3], at),
                        ],
                        axis=1,
                    )
                )
                first.append(lo)
                last.append(hi)
                if parents[region] == 1:
                    self.root[region] = begin[region]
            total += int(parents.sum())
            level_start, level = begin, parents
        self.first: NDArray[np.int64] = np.concatenate(first).astype(np.int64)
        self.last: NDArray[np.int64] = np.concatenate(last).astype(np.int64)
        self.box: NDArray[np.int64] = np.ascontiguousarray(np.concatenate(boxes), dtype=np.int64)
        self.parent: NDArray[np.int64] = np.full(total, -1, dtype=np.int64)
        for node in range(leaves, total):
            self.parent[self.first[node] : self.last[node]] = node

    def begin(self, weights: NDArray[np.float64], shape: tuple[int, int]) -> ForestSums:
        """Sum and peak of every node for these weights [cells]; see `Belief.follow`."""
        fresh = ForestSums(self, np.empty(self.first.size), np.empty(self.first.size))
        fresh.renew(weights, 1.0)
        return fresh


class ForestSums:
    """Sum and peak of every node of a forest, for one belief, which keeps them up to date."""

    lasts = False

    def __init__(self, forest: Forest, sums: NDArray[np.float64], peaks: NDArray[np.float64]) -> None:
        self.subject = forest
        self.sums = sums
        self.peaks = peaks
        self._parcel = kernels.TOUCHED.pack(
            cols=forest.shape[1],
            cell_of=forest.cell_of,
            slot_of=forest.slot_of,
            first=forest.first,
            last=forest.last,
            parent=forest.parent,
            sums=sums,
            peaks=peaks,
        )

    @property
    def address(self) -> int:
        """Of what `roisearch.kernels.forest.TOUCHED` has packed."""
        return self._parcel.address

    def renew(self, weights: NDArray[np.float64], factor: float) -> None:
        """Recompute everything."""
        f = self.subject
        kernels.grow(weights, f.cell_of, f.first, f.last, self.sums, self.peaks)

    def drifted(self, weights: NDArray[np.float64], ways: Ways, ticks: int) -> None:
        """Recompute everything."""
        self.renew(weights, 1.0)

    def touch(self, cells: NDArray[np.int64], hits: NDArray[np.bool_], weights: NDArray[np.float64]) -> None:
        """Recompute what depends on `cells` [k, 2]."""
        kernels.touch(cells, weights, self._parcel.address)

    def copy(self) -> ForestSums:
        """An independent copy for a copied belief."""
        return ForestSums(self.subject, self.sums.copy(), self.peaks.copy())


def _morton(rows: NDArray[np.int64], cols: NDArray[np.int64]) -> NDArray[np.int64]:
    """The Z-order number of each cell: the bits of row and column interleaved."""
    return (_spread(rows) << 1) | _spread(cols)


def _spread(x: NDArray[np.int64]) -> NDArray[np.int64]:
    """A zero bit before each of the lower 16 bits."""
    x = (x | (x << 8)) & 0x00FF00FF
    x = (x | (x << 4)) & 0x0F0F0F0F
    x = (x | (x << 2)) & 0x33333333
    return (x | (x << 1)) & 0x55555555
