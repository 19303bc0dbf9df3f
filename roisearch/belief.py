"""Where the target may be: an exact Bayesian map that costs the field of view, not the map."""

from __future__ import annotations

import hashlib
import struct
from typing import Any, Protocol, TypeVar, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from roisearch.kernels.looks import (
    BAD_PROBABILITY,
    CERTAIN,
    OK,
    OUT_OF_MAP,
    WEIGHTS,
    apply_looks,
    sum_up,
    tree_offsets,
)
from roisearch.walk import Drift, Walk, Ways

_KEPT = 4
"""Followers that a belief keeps, beside those that last."""
_TINY, _HUGE = 2.0**-500, 2.0**500


class Follower(Protocol):
    """What is kept up to date with one belief: sums, counts, lists of changes.

    Attributes:
        subject: what it was begun from.
        lasts: whether it knows what cannot be had from the weights anew.
    """

    @property
    def subject(self) -> object: ...

    @property
    def lasts(self) -> bool: ...

    def touch(self, cells: NDArray[np.int64], hits: NDArray[np.bool_], weights: NDArray[np.float64]) -> None:
        """There were looks at `cells` [k, 2], and `weights` [cells] are those after; hits: bool [k] or [1]."""
        ...

    def renew(self, weights: NDArray[np.float64], factor: float) -> None:
        """All weights may have changed, and what was known of them before is to be multiplied by `factor`."""
        ...

    def drifted(self, weights: NDArray[np.float64], ways: Ways, ticks: int) -> None:
        """The target walked for some ticks, and `weights` [cells] are those after."""
        ...

    def copy(self) -> Follower:
        """Another one, for a copy of the belief."""
        ...


_F = TypeVar("_F", bound=Follower)
_Begun = TypeVar("_Begun", bound=Follower, covariant=True)


class Subject(Protocol[_Begun]):
    """What a belief can be asked to keep."""

    def begin(self, weights: NDArray[np.float64], shape: tuple[int, int]) -> _Begun:
        """A follower for a belief of these weights [cells] on a map of `shape`."""
        ...


