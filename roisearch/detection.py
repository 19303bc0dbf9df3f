"""How well the ground has been searched: cumulative probability of detection, cell by cell and overall."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


class DetectionRecord:
    """Keeps, for each cell, the probability that all looks so far would have missed a target there.

    POD of a cell is 1 - prod(1 - p_tp) over its looks; POS, the probability of success so far, is the sum of
    POA times POD over the map, with POA the prior (Koopman 1980; National SAR Manual). A look counts whatever
    it reported, since POS is about the target being found, not about false alarms.
    """

    def __init__(self, prior: NDArray[np.float64], outside: float = 0.0) -> None:
        """`prior`: float [rows, cols], any positive scale; `outside`: probability mass not on the map."""
        self._poa = prior * ((1.0 - outside) / prior.sum())
        self._missed = np.ones_like(self._poa)
        self._left = 1.0 - outside
        self.looks = 0

    def look(self, cells: NDArray[np.int64], p_tp: NDArray[np.float64]) -> None:
        """Record one look at each of `cells` (int [k, 2], no cell twice) with detection probability [k]."""
        rows, cols = cells[:, 0], cells[:, 1]
        before = self._poa[rows, cols] * self._missed[rows, cols]
        self._missed[rows, cols] *= 1.0 - p_tp
        self._left -= float((before * p_tp).sum())
        self.looks += len(cells)

    def pod(self) -> NDArray[np.float64]:
        """Cumulative probability of detection of each cell, float [rows, cols]."""
        return np.asarray(1.0 - self._missed)

    def undetected(self) -> NDArray[np.float64]:
        """The prior mass of each cell that no look so far would have detected, float [rows, cols]."""
        return np.asarray(self._poa * self._missed)

    @property
    def pos(self) -> float:
        """Probability that the target would have been detected by now."""
        total = float(self._poa.sum())
        return min(1.0, max(0.0, total - self._left))

    @property
    def searched(self) -> float:
        """POS given that the target is on the map at all."""
        return self.pos / float(self._poa.sum())
