"""The ground under a mock: flat, or the heights of a raster, in metres above the ground at home."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

_REACH_M = 4000.0  # from home to each side
_MOST_CELLS = 2000  # to a side
_FINEST_M = 2.0


class Ground(Protocol):
    """Heights by place in the home frame."""

    def height(self, north: float, east: float) -> float:
        """Metres above the ground at home."""

    def from_home(self, north: float, east: float) -> Ground:
        """The same ground for a home so many metres away."""


class Flat:
    """As high as home everywhere."""

    def height(self, north: float, east: float) -> float:
        return 0.0

    def from_home(self, north: float, east: float) -> Flat:
        return self


class Relief:
    """Heights on a square grid around home, [rows, cols], north to south; as at its edge beyond."""

    def __init__(
        self, heights: NDArray[np.float64], cell_m: float, home: tuple[float, float] = (0.0, 0.0)
    ) -> None:
        """`home`: where home is, in metres north and east of the grid's middle."""
        self._heights, self._cell_m = heights, cell_m
        self._place = home
        self._north = self._cell_m * (heights.shape[0] - 1) / 2.0 - home[0]
        self._west = self._cell_m * (heights.shape[1] - 1) / 2.0 + home[1]
        self._home = 0.0
        self._home = self.height(0.0, 0.0)

    def height(self, north: float, east: float) -> float:
        rows, cols = self._heights.shape
        y = min(max((self._north - north) / self._cell_m, 0.0), rows - 1.0)
        x = min(max((self._west + east) / self._cell_m, 0.0), cols - 1.0)
        row, col = min(int(y), rows - 2), min(int(x), cols - 2)
        down, right = y - row, x - col
        corners = self._heights[row : row + 2, col : col + 2]
        upper = corners[0, 0] * (1.0 - right) + corners[0, 1] * right
        lower = corners[1, 0] * (1.0 - right) + corners[1, 1] * right
        return float(upper * (1.0 - down) + lower * down) - self._home

    def from_home(self, north: float, east: float) -> Relief:
        return Relief(self._heights, self._cell_m, (self._place[0] + north, self._place[1] + east))


def read_ground(path: Path, home: tuple[float, float, float]) -> Relief:
    """The heights of a raster file around home; ValueError says in one sentence why they cannot be had."""
    try:
        import rasterio
        from rasterio.errors import RasterioError
    except ImportError:
        raise ValueError("--ground needs rasterio: pip install 'roisearch[geotiff]'") from None
    try:
        with rasterio.open(path) as raster:
            return _around(raster, home)
    except RasterioError as error:
        raise ValueError(f"cannot read the ground in {path}: {error}") from None


def _around(raster: Any, home: tuple[float, float, float]) -> Relief:
    import rasterio
    from rasterio.transform import from_origin
    from rasterio.warp import Resampling, reproject, transform

    if raster.crs is None:
        raise ValueError(f"{raster.name} does not say where on the globe it lies")
    local = f"+proj=aeqd +lat_0={home[0]} +lon_0={home[1]} +datum=WGS84 +units=m"
    (x,), (y,) = transform("EPSG:4326", raster.crs, [home[1]], [home[0]])
    box = raster.bounds
    if not (box.left <= x <= box.right and box.bottom <= y <= box.top):
        raise ValueError(f"home {home[0]:.6f}, {home[1]:.6f} is not on the ground of {raster.name}")
    per_pixel = 111_195.0 if raster.crs.is_geographic else 1.0
    cell_m = max(_FINEST_M, abs(raster.transform.e) * per_pixel, 2.0 * _REACH_M / _MOST_CELLS)
    side = 2 * math.ceil(_REACH_M / cell_m) + 1
    edge = side * cell_m / 2.0
    heights = np.full((side, side), np.nan)
    reproject(
        rasterio.band(raster, 1),
        heights,
        dst_transform=from_origin(-edge, edge, cell_m, cell_m),
        dst_crs=local,
        dst_nodata=np.nan,
        resampling=Resampling.bilinear,
    )
    middle = side // 2
    if math.isnan(heights[middle, middle]):
        raise ValueError(f"{raster.name} has no height at home {home[0]:.6f}, {home[1]:.6f}")
    return Relief(np.where(np.isnan(heights), heights[middle, middle], heights), cell_m)