class Belief:
    """The probability of each cell, and of 'not in the area at all'.

    A look multiplies the odds of the looked-at cell by p_tp / (1 - p_tn) on a hit and by (1 - p_tp) / p_tn
    on a miss (Bayes' rule, the paper's section 'Belief Update'), and of nothing else. Where a target that walks
    may have gone between looks, `drift` tells.
    So the weights are kept unnormalised beside their total, and an observation of k cells costs O(k log
    cells).

    Args:
        prior: float [rows, cols], finite, not negative; scaled so that the cells hold 1 - outside together.
        searchable: bool [rows, cols]; where False, the target cannot be and the prior counts as zero.
        outside: probability that the target is not in the area, 0 <= outside < 1.
        walk: how the target moves as `drift` lets time pass, over searchable cells only; None: it stands still.

    Attributes:
        hits: how many hits it has taken in; planners compare it to know that the picture has changed.

    Raises:
        ValueError: when the prior is not such an array, or holds no mass where the target can be.
    """

    def __init__(
        self,
        prior: ArrayLike,
        *,
        searchable: ArrayLike | None = None,
        outside: float = 0.0,
        walk: Walk | None = None,
    ) -> None:
        weights = np.array(prior, dtype=np.float64, order="C")
        if weights.ndim != 2 or weights.size == 0:
            raise ValueError(f"the prior must be a map of rows and columns, not of shape {weights.shape}")
        if not np.isfinite(weights).all() or (weights < 0.0).any():
            raise ValueError("the prior must be finite and not negative in every cell")
        mask: NDArray[np.bool_] | None = None
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
        drift = None if walk is None else Drift(walk.ways(self._shape, mask))
        self._take(weights.ravel(), float(outside), drift)

    def _take(self, weights: NDArray[np.float64], outside: float, drift: Drift | None) -> None:
        self._weights = weights
        self._outside = outside
        self._offsets = tree_offsets(weights.size)
        self._sums = np.empty(int(self._offsets[-1]))
        sum_up(weights, self._sums, self._offsets)
        self._followers: list[Follower] = []
        self._drift = drift
        self.hits = 0
        self._pack()

    def _pack(self) -> None:
        self._parcel = WEIGHTS.pack(
            weights=self._weights, sums=self._sums, offsets=self._offsets, cols=self._shape[1]
        )

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
        status, number = apply_looks(self._parcel.address, self._outside, at, hit, tp, tn)
        if status != OK:
            self._explain(status, number, at, hit, tp, tn)
            return
        self.hits += number
        for follower in self._followers:
            follower.touch(at, hit, self._weights)
        if not _TINY < self._sums[-1] + self._outside < _HUGE:
            self._rescale()

    @property
    def walks(self) -> Walk | None:
        """How the target moves; None: it stands still."""
        return None if self._drift is None else self._drift.ways.walk

    def drift(self, seconds: float) -> int:
        """Let time pass: a target that walks walks on, and one that stands still costs nothing.

        The walk is reckoned in ticks (`Walk.tick_us`), and what is left of one waits for the next call: any two ways to
        the same time, in whole microseconds, give the same weights to the last bit. The mass on the map and that
        outside stay as they are.

        Returns:
            How many ticks were reckoned; 0: no weight has changed.

        Raises:
            ValueError: when `seconds` is negative, not a number, or more than `walk.MOST_S`.
        """
        if self._drift is None:
            return 0
        ticks = self._drift.wait(seconds)
        if ticks:
            self._drift.ways.go(self._weights, self._drift.going, ticks)
            sum_up(self._weights, self._sums, self._offsets)
            for follower in self._followers:
                follower.drifted(self._weights, self._drift.ways, ticks)
        return ticks

    @property
    def since_tick_s(self) -> float:
        """Seconds that wait to be reckoned: what is told of a moment before those comes too late for this belief."""
        return 0.0 if self._drift is None else self._drift.waiting_us * 1e-6

    def walking(self) -> NDArray[np.float64]:
        """The probability that the target is in each cell and has not stopped for good, a new array [rows, cols]."""
        if self._drift is None:
            return np.zeros(self._shape)
        there = self.probability()
        return there * self._drift.going.reshape(self._shape) if self._drift.going.size else there

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
        self._renew(1.0)

    def _rescale(self) -> None:
        """Multiply all weights by a power of two (exact) before they run out of exponent."""
        factor = 2.0 ** -round(float(np.log2(self.total)))
        self._weights *= factor
        self._outside *= factor
        self._renew(factor)

    def _renew(self, factor: float) -> None:
        sum_up(self._weights, self._sums, self._offsets)
        for follower in self._followers:
            follower.renew(self._weights, factor)

    def follow(self, subject: Subject[_F]) -> _F:
        """What `subject` begins for this belief, from now on kept up to date by every observation.

        A copy of the belief goes on with copies of its own. So whoever hands a planner copies asks the original for
        what should know all looks, not only those of the copy (`roisearch.watch.LOOKED`).
        """
        for follower in self._followers:
            if follower.subject is subject:
                return cast(_F, follower)
        begun = subject.begin(self._weights, self._shape)
        lasting = [each for each in self._followers if each.lasts]
        others = [each for each in self._followers if not each.lasts]
        self._followers = [begun, *lasting, *others[: _KEPT - 1]]
        return begun

    def copy(self) -> Belief:
        """An independent belief in the same state."""
        twin = Belief.__new__(Belief)
        twin._shape = self._shape
        twin._weights = self._weights.copy()
        twin._outside = self._outside
        twin._offsets = self._offsets
        twin._sums = self._sums.copy()
        twin._followers = [each.copy() for each in self._followers]
        twin._drift = None if self._drift is None else self._drift.copy()
        twin.hits = self.hits
        twin._pack()
        return twin

    def digest(self) -> str:
        """A fingerprint of the belief, SHA-256 in hexadecimal, the same on every machine.

        It covers the shape of the map, the weight of each cell and the weight outside, to the last bit, and of a target
        that walks what part of each weight does, and since when; nothing of what follows the belief, nor the number of
        hits.
        """
        state = hashlib.sha256(b"roisearch-belief-1\n" + struct.pack("<qqd", *self._shape, self._outside))
        state.update(self._weights.astype("<f8", copy=False).tobytes())
        if self._drift is not None:
            state.update(struct.pack("<q", self._drift.waiting_us))
            state.update(self._drift.going.astype("<f8", copy=False).tobytes())
        return state.hexdigest()


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
