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
