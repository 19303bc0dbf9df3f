"""Ways over the ground for planners that fly to eight neighbours, or to four where the motion has no more."""

from __future__ import annotations

import heapq
import itertools
import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from roisearch.directions import STEPS, moves_allowed
from roisearch.motion import Motion

MOST_KEPT = 4096
"""Ways that are kept; then they are looked for anew."""


class Ways:
    """The moves that the ground allows, and ways from cell to cell; cells are flat, row * cols + col.

    Args:
        flyable: bool [rows, cols].
        diagonal: whether there are moves to eight neighbours.
    """

    def __init__(self, flyable: NDArray[np.bool_], diagonal: bool) -> None:
        self.cols = int(flyable.shape[1])
        self.diagonal = diagonal
        self.is_open = bool(flyable.all())
        self.allowed: NDArray[np.uint8] = np.ascontiguousarray(moves_allowed(flyable, diagonal).ravel())
        self._found: dict[tuple[int, int], list[int]] = {}  # ways around, which are asked for again and again

    def move(self, direction: int) -> int:
        """What a step in one of eight directions adds to a cell's number."""
        return STEPS[direction][0] * self.cols + STEPS[direction][1]

    def way(self, here: int, there: int, heading: int = 0) -> list[int]:
        """The cells to enter from `here` to `there`: straight if nothing is between, else around it.

        On the straight way one diagonal and one straight part follow each other, that first which turns less
        from the direction `heading`. Empty when it is there already, or cannot get there.
        """
        down, right = there // self.cols - here // self.cols, there % self.cols - here % self.cols
        row, col = int(np.sign(down)), int(np.sign(right))
        both = min(abs(down), abs(right)) if self.diagonal else 0
        parts = [((row, col), both), ((row, 0), abs(down) - both), ((0, col), abs(right) - both)]
        parts = [(step, count) for step, count in parts if count]
        if len(parts) == 2 and _turn(heading, parts[1][0]) < _turn(heading, parts[0][0]):
            parts.reverse()
        for attempt in (parts, parts[::-1]):
            found = self._straight(here, attempt)
            if found is not None:
                return found
        return self._around(here, there)

    def _straight(self, here: int, parts: list[tuple[tuple[int, int], int]]) -> list[int] | None:
        path = []
        for step, count in parts:
            bit, move = STEPS.index(step), step[0] * self.cols + step[1]
            for _ in range(count):
                if not self.allowed[here] >> bit & 1:
                    return None
                here += move
                path.append(here)
        return path

    def _around(self, here: int, there: int) -> list[int]:
        """The shortest way, as it was found before or is now."""
        if (here, there) not in self._found:
            if len(self._found) >= MOST_KEPT:
                self._found.clear()
            self._found[here, there] = self._search(here, there)
        return list(self._found[here, there])

    def _search(self, here: int, there: int) -> list[int]:
        """The shortest way, A* with the octile distance as the estimate."""
        goal_row, goal_col = divmod(there, self.cols)

        def left(cell: int) -> float:
            down, right = abs(cell // self.cols - goal_row), abs(cell % self.cols - goal_col)
            if not self.diagonal:
                return float(down + right)
            return max(down, right) + (math.sqrt(2.0) - 1.0) * min(down, right)

        best, came = {here: 0.0}, {here: here}
        queue = [(left(here), 0, here)]
        number = itertools.count(1)
        while queue:
            _, _, cell = heapq.heappop(queue)
            if cell == there:
                path = []
                while cell != here:
                    path.append(cell)
                    cell = came[cell]
                return path[::-1]
            for bit, (down, right) in enumerate(STEPS):
                if not self.allowed[cell] >> bit & 1:
                    continue
                near = cell + down * self.cols + right
                far = best[cell] + (math.sqrt(2.0) if bit % 2 else 1.0)
                if far < best.get(near, math.inf) - 1e-9:
                    best[near], came[near] = far, cell
                    heapq.heappush(queue, (far + left(near), -next(number), near))
        return []

    def joined(self, here: int, order: NDArray[np.int64], heading: int = 0) -> NDArray[np.int64]:
        """All cells entered from `here` through those of `order`, in order."""
        cells = np.concatenate([[here], order])
        down, right = np.abs(np.diff(np.stack(np.divmod(cells, self.cols)), axis=1))
        near = (np.maximum(down, right) if self.diagonal else down + right) == 1
        if not self.is_open and self.diagonal:
            near &= (down + right) == 1  # a diagonal move may be one that is not allowed
        pieces, begin = [], 0
        for gap in np.flatnonzero(~near).tolist():
            pieces.append(order[begin:gap])
            pieces.append(np.array(self.way(int(cells[gap]), int(cells[gap + 1])), dtype=np.int64))
            begin = gap + 1
        pieces.append(order[begin:])
        return np.concatenate(pieces)


def soonest(
    orders: Sequence[NDArray[np.int64]],
    worth: NDArray[np.float64],
    ways: Ways,
    motion: Motion,
    at: int,
    heading: int = 0,
    heights: NDArray[np.float64] | None = None,
) -> NDArray[np.int64]:
    """That of `orders`, flat cells to enter from `at`, which flies over `worth` [cells] soonest on average.

    What an order does not lead over is found at its end at the earliest. `heights` [cells] are those at which the
    cells are flown over; None: flat ground.
    """

    total = float(worth.sum())

    def expected(order: NDArray[np.int64]) -> float:
        path = ways.joined(at, order, heading)
        times = motion.seconds(at, path, heading, ways.cols, heights)
        if not path.size:
            return 0.0
        cells, first = np.unique(path, return_index=True)
        return float(worth[cells] @ times[first]) + (total - float(worth[cells].sum())) * float(times[-1])

    return min(orders, key=expected)


def _turn(heading: int, step: tuple[int, int]) -> int:
    apart = (STEPS.index(step) - heading) % 8
    return min(apart, 8 - apart)
