"""The ground as posts on the plane of the grid, and the highest of it within reach of any place. Pure.

Heights are metres above the ground at the launch point, so that no datum matters; where they are not known they are
NaN. Between posts the ground is bilinear, so nowhere higher than the highest of the four posts around.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

Floats = NDArray[np.float64]
_FARTHEST_M = 500.0  # no limit of height is higher


@dataclass(frozen=True, eq=False)
class Relief:
    """Posts `step_m` apart.

    Attributes:
        heights: float [rows, cols], above the ground at the launch point, north-west post first; NaN: not known.
        step_m: from post to post.
        west_m, north_m: where the first post is, as (east, south) of the grid's corner.
        near_m: how far from where it is meant to be the aircraft may be: `roof` takes in what is within it.
        launch_amsl_m: the launch point's height as the file has it, above whatever the file counts from.
    """

    heights: Floats
    step_m: float
    west_m: float
    north_m: float
    near_m: float
    launch_amsl_m: float = 0.0

    def height_at(self, points: Floats) -> Floats:
        """The ground at points [k, 2] (east, south): float [k], NaN where it is not known."""
        rows, cols = self.heights.shape
        x, y = (points[:, 0] - self.west_m) / self.step_m, (points[:, 1] - self.north_m) / self.step_m
        outside = ~((x >= 0.0) & (x <= cols - 1.0) & (y >= 0.0) & (y <= rows - 1.0))
        return np.where(outside, np.nan, bilinear(self.heights, y, x))

    def nearest_m(self, point: tuple[float, float], up: float) -> float:
        """How far the closest point of the ground is from a place (east, south) so high above the launch point, in any
        direction, to about half a step: what a limit of height over hills means (Regulation (EU) 2019/947,
        UAS.OPEN.010 (2)). NaN: the ground below is not known.
        """
        (below,) = self.height_at(np.array([point]))
        reach = min(abs(up - below), _FARTHEST_M)
        if not reach > self.step_m:
            return float(abs(up - below))
        offsets = np.arange(-reach, reach + self.step_m, self.step_m)
        east, south = (each.ravel() for each in np.meshgrid(offsets, offsets))
        around = self.height_at(np.column_stack([point[0] + east, point[1] + south]))
        away = np.sqrt(east**2 + south**2 + np.maximum(up - around, 0.0) ** 2)
        return float(np.nanmin(away, initial=abs(up - below)))

    @functools.cached_property
    def roof(self) -> Floats:
        """For each square between four posts [rows - 1, cols - 1]: the highest ground within `near_m` and a quarter of
        a step of any place in it; infinite where some of that is not known."""
        known = np.where(np.isnan(self.heights), np.inf, self.heights)
        tops = np.maximum(
            np.maximum(known[:-1, :-1], known[:-1, 1:]), np.maximum(known[1:, :-1], known[1:, 1:])
        )
        reach = (self.near_m + 0.25 * self.step_m) / self.step_m
        n = int(np.ceil(reach)) + 1
        gap = np.maximum(np.abs(np.arange(-n, n + 1)) - 1, 0)
        disc = np.hypot(gap[:, None], gap[None, :]) <= reach
        return np.asarray(ndimage.maximum_filter(tops, footprint=disc, mode="constant", cval=np.inf))

    def roof_at(self, points: Floats) -> Floats:
        """The highest ground within `near_m` of points [k, 2]: float [k], infinite where some is not known."""
        rows, cols = self.roof.shape
        with np.errstate(invalid="ignore"):
            col = np.floor((points[:, 0] - self.west_m) / self.step_m)
            row = np.floor((points[:, 1] - self.north_m) / self.step_m)
        inside = (row >= 0) & (row < rows) & (col >= 0) & (col < cols)
        out = np.full(len(points), np.inf)
        out[inside] = self.roof[row[inside].astype(np.int64), col[inside].astype(np.int64)]
        return out


def bilinear(heights: Floats, row: Floats, col: Floats) -> Floats:
    """Heights [rows, cols] at places [k] counted in posts; beyond the last posts as at the border."""
    rows, cols = heights.shape
    y, x = np.clip(row, 0.0, rows - 1.0), np.clip(col, 0.0, cols - 1.0)
    y, x = np.nan_to_num(y), np.nan_to_num(x)
    top, left = (
        np.minimum(y.astype(np.int64), max(rows - 2, 0)),
        np.minimum(x.astype(np.int64), max(cols - 2, 0)),
    )
    below, right = np.minimum(top + 1, rows - 1), np.minimum(left + 1, cols - 1)
    fy, fx = y - top, x - left
    upper = _between(heights[top, left], heights[top, right], fx)
    lower = _between(heights[below, left], heights[below, right], fx)
    return _between(upper, lower, fy)


def _between(a: Floats, b: Floats, share: Floats) -> Floats:
    """A post that counts for nothing may be unknown."""
    mixed = a * (1.0 - share) + b * share
    return np.where(share <= 0.0, a, np.where(share >= 1.0, b, mixed))
