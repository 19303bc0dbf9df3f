"""Regions of interest: the hills of the prior, by watershed (the paper's section 'Segmenting ROIs')."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray


@dataclass(frozen=True, eq=False)
class Regions:
    """The regions of interest of a prior.

    Attributes:
        labels: int [rows, cols]; 1 .. count, 0 for a cell in no region.
        count: how many regions there are; may be 0 (a flat prior has none).
        centroids: float [count, 2], the middle of each region's cells.
        peaks: int [count, 2], the most probable cell of each region, before the search.
    """

    labels: NDArray[np.int32]
    count: int
    centroids: NDArray[np.float64]
    peaks: NDArray[np.int64]


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
    numbers = np.arange(1, count + 1)
    centroids = np.array(ndimage.center_of_mass(np.ones_like(mass), labels, numbers)).reshape(-1, 2)
    peaks = np.array(ndimage.maximum_position(mass, labels, numbers), dtype=np.int64).reshape(-1, 2)
    return Regions(labels, int(count), centroids, peaks)


def _no_regions(shape: tuple[int, ...]) -> Regions:
    return Regions(np.zeros(shape, dtype=np.int32), 0, np.zeros((0, 2)), np.zeros((0, 2), dtype=np.int64))
