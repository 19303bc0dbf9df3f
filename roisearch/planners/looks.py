"""What a planner that keeps a map of its own has to know about the looks that a belief has taken in."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


class Changes:
    """The cells of a belief that observations have changed since the last look at this list."""

    def __init__(self, forest: object) -> None:
        self.forest = forest
        self.cells: list[NDArray[np.int64]] = []
        self.all = True

    def touch(self, cells: NDArray[np.int64], weights: NDArray[np.float64]) -> None:
        """Note that `cells` [k, 2] were looked at."""
        if len(self.cells) >= 4096:
            self.all = True
        if not self.all:
            self.cells.append(cells.copy())

    def grow(self, weights: NDArray[np.float64]) -> None:
        """Note that every cell has changed."""
        self.all = True

    def copy(self) -> Changes:
        """For a copied belief: everything is new to whoever reads it."""
        return Changes(self.forest)

    def take(self) -> tuple[bool, list[NDArray[np.int64]]]:
        """Whether everything may have changed, and the cells that have; the list starts again."""
        everything, cells = self.all, self.cells
        self.all, self.cells = False, []
        return everything, cells


class Watch:
    """Asks a belief to keep `Changes`, as it keeps the sums of a forest."""

    def sums(self, weights: NDArray[np.float64]) -> Changes:
        """The list for one belief."""
        return Changes(self)


class Evidence:
    """How the looks at each cell contradict each other.

    A false alarm and the miss at the next look leave a cell where it was before both, and it is as much worth a look
    as its neighbours. But they lie in the drone's way, while coming back for a single cell takes two steps or more.
    So a planner may count such a cell for less. A cell whose hits outweigh its misses counts whole, and in the belief
    every cell does.

    Args:
        weights: float [cells], the belief's, before the looks.
    """

    def __init__(self, weights: NDArray[np.float64]) -> None:
        self._first = weights.copy()
        self._last = weights.copy()
        self._hits = np.zeros(weights.size, dtype=np.int32)
        self._misses = np.zeros(weights.size, dtype=np.int32)

    def note(self, cells: NDArray[np.int64], weights: NDArray[np.float64]) -> None:
        """Note the belief's new `weights` [k] of `cells` [k], flat and all different."""
        self._hits[cells] += weights > self._last[cells]
        self._misses[cells] += weights < self._last[cells]
        self._last[cells] = weights

    def discount(self, cells: NDArray[np.int64], share: float) -> NDArray[np.float64]:
        """What to multiply the weights of `cells` [k] with: `share` for each hit and a miss against it."""
        outweighed = self._last[cells] <= self._first[cells] * (1.0 + 1e-9)
        pairs = np.minimum(self._hits[cells], self._misses[cells])
        return np.power(share, np.where(outweighed, pairs, 0))
