"""Ground from a height model: a GeoTIFF of elevations (extra `geotiff`), laid onto the grid's plane once.

Only differences of height are used: the launch point's elevation is the model's own there, so the model's vertical
datum does not matter, and neither does the autopilot's.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyproj
from numpy.typing import NDArray

from service.area.frame import GridFrame
from service.area.model import LatLon
from service.camera.optics import Floats
from service.errors import BadInput

_MOST_POSTS = 4_000_000
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
        rows, cols = self.heights.shape
        x = np.clip((points[:, 0] - self.west_m) / self.step_m, 0.0, cols - 1.0)
        y = np.clip((points[:, 1] - self.north_m) / self.step_m, 0.0, rows - 1.0)
        col = np.minimum(x.astype(np.int64), max(cols - 2, 0))
        row = np.minimum(y.astype(np.int64), max(rows - 2, 0))
        right, below = np.minimum(col + 1, cols - 1), np.minimum(row + 1, rows - 1)
        fx, fy = x - col, y - row
        h = self.heights
        top = h[row, col] * (1.0 - fx) + h[row, right] * fx
        bottom = h[below, col] * (1.0 - fx) + h[below, right] * fx
        heights: Floats = top * (1.0 - fy) + bottom * fy
        return heights

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


def read_terrain(path: str | Path, frame: GridFrame, launch: LatLon, reach_m: float) -> Terrain:
    """The height model under a grid and `reach_m` metres around it.

    Raises:
        BadInput: rasterio is not installed, or the file is not a height model that covers the grid and the launch.
    """
    try:
        import rasterio
        from rasterio.errors import RasterioIOError
    except ImportError:
        raise BadInput(
            f"{path}: reading a height model needs rasterio; run pip install 'roisearch[geotiff]'"
        ) from None
    if not Path(path).is_file():
        raise BadInput(f"{path}: there is no such height model; check sensor.terrain_file")
    try:
        with rasterio.open(path) as raster:
            return _read(raster, str(path), frame, launch, reach_m)
    except RasterioIOError as error:
        reason = str(error).splitlines()[0].rstrip(".")
        raise BadInput(f"{path}: not a readable GeoTIFF ({reason}); export it again") from None


def _read(raster: Any, path: str, frame: GridFrame, launch: LatLon, reach_m: float) -> Terrain:
    if raster.crs is None or raster.count != 1:
        raise BadInput(f"{path}: a height model has one band of metres and a coordinate reference system")
    to_raster = pyproj.Transformer.from_crs("EPSG:4326", raster.crs.to_wkt(), always_xy=True)

    def pixels(latlon: Floats) -> tuple[Floats, Floats]:
        """Row and column in the raster, in pixels whose centres are whole numbers."""
        x, y = to_raster.transform(latlon[:, 1], latlon[:, 0])
        back = ~raster.transform
        return back.d * x + back.e * y + back.f - 0.5, back.a * x + back.b * y + back.c - 0.5

    width, height = frame.cols * frame.cell_m, frame.rows * frame.cell_m
    centre = np.array([0.5 * width, 0.5 * height])
    row, col = pixels(frame.from_metres(centre + np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])))
    per_metre = max(math.hypot(row[i] - row[0], col[i] - col[0]) for i in (1, 2))
    side = max(width, height) + 2.0 * reach_m
    step = max(1.0 / max(per_metre, 1e-6), side / math.sqrt(_MOST_POSTS), 0.5)
    east = np.arange(-reach_m, width + reach_m + step, step)
    south = np.arange(-reach_m, height + reach_m + step, step)
    posts = np.stack(np.meshgrid(east, south), axis=-1).reshape(-1, 2)
    row, col = pixels(np.vstack([frame.from_metres(posts), np.array([launch])]))
    values = _sample(raster, row, col)
    heights, at_launch = values[:-1].reshape(len(south), len(east)), float(values[-1])
    if not math.isfinite(at_launch):
        raise BadInput(f"{path}: the height model has no height at the launch point; give one that covers it")
    on_grid = ((east >= 0.0) & (east <= width))[None, :] & ((south >= 0.0) & (south <= height))[:, None]
    missing = float(np.mean(~np.isfinite(heights[on_grid])))
    if missing > 0.0:
        raise BadInput(
            f"{path}: the height model has no height for {missing:.0%} of the grid; give one that covers it"
        )
    filled = np.where(np.isfinite(heights), heights, np.nanmin(heights))
    return Terrain(filled - at_launch, step, float(east[0]), float(south[0]))


def _sample(raster: Any, row: Floats, col: Floats) -> Floats:
    """Bilinear heights at pixel positions; NaN off the raster or beside missing data."""
    from rasterio.windows import Window

    inside = (row >= -0.5) & (row <= raster.height - 0.5) & (col >= -0.5) & (col <= raster.width - 0.5)
    out = np.full(len(row), np.nan)
    if not inside.any():
        return out
    top, left = int(max(0, math.floor(row[inside].min()))), int(max(0, math.floor(col[inside].min())))
    bottom = int(min(raster.height, math.floor(row[inside].max()) + 2))
    right = int(min(raster.width, math.floor(col[inside].max()) + 2))
    band = raster.read(1, window=Window(left, top, right - left, bottom - top), masked=True)
    values = np.asarray(band.astype(np.float64).filled(np.nan))
    patch = Terrain(values, 1.0, float(left), float(top))
    out[inside] = patch.height_at(np.stack([col[inside], row[inside]], axis=1))
    return out
