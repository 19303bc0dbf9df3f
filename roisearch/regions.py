"""Regions of interest: the hills of the prior, by watershed (the paper's section 'Segmenting ROIs').

The paper segments once, and names regions that follow the belief as future work. Here they are segmented again when
enough probability has come into them or left them (`worth_segmenting`), from the belief without its furrows
(`segment_again`), and each keeps the number of the ground that it lies on (`track_regions`).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

MOVED = 0.2
"""The part of the mass that must have moved before regions are segmented again."""
SMOOTH = 3.0
"""Standard deviation, in cells, of the Gaussian that takes the furrows of a search out of a belief."""
LEAST = 0.01
"""A piece that holds less of the mass is no region, once the search is under way."""
OVERLAP = 0.2
"""The part of the smaller of two regions that both must cover for them to be the same."""


@dataclass(frozen=True, eq=False)
class Regions:
    """The regions of interest of a prior.

    Attributes:
        labels: int [rows, cols]; 1 .. count, 0 for a cell in no region.
        count: the largest number that a region has, or has had; may be 0 (a flat prior has none). Of regions that were
            tracked some numbers may belong to none any more.
        centroids: float [count, 2], the middle of each region's cells; of one that is no more, where it was last.
        peaks: int [count, 2], the most probable cell of each region when it was segmented.
        shares: float [1 + count], the part of the mass on the map that lay in no region, and in each, then; empty when
            that is not known.
    """

    labels: NDArray[np.int32]
    count: int
    centroids: NDArray[np.float64]
    peaks: NDArray[np.int64]
    shares: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))

    @cached_property
    def numbers(self) -> tuple[int, ...]:
        """The numbers of the regions that there are, in their order."""
        sizes = np.bincount(self.labels.ravel(), minlength=self.count + 1)
        return tuple(int(number) for number in np.flatnonzero(sizes[1:]) + 1)


def segment_regions(
    prior: ArrayLike, threshold: float | None = None, *, searchable: ArrayLike | None = None
) -> Regions:
    """Grow a region from each local maximum down to `threshold` or to the border of the next region.

    A seed is a cell at least as probable as every cell within two rows and columns (as peak_local_max with
    min_distance=2); a flat top of equal cells is one seed, not many. The watershed of -prior grows them. A piece
    above the threshold that no seed reaches stays in no region, as in the paper's method.

    Args:
        prior: float [rows, cols].
        threshold: tau, the least probability of a cell in a region; default 1.2 / number of searchable cells,
            1.2 times the uniform density, for a prior scaled to sum to one.
        searchable: bool [rows, cols]; other cells belong to no region.

    Raises:
        ValueError: when the prior is not a map of finite, not negative numbers.
    """
    from scipy import ndimage
    from skimage.segmentation import watershed

    mass = np.asarray(prior, dtype=np.float64)
    if mass.ndim != 2 or not np.isfinite(mass).all() or (mass < 0.0).any():
        raise ValueError("the prior must be a map of finite, not negative numbers")
    mask = np.ones(mass.shape, dtype=bool) if searchable is None else np.asarray(searchable, dtype=bool)
    mass = np.where(mask, mass, 0.0)
    if threshold is None:
        threshold = 1.2 * float(mass.sum()) / max(1, int(mask.sum()))
    inside = mask & (mass >= threshold) & (mass > 0.0)
    if not inside.any():
        return _no_regions(mass.shape)
    top = ndimage.maximum_filter(mass, size=5)
    seeds = inside & (mass >= top * (1.0 - 1e-9))
    markers, count = ndimage.label(seeds, structure=np.ones((3, 3)))
    labels = watershed(-mass, markers, mask=inside).astype(np.int32)  # type: ignore[no-untyped-call]
    middles, peaks = _middles_and_peaks(labels, mass, int(count))
    return Regions(labels, int(count), middles, peaks, shares_of(labels, int(count), mass))


def shares_of(labels: NDArray[np.int32], count: int, mass: NDArray[np.float64]) -> NDArray[np.float64]:
    """The part of the mass on the map in no region and in each, float [1 + count]; all zero without mass."""
    sums = np.bincount(labels.ravel(), mass.ravel(), minlength=count + 1)
    return np.asarray(sums / max(float(sums.sum()), np.finfo(np.float64).tiny))


def _middles_and_peaks(
    labels: NDArray[np.int32], mass: NDArray[np.float64], count: int
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """The middle of each region's cells, and its most probable cell, the first of equal ones; [count, 2] both."""
    cells = np.flatnonzero(labels)
    of, rows, cols = labels.ravel()[cells], cells // labels.shape[1], cells % labels.shape[1]
    sizes = np.bincount(of, minlength=count + 1)[1:]
    sums = [np.bincount(of, weights=along, minlength=count + 1)[1:] for along in (rows, cols)]
    most = np.zeros(count + 1)
    np.maximum.at(most, of, mass.ravel()[cells])
    is_top = mass.ravel()[cells] == most[of]
    peaks = np.zeros(count + 1, dtype=np.int64)
    peaks[of[is_top][::-1]] = cells[is_top][::-1]  # of cells of one region the last is kept
    return np.stack(sums, axis=1) / sizes[:, None], np.stack(np.divmod(peaks[1:], labels.shape[1]), axis=1)


