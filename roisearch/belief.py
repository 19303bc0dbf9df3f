"""Where the target may be: an exact Bayesian map that costs the field of view, not the map."""

from __future__ import annotations

import hashlib
import struct
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from roisearch.kernels.looks import (
    BAD_PROBABILITY,
    CERTAIN,
    OK,
    OUT_OF_MAP,
    apply_looks,
    sum_up,
    tree_offsets,
)

if TYPE_CHECKING:
    from roisearch.forest import Forest, ForestSums

_MAGIC = b"roisearch-belief-1\n"
_KEPT_FORESTS = 4
_TINY, _HUGE = 2.0**-500, 2.0**500


class Belief:
    """The probability of each cell, and of 'not in the area at all'.

    A look multiplies the odds of the looked-at cell by p_tp / (1 - p_tn) on a hit and by (1 - p_tp) / p_tn
    on a miss (Bayes' rule for one static target, the paper's section 'Belief Update'), and of nothing else.
    So the weights are kept unnormalised beside their total, and an observation of k cells costs O(k log
    cells).

    Args:
        prior: float [rows, cols], finite, not negative; scaled so that the cells hold 1 - outside together.
        searchable: bool [rows, cols]; where False, the target cannot be and the prior counts as zero.
        outside: probability that the target is not in the area, 0 <= outside < 1.

    Attributes:
        hits: how many hits it has taken in; planners compare it to know that the picture has changed.

    Raises:
        ValueError: when the prior is not such an array, or holds no mass where the target can be.
    """

    def __init__(
        self, prior: ArrayLike, *, searchable: ArrayLike | None = None, outside: float = 0.0
    ) -> None:
        weights = np.array(prior, dtype=np.float64, order="C")
        if weights.ndim != 2 or weights.size == 0:
            raise ValueError(f"the prior must be a map of rows and columns, not of shape {weights.shape}")
        if not np.isfinite(weights).all() or (weights < 0.0).any():
            raise ValueError("the prior must be finite and not negative in every cell")
        if searchable is not None:
            mask = np.asarray(searchable, dtype=bool)
            if mask.shape != weights.shape:
                raise ValueError(f"searchable has the shape {mask.shape}, the prior {weights.shape}")
            weights[~mask] = 0.0
        if not 0.0 <= outside < 1.0:
            raise ValueError(f"outside must be at least 0 and below 1, not {outside}")
        peak = float(weights.max())
        if peak <= 0.0:
            raise ValueError("the prior holds no probability where the target can be")
        weights /= peak  # so that no sum overflows
        weights *= (1.0 - outside) / float(weights.sum())
        self._shape: tuple[int, int] = (weights.shape[0], weights.shape[1])
        self._take(weights.ravel(), float(outside))

    def _take(self, weights: NDArray[np.float64], outside: float) -> None:
        self._weights = weights
        self._first = weights.copy()  # never written: all copies of this belief share it
        self._rescaled = 1.0  # what the weights were multiplied with since
        self._tally = np.zeros((weights.size, 2), dtype=np.int16)
        self._outside = outside
        self._offsets = tree_offsets(weights.size)
        self._sums = np.empty(int(self._offsets[-1]))
        sum_up(weights, self._sums, self._offsets)
        self._forests: list[ForestSums] = []
        self.hits = 0

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of the map."""
        return self._shape

    @property
    def outside(self) -> float:
        """The probability that the target is not in the area."""
        return self._outside / self.total

    @property
    def weights(self) -> NDArray[np.float64]:
        """The unnormalised weights of the cells, row by row, [rows * cols]; to be read, never written."""
        return self._weights

    @property
    def total(self) -> float:
        """What the weights have to be divided by: the sum of all of them and of the weight outside."""
        return float(self._sums[-1]) + self._outside

    def probability(self) -> NDArray[np.float64]:
        """The probability of each cell, a new array [rows, cols]; with `outside` it sums to one."""
        return (self._weights / self.total).reshape(self._shape)

    def mass_at(self, cells: ArrayLike) -> NDArray[np.float64]:
        """The probability of each of `cells`, int [k, 2]: float [k].

        Raises:
            ValueError: when a cell is not on the map.
        """
        at = np.asarray(cells, dtype=np.int64).reshape(-1, 2)
        if ((at < 0) | (at >= np.array(self._shape))).any():
            raise ValueError(f"a cell is outside the map of {self._shape[0]} x {self._shape[1]} cells")
        mass: NDArray[np.float64] = self._weights[at[:, 0] * self._shape[1] + at[:, 1]] / self.total
        return mass

    def contradicted(self, cells: NDArray[np.int64]) -> NDArray[np.int64]:
        """How many hits at each of `cells` [k], flat indices, the misses at the same cell outweigh, int [k].

        None while the cell is more probable, beside the others, than before all looks at it.
        """
        outweighed = self._weights[cells] <= self._first[cells] * (self._rescaled * (1.0 + 1e-9))
        return np.where(outweighed, self._tally[cells].min(axis=1), 0).astype(np.int64)

    def entropy(self) -> float:
        """How uncertain the belief is, in bits, 'not in the area' being one more place."""
        p = self._weights[self._weights > 0.0] / self.total
        out = self.outside
        return float(-(p * np.log2(p)).sum() - (out * np.log2(out) if out > 0.0 else 0.0)) + 0.0

    def observe(self, cells: ArrayLike, hits: ArrayLike, p_tp: ArrayLike, p_tn: ArrayLike) -> None:
        """Take in one look at each of `cells`.

        Args:
            cells: int [k, 2], row and column; a cell given twice was looked at twice.
            hits: bool [k] (or one for all): whether the detector reported the target there.
            p_tp: P(hit | target there), a number or float [k].
            p_tn: P(no hit | target not there), a number or float [k], above 0.

        Raises:
            ValueError: when a cell is not on the map, a probability is not one, or no target anywhere can
                explain the observation. The belief is then as it was.
        """
        at = np.array(cells, dtype=np.int64, order="C")  # a copy: kernels are compiled for writable arrays
        if at.size == 0:
            return
        if at.ndim != 2 or at.shape[1] != 2:
            raise ValueError(f"cells must be rows and columns, [k, 2], not of shape {at.shape}")
        k = at.shape[0]
        hit = _flags(hits, k)
        tp = _numbers(p_tp, k, "p_tp")
        tn = _numbers(p_tn, k, "p_tn")
        status, number = apply_looks(
            self._weights,
            self._sums,
            self._offsets,
            self._tally,
            self._outside,
            self._shape[1],
            at,
            hit,
            tp,
            tn,
        )
        if status != OK:
            self._explain(status, number, at, hit, tp, tn)
            return
        self.hits += number
        for kept in self._forests:
            kept.touch(at, self._weights)
        if not _TINY < self._sums[-1] + self._outside < _HUGE:
            self._rescale()

    def _explain(
        self,
        status: int,
        look: int,
        cells: NDArray[np.int64],
        hits: NDArray[np.bool_],
        p_tp: NDArray[np.float64],
        p_tn: NDArray[np.float64],
    ) -> None:
        """Raise for an observation that cannot be; a certain one is taken in another way."""
        if status == CERTAIN:
            self._observe_certain(
                cells, *(np.broadcast_to(array, len(cells)) for array in (hits, p_tp, p_tn))
            )
        elif status == OUT_OF_MAP:
            rows, cols = self._shape
            where = f"({cells[look, 0]}, {cells[look, 1]})"
            raise ValueError(f"the cell {where} is outside the map of {rows} x {cols} cells")
        elif status == BAD_PROBABILITY:
            tp, tn = p_tp[look % p_tp.size], p_tn[look % p_tn.size]
            raise ValueError(f"p_tp must be from 0 to 1 and p_tn above 0 up to 1, not {tp} and {tn}")
        else:
            raise ValueError("no target anywhere could explain this observation")

    def _observe_certain(
        self,
        cells: NDArray[np.int64],
        hits: NDArray[Any],
        p_tp: NDArray[Any],
        p_tn: NDArray[Any],
    ) -> None:
        """A hit of a detector without false alarms: the target is in that cell, so it is nowhere else."""
        sure = hits & (p_tn >= 1.0)
        there = np.unique(cells[sure], axis=0)
        after = self.copy()
        after.observe(cells, hits, p_tp, np.where(sure, 0.5, p_tn))
        if len(there) > 1 or float(after.mass_at(there)[0]) <= 0.0:
            raise ValueError("no target anywhere could explain this observation")
        self._weights[:] = 0.0
        self._weights[int(there[0, 0]) * self._shape[1] + int(there[0, 1])] = 1.0
        self._outside = 0.0
        self.hits = after.hits
        self._renew()

    def _rescale(self) -> None:
        """Multiply all weights by a power of two (exact) before they run out of exponent."""
        factor = 2.0 ** -round(float(np.log2(self.total)))
        self._weights *= factor
        self._rescaled *= factor
        self._outside *= factor
        self._renew()

    def _renew(self) -> None:
        sum_up(self._weights, self._sums, self._offsets)
        for forest in self._forests:
            forest.grow(self._weights)

    def sums_of(self, forest: Forest) -> ForestSums:
        """Sum and peak of each region of `forest`, from now on kept up to date by every observation."""
        for kept in self._forests:
            if kept.forest is forest:
                return kept
        kept = forest.sums(self._weights)
        self._forests = [kept, *self._forests[: _KEPT_FORESTS - 1]]
        return kept

    def copy(self) -> Belief:
        """An independent belief in the same state."""
        twin = Belief.__new__(Belief)
        twin._shape = self._shape
        twin._weights = self._weights.copy()
        twin._first, twin._rescaled = self._first, self._rescaled
        twin._tally = self._tally.copy()
        twin._outside = self._outside
        twin._offsets = self._offsets
        twin._sums = self._sums.copy()
        twin._forests = [kept.copy() for kept in self._forests]
        twin.hits = self.hits
        return twin

    def to_bytes(self) -> bytes:
        """The whole state, bit for bit, for `from_bytes`; the same on every machine."""
        head = struct.pack("<qqd", *self._shape, self._outside)
        return _MAGIC + head + self._weights.astype("<f8", copy=False).tobytes()

    @classmethod
    def from_bytes(cls, data: bytes) -> Belief:
        """The belief that `to_bytes` wrote.

        Raises:
            ValueError: when `data` is not such a belief, whole.
        """
        start = len(_MAGIC) + struct.calcsize("<qqd")
        if len(data) < start or not data.startswith(_MAGIC):
            raise ValueError("these bytes are not a belief of this version")
        rows, cols, outside = struct.unpack_from("<qqd", data, len(_MAGIC))
        if rows < 1 or cols < 1 or len(data) - start != rows * cols * 8:
            raise ValueError("the bytes of the belief are cut short or damaged")
        belief = cls.__new__(cls)
        belief._shape = (rows, cols)
        belief._take(np.frombuffer(data, dtype="<f8", offset=start).astype(np.float64), outside)
        return belief

    def digest(self) -> str:
        """A fingerprint of the state, bit for bit: equal digests, equal beliefs (SHA-256, hexadecimal)."""
        return hashlib.sha256(self.to_bytes()).hexdigest()


_YES_NO = (np.zeros(1, dtype=np.bool_), np.ones(1, dtype=np.bool_))
_KNOWN: dict[float, NDArray[np.float64]] = {}


def _flags(value: ArrayLike, k: int) -> NDArray[np.bool_]:
    """`value` as bool [k], or [1] for all looks alike."""
    if isinstance(value, bool):
        return _YES_NO[value]
    array = np.array(value, dtype=np.bool_, order="C", ndmin=1)
    if array.shape not in ((k,), (1,)):
        raise ValueError(f"hits must be one for each of the {k} cells, not of shape {array.shape}")
    return array


def _numbers(value: ArrayLike, k: int, name: str) -> NDArray[np.float64]:
    """`value` as float [k], or [1] for all looks alike; a plain number is converted once and remembered."""
    if isinstance(value, float):
        if value not in _KNOWN:
            if len(_KNOWN) >= 256:
                _KNOWN.clear()
            _KNOWN[value] = np.array([value])
        return _KNOWN[value]
    array = np.array(value, dtype=np.float64, order="C", ndmin=1)
    if array.shape not in ((k,), (1,)):
        raise ValueError(
            f"{name} must be one number or one for each of the {k} cells, not of shape {array.shape}"
        )
    return array
