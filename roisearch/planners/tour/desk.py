"""The desk on which a tour lies: looks are put on it, taken off, and flown."""

from __future__ import annotations

import time

import numpy as np
from numpy.typing import NDArray

from roisearch.kernels.records import Ints
from roisearch.motion import Motion
from roisearch.planners.tour.anneal import anneal
from roisearch.planners.tour.landmarks import NO_LANDMARKS
from roisearch.planners.tour.starts import PLAIN, by_rule, swept
from roisearch.planners.tour.tour import Prices, Tour, cost_of, insert_best, settle

MOST_LOOKS = 3
"""Looks at one cell that are planned ahead: with p_tp = 0.9 a fourth is worth a thousandth of the first."""


def prices_of(
    motion: Motion,
    allowed: NDArray[np.uint8],
    cols: int,
    is_open: bool,
    heights: NDArray[np.float64] | None = None,
    far: NDArray[np.int32] = NO_LANDMARKS,
) -> Prices:
    """What steps and corners cost by `motion`: a corner, what it takes beside the straight line at full speed.

    `heights` are those at which the cells are flown over, float [cells]; None: flat ground. `far`: see `Prices`.
    """
    pace = motion.pace
    lengths = [pace.diagonal_m if d % 2 else pace.straight_m for d in range(8)]
    steps = np.array([length / speed for length, speed in zip(lengths, pace.cruise, strict=True)])
    turned = np.array([motion.corner_seconds(degrees) for degrees in (45, 90, 135, 180)])
    corner = np.interp(np.arange(9) / 2.0, np.arange(5), np.concatenate([[0.0], turned]))
    return Prices(
        axis=0.5 * (steps[:4] + steps[4:]),  # forth and back: a stretch may be turned round
        corner=corner,
        jump=float(corner[2]),
        rest=np.zeros(1),
        allowed=allowed,
        cols=cols,
        is_open=is_open,
        diagonal=motion.diagonal,
        climb=motion.climb(heights),
        far=far,
    )


