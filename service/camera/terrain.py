"""Ground from a height model as a camera sees it: where rays meet it, and what it hides."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from service.camera.optics import Floats
from service.ground.relief import Relief, bilinear

_MOST_STEPS = 512
_TOLERANCE_M = (
    0.5  # ground this little above a line of sight does not hide what is behind: rounding of the posts
)


@dataclass(frozen=True, eq=False)
class Terrain:
    """Heights at posts `step_m` apart, between them bilinear; beyond the last posts as at the border.

    Attributes:
        heights: float [rows, cols], up from the launch point, north-west post first.
        west_m, north_m: where that post is, as (east, south) of the grid's corner.
    """

    heights: Floats
    step_m: float
    west_m: float
    north_m: float

    @property
    def lowest_m(self) -> float:
        """The lowest post."""
        return float(self.heights.min())

    def height_at(self, points: Floats) -> Floats:
        """Bilinear between the four posts around each of points [k, 2]."""
        row, col = (points[:, 1] - self.north_m) / self.step_m, (points[:, 0] - self.west_m) / self.step_m
        return bilinear(self.heights, row, col)

    def _clearance(self, origin: Floats, rays: Floats, along: Floats) -> Floats:
        """How far above the ground the points `along` [k, n] metres of the rays are."""
        points = origin + along[:, :, None] * rays[:, None, :]
        heights = self.height_at(points.reshape(-1, 3)[:, :2]).reshape(along.shape)
        clear: Floats = points[:, :, 2] - heights
        return clear

    def meet(self, origin: Floats, rays: Floats, max_range_m: float) -> Floats:
        """March along each ray in steps of a post, then halve the step that goes under the ground."""
        steps = int(np.clip(math.ceil(max_range_m / self.step_m), 2, _MOST_STEPS))
        along = np.broadcast_to(np.linspace(0.0, max_range_m, steps + 1), (len(rays), steps + 1))
        under = self._clearance(origin, rays, along) <= 0.0
        first = under.argmax(axis=1)
        met = under.any(axis=1) & (first > 0)
        at = np.arange(len(rays))
        high, low = along[at, np.maximum(first - 1, 0)].copy(), along[at, first].copy()
        for _ in range(24):
            middle = 0.5 * (high + low)
            below = self._clearance(origin, rays, middle[:, None])[:, 0] <= 0.0
            low, high = np.where(below, middle, low), np.where(below, high, middle)
        return np.where(met, low, np.nan)

    def in_sight(self, origin: Floats, points: Floats) -> NDArray[np.bool_]:
        """Whether the ground stays below the line to each point."""
        gap = points - origin
        far = np.linalg.norm(gap, axis=1)
        longest = float(far.max(initial=0.0))
        if longest <= 0.0:
            return np.ones(len(points), dtype=np.bool_)
        steps = int(np.clip(math.ceil(longest / self.step_m), 2, _MOST_STEPS))
        share = np.linspace(0.0, 1.0, steps + 1)[1:-1]
        rays = gap / np.maximum(far, 1e-9)[:, None]
        clear = self._clearance(origin, rays, share[None, :] * far[:, None])
        return np.asarray((clear >= -_TOLERANCE_M).all(axis=1))


def terrain_of(relief: Relief) -> Terrain:
    """The ground that was read, as the camera sees it; where it is not known, as low as it is anywhere."""
    filled = np.where(np.isfinite(relief.heights), relief.heights, np.nanmin(relief.heights))
    return Terrain(filled, relief.step_m, relief.west_m, relief.north_m)
