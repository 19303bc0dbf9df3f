"""Height models, one or several as one, laid onto the plane of a grid once (extra `geotiff`)."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator, Sequence

import numpy as np
import shapely

from service.area.frame import GridFrame
from service.area.projection import FloatArray
from service.area.zone import Zone
from service.errors import BadInput
from service.geometry import LatLon
from service.ground.raster import Model, Patch, is_there
from service.ground.relief import Relief

_MOST_POSTS = 2_000_000
_FINEST_M = 2.5
_AT_ONCE = 500_000


def read_relief(
    files: Sequence[str], frame: GridFrame, launch: LatLon, *, reach_m: float, near_m: float = 0.0
) -> Relief:
    """The ground under a grid, the launch point, and `reach_m` metres around them.

    Several files count as one, where they overlap by the highest of them: tiles, or a model of the surface (trees,
    roofs) beside one of the ground. Of pixels finer than the posts the highest counts, and each pixel's height is kept
    at the post nearest to it, so that no top is smoothed away.

    Args:
        files: height models of any kind that rasterio opens, in any coordinate reference system.
        frame: the grid.
        launch: where heights are counted from.
        reach_m: how far around.
        near_m: see `Relief`.

    Raises:
        BadInput: rasterio is not installed, or a file is not a height model, or none has a height at the launch point.
    """
    with contextlib.ExitStack() as stack:
        models = [stack.enter_context(_opened(file, frame)) for file in files]
        home = frame.to_metres([launch])
        box = _box(frame, home, reach_m)
        middle = np.array([[0.5 * (box[0] + box[2]), 0.5 * (box[1] + box[3])]])
        pitches = [model.pitch_m(middle) for model in models]
        side = (box[2] - box[0]) * (box[3] - box[1])
        step = max(0.5 * min(pitches), math.sqrt(side / _MOST_POSTS), _FINEST_M)
        if not math.isfinite(step):
            raise BadInput(f"{', '.join(files)}: covers no part of the area; give one that does")
        east, south = (
            np.arange(box[0], box[2] + step, step),
            np.arange(box[1], box[3] + step, step),
        )
        heights = np.full((len(south), len(east)), np.nan)
        launches = []
        for model, pitch in zip(models, pitches, strict=True):
            patch = model.patch((box[0], box[1], float(east[-1]), float(south[-1])), step, pitch)
            if patch is not None:
                laid = _lay(model, patch, east, south, step)
                heights = np.fmax(heights, laid)
                launches.append(float(model.sample(patch, home)[0]))
        known = [height for height in launches if math.isfinite(height)]
        if not known:
            raise BadInput(
                f"{', '.join(files)}: has no height at the launch point {launch[0]:.6f}, {launch[1]:.6f}; "
                "give a height model that covers it"
            )
        base = min(known)  # of ground and roof at the launch point, the ground: all else is higher then
        return Relief(heights - base, step, float(east[0]), float(south[0]), near_m, base)


def check_covered(relief: Relief, zone: shapely.Geometry, files: Sequence[str]) -> None:
    """Refuse a ground with holes where the aircraft is to fly.

    Args:
        relief: the ground.
        zone: where it is to fly, on the plane of the grid.
        files: what the ground was read from, for the message.

    Raises:
        BadInput: it has no height somewhere in the zone.
    """
    rows, cols = relief.heights.shape
    west, north, east, south = shapely.bounds(zone)
    top = max(0, math.ceil((north - relief.north_m) / relief.step_m))
    bottom = min(rows, math.floor((south - relief.north_m) / relief.step_m) + 1)
    left = max(0, math.ceil((west - relief.west_m) / relief.step_m))
    right = min(cols, math.floor((east - relief.west_m) / relief.step_m) + 1)
    y, x = np.mgrid[top : max(top, bottom), left : max(left, right)]
    inside = shapely.contains_xy(
        Zone(zone).prepared, relief.west_m + x * relief.step_m, relief.north_m + y * relief.step_m
    )
    missing = np.isnan(relief.heights[y[inside], x[inside]])
    if missing.any():
        raise BadInput(
            f"{', '.join(files)}: has no height for {max(float(missing.mean()), 0.001):.1%} of the area and of the way "
            "to it; give a height model without holes that covers both"
        )


@contextlib.contextmanager
def _opened(file: str, frame: GridFrame) -> Iterator[Model]:
    try:
        import rasterio
        from rasterio.errors import RasterioIOError
    except ImportError:
        raise BadInput(
            f"{file}: reading a height model needs rasterio; run pip install 'roisearch[geotiff]'"
        ) from None
    if not is_there(file):
        raise BadInput(f"{file}: there is no such height model; check ground.file")
    try:
        with rasterio.open(file) as raster:
            yield Model(raster, file, frame)
    except RasterioIOError as error:
        reason = str(error).splitlines()[0].rstrip(".")
        raise BadInput(f"{file}: not a readable height model ({reason}); export it again") from None


def _box(frame: GridFrame, home: FloatArray, reach_m: float) -> tuple[float, float, float, float]:
    """West, north, east and south of what is laid out, in metres of the grid's corner."""
    east, south = home[0].tolist()
    width, height = frame.cols * frame.cell_m, frame.rows * frame.cell_m
    return (
        min(0.0, east) - reach_m,
        min(0.0, south) - reach_m,
        max(width, east) + reach_m,
        max(height, south) + reach_m,
    )


def _lay(model: Model, patch: Patch, east: FloatArray, south: FloatArray, step: float) -> FloatArray:
    """The heights of one model at the posts."""
    laid: FloatArray = np.empty((len(south), len(east)))
    at_once = max(1, _AT_ONCE // len(east))
    for first in range(0, len(south), at_once):
        some = south[first : first + at_once]
        posts = np.stack(np.meshgrid(east, some), axis=-1).reshape(-1, 2)
        laid[first : first + at_once] = model.sample(patch, posts).reshape(len(some), len(east))
    points, tops = model.blocks(patch)
    col, row = np.rint((points[:, 0] - east[0]) / step), np.rint((points[:, 1] - south[0]) / step)
    inside = (row >= 0) & (row < len(south)) & (col >= 0) & (col < len(east))
    at = row[inside].astype(np.int64), col[inside].astype(np.int64)
    highest = np.full(laid.shape, -np.inf)
    np.maximum.at(highest, at, tops[inside])
    return np.asarray(np.maximum(laid, highest))  # a void stays one