def _no_regions(shape: tuple[int, ...]) -> Regions:
    labels = np.zeros(shape, dtype=np.int32)
    return Regions(labels, 0, np.zeros((0, 2)), np.zeros((0, 2), dtype=np.int64), np.ones(1))


def mass_moved(regions: Regions, probability: ArrayLike) -> float:
    """The part of the mass on the map that is not where the regions had it when they were segmented, 0 to 1.

    Half the sum of how much the share of each region, and of the ground in none, has changed: the least mass that must
    be carried from one to another to get from the belief of then to that of now (the total variation distance).

    Args:
        regions: with the shares of then (`segment_regions`, `segment_again`).
        probability: float [rows, cols], as it is now, on any scale.

    Raises:
        ValueError: when the shapes differ, or the regions do not know their shares.
    """
    mass = np.asarray(probability, dtype=np.float64)
    if mass.shape != regions.labels.shape:
        raise ValueError(
            f"the regions have the shape {regions.labels.shape}, the probability {mass.shape}; give a map of theirs"
        )
    if regions.shares.shape != (regions.count + 1,):
        raise ValueError(
            "these regions do not know their shares of the mass; segment them by segment_regions"
        )
    now = shares_of(regions.labels, regions.count, mass)
    return float(0.5 * np.abs(now - regions.shares).sum())


def worth_segmenting(regions: Regions, probability: ArrayLike, *, moved: float = MOVED) -> bool:
    """Whether so much of the mass has moved (`mass_moved`) that the regions are to be segmented again.

    Raises:
        ValueError: as `mass_moved`; when `moved` is not above 0 and at most 1.
    """
    if not 0.0 < moved <= 1.0:
        raise ValueError(f"moved must be above 0 and at most 1, not {moved}")
    return mass_moved(regions, probability) >= moved