class Desk:
    """A tour of at most `most` looks on a map of `cells`."""

    def __init__(self, most: int, cells: int, prices: Prices) -> None:
        self.prices = prices
        self._most = most
        ints, floats = (
            (np.zeros(most + 3, dtype=np.int64) for _ in range(5)),
            (np.zeros(most + 3) for _ in range(5)),
        )
        row, col, place, order, bearing = ints
        worth, bend, time, mass, moment = floats
        flat = prices.climb.heights.size == 0
        back = (time, moment) if flat else (np.zeros(most + 3), np.zeros(most + 3))
        links = np.full(most + 3, -1, dtype=np.int32), np.full(cells, -1, dtype=np.int32)
        self.tour = Tour(
            np.zeros(2, dtype=np.int64),
            row,
            col,
            worth,
            place,
            *links,
            order,
            bearing,
            bend,
            time,
            mass,
            moment,
            *back,
        )
        self._free = list(range(most, 0, -1))
        self.lawnmowers: list[Ints] = []
        """Of the orders that were tried last, those of lawnmowers over everything, the best first."""
        self._room = np.zeros((2, most + 3), dtype=np.int64)
        self._pieces = np.zeros((4, 2), dtype=np.int64)

    @property
    def size(self) -> int:
        """How many looks are planned."""
        return int(self.tour.size[0])

    @property
    def space(self) -> int:
        """How many more could be."""
        return len(self._free)

    @property
    def worth(self) -> float:
        """What the planned looks are worth together."""
        return float(self.tour.worth[self.tour.order[1 : self.size + 1]].sum())

    @property
    def cost(self) -> float:
        """The expected seconds of the tour, times the mass; see `cost_of`."""
        return cost_of(self.tour, self.prices)

    def cells(self) -> Ints:
        """The cells of the looks in order, flat, int [size]."""
        nodes = self.tour.order[1 : self.size + 1]
        return self.tour.row[nodes] * self.prices.cols + self.tour.col[nodes]

    def order(self) -> Ints:
        """The nodes in order, int [size]."""
        return self.tour.order[1 : self.size + 1].copy()

    def stand(self, cell: tuple[int, int], direction: int) -> None:
        """Begin the tour at `cell`, flown over in one of eight directions."""
        self.tour.row[0], self.tour.col[0] = cell
        self.tour.size[1] = 2 * direction

    def settle(self) -> None:
        """Reckon the whole tour anew."""
        settle(self.tour, self.prices, 0, self.size)

    def clear(self) -> None:
        """Take all looks off."""
        for place in range(self.size, 0, -1):
            self._release(int(self.tour.order[place]))
        self.tour.size[0] = 0

    def append(self, cell: int, worth: float) -> None:
        """Put a look at the end; the tour must be settled after."""
        node = self._take(cell, worth)
        self.tour.size[0] += 1
        self.tour.order[self.size] = node
        self.tour.place[node] = self.size

    def insert(self, cell: int, worth: float) -> int:
        """Put a look where it costs least; its position."""
        return insert_best(self._take(cell, worth), self._pieces, self.tour, self.prices)

    def remove(self, place: int) -> None:
        """Take a look off; the tour must be settled after."""
        order, size = self.tour.order, self.size
        self._release(int(order[place]))
        order[place:size] = order[place + 1 : size + 1]
        self.tour.size[0] = size - 1
        nodes = order[place:size]
        self.tour.place[nodes] = np.arange(place, size)

    def looks_at(self, cell: int) -> list[int]:
        """The nodes of the looks at `cell`, in the order of the tour."""
        found, node = [], int(self.tour.first[cell])
        while node >= 0:
            found.append(node)
            node = int(self.tour.next[node])
        return sorted(found, key=lambda node: int(self.tour.place[node]))

    def arrange(self, deadline: float) -> list[Ints]:
        """Put the looks in the best order that a start gives; all orders tried, of nodes, the best first."""
        size = self.size
        nodes = self.order()
        cells, worth = self.cells(), self.tour.worth[nodes]
        at = int(self.tour.row[0] * self.prices.cols + self.tour.col[0])
        tried = [(self.put(nodes), 0, nodes)]
        for order in swept(cells, worth, self.prices.cols, at):
            if time.perf_counter() > deadline:
                break
            tried.append((self.put(nodes[order]), len(tried), nodes[order]))
        if time.perf_counter() < deadline:
            self.tour.order[1 : size + 1] = nodes
            by_rule(np.zeros(size), self._room[0], self.tour, self.prices)
            ruled = self.order()
            tried.append((self.put(ruled), len(tried), ruled))
        self.lawnmowers = [order for *_, order in sorted(tried[1 : 1 + PLAIN], key=lambda each: each[:2])]
        tried.sort(key=lambda each: each[:2])
        self.put(tried[0][2])
        return [order for _, _, order in tried]

    def anneal_best(
        self, starts: list[Ints], proposals: int, heat: tuple[float, float], random: NDArray[np.uint64]
    ) -> None:
        """Anneal the whole tour from each of `starts`, orders of nodes, and keep the best."""
        annealed: list[tuple[float, int, Ints]] = []
        for start in starts:
            self.put(start)
            self.anneal(1, self.size, proposals, heat, random)
            annealed.append((self.cost, len(annealed), self.order()))
        self.put(min(annealed, key=lambda each: each[:2])[2])

    def put(self, order: Ints) -> float:
        """Put the looks in an order of nodes; what it costs."""
        self.tour.order[1 : self.size + 1] = order
        self.settle()
        return self.cost

    def anneal(
        self, first: int, last: int, proposals: int, heat: tuple[float, float], random: NDArray[np.uint64]
    ) -> float:
        """A spell of annealing between two positions; what it gained."""
        return anneal(
            (first, last), proposals, heat, random, self._room, self._pieces, self.tour, self.prices
        )

    def _take(self, cell: int, worth: float) -> int:
        node = self._free.pop()
        tour = self.tour
        tour.row[node], tour.col[node] = divmod(cell, self.prices.cols)
        tour.worth[node] = worth
        tour.next[node] = tour.first[cell]
        tour.first[cell] = node
        return node

    def _release(self, node: int) -> None:
        tour = self.tour
        cell = int(tour.row[node] * self.prices.cols + tour.col[node])
        if tour.first[cell] == node:
            tour.first[cell] = tour.next[node]
        else:
            before = int(tour.first[cell])
            while tour.next[before] != node:
                before = int(tour.next[before])
            tour.next[before] = tour.next[node]
        self._free.append(node)
