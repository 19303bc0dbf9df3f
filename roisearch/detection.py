"""How well the ground has been searched: cumulative probability of detection, cell by cell and overall."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from roisearch.walk import Drift, Walk


class DetectionRecord:
    """Keeps, for each cell, the probability that all looks so far would have missed a target there.

    POD of a cell is 1 - prod(1 - p_tp) over its looks; POS, the probability of success so far, is the sum of
    POA times POD over the map, with POA the prior (Koopman 1980; National SAR Manual). A look counts whatever
    it reported, since POS is about the target being found, not about false alarms.

    Of a target that walks the POD of a cell is the chance that one which is there now would have been detected before,
    wherever it was then: ground that was searched fills up again with what nobody has looked at, and its POD falls. POS
    stays what it is, the chance of having been found by now, by forward filtering (Brown 1980; Stone 1975, chapter 8).
    """

    def __init__(
        self,
        prior: NDArray[np.float64],
        outside: float = 0.0,
        *,
        walk: Walk | None = None,
        searchable: NDArray[np.bool_] | None = None,
    ) -> None:
        """`prior`: float [rows, cols], any positive scale; `outside`: probability mass not on the map; `walk`: how the
        target moves as `drift` lets time pass, over `searchable` cells, bool [rows, cols]."""
        self._poa = prior * ((1.0 - outside) / prior.sum())
        self._drifts: tuple[Drift, Drift] | None = None
        if walk is not None:
            self._poa = np.ascontiguousarray(self._poa if searchable is None else self._poa * searchable)
            ways = walk.ways((prior.shape[0], prior.shape[1]), searchable)
            self._drifts = Drift(ways), Drift(ways)
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

    def drift(self, seconds: float) -> None:
        """Let time pass, as `Belief.drift` does: those that were detected and those that were not walk alike."""
        if self._drifts is None:
            return
        everyone, missed = self._drifts
        ticks = everyone.wait(seconds)
        missed.wait(seconds)
        if ticks:
            left = self.undetected().ravel()
            everyone.ways.go(self._poa.ravel(), everyone.going, ticks)
            missed.ways.go(left, missed.going, ticks)
            there = self._poa > 0.0
            self._missed[there] = np.minimum(left.reshape(self._poa.shape)[there] / self._poa[there], 1.0)

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

    def parts(self, cells: NDArray[np.bool_]) -> tuple[float, float]:
        """What part of the mass on the map lies in such cells, bool [rows, cols], and what part of it would have been
        detected there by now: over all cells 1, and `searched`."""
        there, whole = float(self._poa[cells].sum()), float(self._poa.sum())
        return there / whole, (there - float(self.undetected()[cells].sum())) / whole

    @property
    def searched(self) -> float:
        """POS given that the target is on the map at all."""
        return self.pos / float(self._poa.sum())