def segment_again(
    old: Regions,
    probability: ArrayLike,
    *,
    searchable: ArrayLike | None = None,
    smooth: float = SMOOTH,
    least: float = LEAST,
) -> Regions:
    """The regions of a belief in the middle of a search, with the numbers that `old` gives their ground.

    A belief that is being searched has furrows along the flown lines, with a seed on every ridge between them. So it is
    segmented from a smoothed copy (a Gaussian over the searchable cells), and what holds next to nothing is no region.

    Args:
        probability: float [rows, cols], on any scale.
        searchable: bool [rows, cols]; other cells belong to no region.
        smooth: standard deviation of the Gaussian, in cells; 0: none.
        least: part of the mass on the map below which a piece is no region.

    Raises:
        ValueError: when the probability is no map of finite, not negative numbers of the shape of `old`.
    """
    mass = np.asarray(probability, dtype=np.float64)
    if mass.shape != old.labels.shape:
        raise ValueError(
            f"the regions have the shape {old.labels.shape}, the probability {mass.shape}; give a map of theirs"
        )
    mask = np.ones(mass.shape, dtype=bool) if searchable is None else np.asarray(searchable, dtype=bool)
    new = segment_regions(_smoothed(mass, mask, smooth), searchable=mask)
    shares = shares_of(new.labels, new.count, np.where(mask, mass, 0.0))
    keeps = shares >= least
    keeps[0] = False
    labels = np.where(keeps, np.cumsum(keeps), 0).astype(np.int32)[new.labels]
    count = int(keeps.sum())
    middles, peaks = _middles_and_peaks(labels, mass, count)
    return track_regions(old, Regions(labels, count, middles, peaks, shares_of(labels, count, mass)))


def _smoothed(mass: NDArray[np.float64], mask: NDArray[np.bool_], sigma: float) -> NDArray[np.float64]:
    """The mean over a Gaussian's worth of searchable cells around each."""
    from scipy import ndimage

    if sigma <= 0.0:
        return mass
    around = ndimage.gaussian_filter(mask.astype(np.float64), sigma, mode="constant")
    summed = ndimage.gaussian_filter(np.where(mask, mass, 0.0), sigma, mode="constant")
    return np.where(mask, np.maximum(summed, 0.0) / np.maximum(around, 1e-12), 0.0)


def track_regions(old: Regions, new: Regions) -> Regions:
    """The regions `new` with the numbers of those of `old` whose ground they lie on.

    The pairs that share most cells are matched first, one to one, when they share at least `OVERLAP` of the smaller of
    the two: where a region falls into parts, the part with most of its ground keeps the number; where two become one,
    the one that gives most ground does. What matches none gets a number that was never used; the number of one that is
    gone is not used again. The same `old` and `new` always give the same.

    Raises:
        ValueError: when the maps have different shapes.
    """
    if old.labels.shape != new.labels.shape:
        raise ValueError(
            f"the regions have the shapes {old.labels.shape} and {new.labels.shape}; give two of one map"
        )
    number_of = _matched(old, new)
    count = old.count
    for number in range(1, new.count + 1):
        if number not in number_of:
            count += 1
            number_of[number] = count
    renamed = np.zeros(new.count + 1, dtype=np.int32)
    renamed[list(number_of)] = list(number_of.values())
    middles, peaks, shares = (np.zeros((count, 2)), np.zeros((count, 2), dtype=np.int64), np.zeros(count + 1))
    middles[: old.count], peaks[: old.count] = old.centroids, old.peaks
    middles[renamed[1:] - 1], peaks[renamed[1:] - 1] = new.centroids, new.peaks
    shares[renamed[: len(new.shares)]] = new.shares
    known = shares if len(new.shares) else new.shares
    return replace(new, labels=renamed[new.labels], count=count, centroids=middles, peaks=peaks, shares=known)


def _matched(old: Regions, new: Regions) -> dict[int, int]:
    """The old number of each new region that has one."""
    width = new.count + 1
    shared = np.bincount(old.labels.ravel().astype(np.int64) * width + new.labels.ravel(), minlength=width)
    shared = np.pad(shared, (0, (old.count + 1) * width - shared.size)).reshape(old.count + 1, width)
    sizes_old, sizes_new = shared.sum(axis=1), shared.sum(axis=0)
    pairs = [
        (-int(shared[before, after]), before, after)
        for before, after in np.argwhere(shared > 0).tolist()
        if before and after and shared[before, after] >= OVERLAP * min(sizes_old[before], sizes_new[after])
    ]
    number_of: dict[int, int] = {}
    taken: set[int] = set()
    for _, before, after in sorted(pairs):
        if after not in number_of and before not in taken:
            number_of[after] = before
            taken.add(before)
    return number_of
