"""Cells that are flown over for a look again and again, and of which no look ever counts.

A plan takes it that a cell is seen from where the camera should show it. Where that is not so, for whatever reason (the
ground ahead keeps the aircraft too high above a cell under a cliff, the frames from there are blurred by the turn that
leads to it), the cell stays as likely as it was, and the next plan leads there again, for ever. So what was passed so
often in vain, while looks counted elsewhere, is taken as not to be seen from the air, until a look at it counts.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

MOST_IN_VAIN, CHANCE = 5, 0.001
"""So many passes without a look are enough, unless so many would come together by chance more often than this: looks
are few where a detector sends a frame now and then."""
PATIENCE = 4
"""So many times as many it takes for a cell of which a look has counted once: it can be seen, if hardly."""
APART_S = 5.0
"""Passes sooner after one another than this, in the time of the search, are one: an aircraft on the border of two
cells is over both in turns."""


class Overlooked:
    """Which cells [rows, cols] are taken as not to be seen from the air."""

    def __init__(self, shape: tuple[int, int]) -> None:
        self.cells: NDArray[np.bool_] = np.zeros(shape, dtype=np.bool_)
        """Bool [rows, cols]."""
        self.changes = 0
        """How often `cells` has become another one."""
        self._seen = np.zeros(shape, dtype=np.bool_)  # a look at it has counted
        self._looks = 0
        self._shown = self._in_vain = 0  # passes that were followed by a look, and that were not
        self._passes: dict[tuple[int, int], tuple[int, float, int]] = {}
        """Of cells without a look since: passes in vain, when the last pass was, how many looks had counted by then."""

    def passed(self, cells: NDArray[np.int64], now: float) -> int:
        """The camera should have shown these cells, int [k, 2], at `now`, in seconds; how many are given up by that.

        A pass is in vain when no look at the cell has counted by the next one, and some look has elsewhere: a detector
        that sees nothing anywhere is told of in another way.
        """
        given_up = 0
        for row, col in cells.tolist():
            in_vain, last, looks = self._passes.get((row, col), (-1, -np.inf, -1))
            if self.cells[row, col] or now - last < APART_S or looks == self._looks:
                continue
            self._passes[row, col] = (in_vain + 1, now, self._looks)
            self._in_vain += in_vain >= 0
            if in_vain + 1 >= self._most() * (PATIENCE if self._seen[row, col] else 1):
                self.cells[row, col] = True
                given_up += 1
        self.changes += given_up > 0
        return given_up

    def looked(self, cells: NDArray[np.int64]) -> int:
        """Looks at these cells, int [k, 2], have counted; how many of them had been given up."""
        self._looks += 1
        for row, col in cells.tolist():
            self._shown += self._passes.pop((row, col), None) is not None
        rows, cols = cells[:, 0], cells[:, 1]
        self._seen[rows, cols] = True
        taken_up = int(np.count_nonzero(self.cells[rows, cols]))
        self.cells[rows, cols] = False
        self.changes += taken_up > 0
        return taken_up

    def _most(self) -> int:
        share = (self._in_vain + 1) / (self._in_vain + self._shown + 2)
        return max(MOST_IN_VAIN, math.ceil(math.log(CHANCE) / math.log(share)))
