"""What a step in each hill is worth at each time: a small linear program, whose duals price the looks.

The program sends one searcher through hills and blocks of time. It stays in a hill for a block, or travels to
another for as many steps as lie between their cores; where it stays it makes one look a step, of the looks that the
hill has, which are put together in bins of like worth. It is a coarse picture and need not be exact:
`roisearch.bounds.travelling` gets a bound from any prices, and a good one from good prices.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage, optimize, sparse

from roisearch.kernels.records import Floats, Ints

_BIN = 1.3  # ratio of the worths of two bins
_BINS = 24


@dataclass(frozen=True, eq=False)
class Hills:
    """The map as the linear program sees it.

    Attributes:
        count: how many hills there are.
        steps, block: length of the search, and of a block of time.
        arrival: int [count], steps from the start to each hill's core.
        between: int [count, count], steps between cores.
        worth, looks: float [count, bins], mean worth of the looks of a bin, and how many it has.
    """

    count: int
    steps: int
    block: int
    arrival: Ints
    between: Ints
    worth: Floats
    looks: Floats


def hills_of(
    worth: Floats, labels: Ints, start: tuple[int, int], core: float, steps: int, block: int
) -> Hills:
    """The hills of a map; worth: float [rows, cols, looks]; labels: int [rows, cols], 0 .. count - 1.

    core: the part of a hill's highest worth from which on a cell belongs to its core.
    """
    count = int(labels.max()) + 1
    first = worth[:, :, 0]
    cores = [
        (labels == hill) & (first >= core * first[labels == hill].max(initial=0.0)) for hill in range(count)
    ]
    away = [ndimage.distance_transform_cdt(~there, metric="taxicab") for there in cores]
    between = np.array(
        [[int(away[a][cores[b]].min()) for b in range(count)] for a in range(count)], dtype=np.int64
    )
    arrival = np.array([int(away[hill][start]) for hill in range(count)], dtype=np.int64)
    floor = first.max() / _BIN ** (_BINS - 1)
    means, numbers = np.zeros((count, _BINS)), np.zeros((count, _BINS))
    for hill in range(count):
        values = worth[labels == hill].ravel()
        values = values[values > floor]
        bins = np.floor(np.log(first.max() / values) / np.log(_BIN)).astype(np.int64).clip(0, _BINS - 1)
        numbers[hill] = np.bincount(bins, minlength=_BINS)
        means[hill] = np.bincount(bins, weights=values, minlength=_BINS) / np.maximum(numbers[hill], 1.0)
    return Hills(count, steps, block, arrival, between, means, numbers)


@dataclass(frozen=True, eq=False)
class Plan:
    """What the linear program says.

    Attributes:
        step_worth: float [count, blocks], what one more step in a hill in a block would be worth (the duals).
        presence: float [count, blocks], the part of a block that the searcher is in a hill.
    """

    step_worth: Floats
    presence: Floats


class Schedule:
    """The linear program of some hills, to be solved with the searcher tied to hills in some blocks."""

    def __init__(self, hills: Hills) -> None:
        self.hills = hills
        count, block = hills.count, hills.block
        self.blocks = -(-hills.steps // block)
        arcs: list[tuple[int, int, int, int, float, int, int]] = []
        # from node, to node, hill that gets the steps, block of these, steps, first and last block it spans
        source, sink = count * (self.blocks + 1), count * (self.blocks + 1) + 1
        for hill in range(count):
            late, rest = divmod(int(hills.arrival[hill]), block)
            if late < self.blocks:
                arcs.append((source, self._node(hill, late + 1), hill, late, float(block - rest), 0, late))
            for b in range(self.blocks):
                arcs.append((self._node(hill, b), self._node(hill, b + 1), hill, b, float(block), b, b))
                for other in range(count):
                    if other == hill:
                        continue
                    far, rest = divmod(int(hills.between[hill, other]), block)
                    if b + far < self.blocks:
                        to = self._node(other, b + far + 1)
                        for there, at in ((hill, b), (other, b + far)):
                            arcs.append((self._node(hill, b), to, there, at, float(block - rest), b, b + far))
            arcs.append(
                (self._node(hill, self.blocks), sink, hill, self.blocks, 0.0, self.blocks, self.blocks)
            )
        if not any(arc[0] == source for arc in arcs):
            arcs.append((source, sink, 0, self.blocks, 0.0, 0, 0))
        self._arcs = np.array([arc[:4] + arc[5:] for arc in arcs], dtype=np.int64)
        self._steps = np.array([arc[4] for arc in arcs])
        self._build(source, sink)

    def _node(self, hill: int, block: int) -> int:
        return hill * (self.blocks + 1) + block

    def _build(self, source: int, sink: int) -> None:
        """Columns: arcs, then looks [hill, bin, block]. Rows: flow of a node; looks against steps; against the bin."""
        hills, blocks = self.hills, self.blocks
        arcs, bins = len(self._arcs), hills.worth.shape[1]
        looks = hills.count * bins * blocks
        hill, bin_, b = (grid.ravel() for grid in np.indices((hills.count, bins, blocks)))
        middle = np.maximum(hills.steps - (b + 0.5) * hills.block, 0.0)
        self._cost = np.concatenate([np.zeros(arcs), -hills.worth[hill, bin_] * middle])
        ones, at = np.ones(arcs), np.arange(arcs)
        out = sparse.coo_array((ones, (self._arcs[:, 0], at)), shape=(sink + 1, arcs + looks))
        into = sparse.coo_array((ones, (self._arcs[:, 1], at)), shape=(sink + 1, arcs + looks))
        self._flow = (out - into).tocsr()
        self._sent = np.zeros(sink + 1)
        self._sent[source], self._sent[sink] = 1.0, -1.0
        used = self._arcs[:, 3] < blocks
        rows = hills.count * blocks
        capacity = sparse.coo_array(
            (-self._steps[used], (self._arcs[used, 2] * blocks + self._arcs[used, 3], at[used])),
            shape=(rows, arcs + looks),
        )
        made = sparse.coo_array(
            (np.ones(looks), (hill * blocks + b, arcs + np.arange(looks))), shape=(rows, arcs + looks)
        )
        once = sparse.coo_array(
            (np.ones(looks), (hill * bins + bin_, arcs + np.arange(looks))),
            shape=(hills.count * bins, arcs + looks),
        )
        self._limits = sparse.vstack([capacity + made, once]).tocsr()
        self._most = np.concatenate([np.zeros(rows), hills.looks.ravel()])
        self._rows, self._columns = rows, arcs + looks

    def solve(self, tied: dict[int, int]) -> Plan | None:
        """The best flow when the searcher is in hill `tied[block]` in each of these blocks; None if there is none."""
        hills, arcs = self.hills, len(self._arcs)
        upper = np.full(self._columns, np.inf)
        for block, hill in tied.items():
            spans = (
                (self._arcs[:, 4] <= block) & (block <= self._arcs[:, 5]) & (self._arcs[:, 3] < self.blocks)
            )
            comes = self._arcs[:, 1] // (self.blocks + 1)
            goes = self._arcs[:, 0] // (self.blocks + 1)
            upper[:arcs][spans & (comes != hill) & (goes != hill)] = 0.0
        found = optimize.linprog(
            self._cost,
            A_ub=self._limits,
            b_ub=self._most,
            A_eq=self._flow,
            b_eq=self._sent,
            bounds=np.column_stack([np.zeros(self._columns), upper]),
            method="highs-ipm",
        )
        if found.status != 0:
            return None
        duals = -found.ineqlin.marginals[: self._rows].reshape(hills.count, self.blocks)
        presence = np.zeros((hills.count, self.blocks))
        used = self._arcs[:, 3] < self.blocks
        np.add.at(
            presence,
            (self._arcs[used, 2], self._arcs[used, 3]),
            found.x[:arcs][used] * self._steps[used] / hills.block,
        )
        return Plan(duals, presence)


def look_prices(
    worth: Floats, labels: Ints, released: Ints, step_worth: Floats, block: int, steps: int
) -> Floats:
    """The price of each look, float [rows, cols, looks]: the most that it earns beyond the worth of its step.

    step_worth: float [hills, blocks], of a step in the middle of each block of `block` steps.

    Between the middles of blocks the worth of a step is taken as linear, as what a look earns is, so the most lies at a
    middle or at an end. A look counts from the node before its release on.
    """
    blocks = step_worth.shape[1]
    nodes = np.concatenate([[0.0], (np.arange(blocks) + 0.5) * block, [float(steps)]])
    price = np.zeros_like(worth)
    for hill in range(step_worth.shape[0]):
        inside = labels == hill
        step = step_worth[hill]
        at_nodes = np.concatenate([[step[0]], step, [step[-1]]])
        values, since = worth[inside], released[inside]
        highest = np.zeros_like(values)
        for i, node in enumerate(nodes):
            after = nodes[min(i + 1, len(nodes) - 1)]
            open_ = (since <= after)[:, None]
            highest = np.maximum(highest, np.where(open_, values * (steps - node) - at_nodes[i], 0.0))
        price[inside] = highest
    return price


def nearest_labels(labels: NDArray[np.int32]) -> Ints:
    """Regions without gaps: every cell gets the region nearest to it, int [rows, cols], 0 .. count - 1."""
    if not labels.any():
        return np.zeros(labels.shape, dtype=np.int64)
    where = ndimage.distance_transform_edt(labels == 0, return_distances=False, return_indices=True)
    nearest: Ints = labels[tuple(where)].astype(np.int64) - 1
    return nearest
