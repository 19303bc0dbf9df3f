"""One height model as rasterio reads it: checked, in metres, its voids found, no finer than is asked for.

Whatever cannot be a height in metres is applied (scale, offset, feet) or refused in one sentence; what is no height at
all (the file's nodata, NaN, numbers that no ground on earth has, zeros amid mountains) is a void: NaN.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyproj
from scipy import ndimage

from service.area.frame import GridFrame
from service.errors import BadInput
from service.ground.relief import Floats, bilinear

_METRES = {
    "": 1.0,
    "m": 1.0,
    "metre": 1.0,
    "meter": 1.0,
    "metres": 1.0,
    "meters": 1.0,
    "ft": 0.3048,
    "foot": 0.3048,
    "feet": 0.3048,
    "us survey foot": 1200.0 / 3937.0,
    "us-ft": 1200.0 / 3937.0,
    "ftus": 1200.0 / 3937.0,
    "us survey feet": 1200.0 / 3937.0,
}
_LOWEST_M, _HIGHEST_M = -500.0, 9000.0  # the shore of the Dead Sea is at -430 m, Everest at 8849 m
_CLIFF_M = 100.0  # zeros that all around is this much above are no sea
_CLIFF_SHARE = 0.1
_STRIP = 2_000_000  # pixels read at once
_PAD = 2  # pixels around what is asked for


@dataclass(frozen=True, eq=False)
class Patch:
    """A part of a raster, in blocks of `block` x `block` pixels that are worth their highest.

    Attributes:
        values: float [rows, cols], metres; NaN: void.
        top, left: the first pixel.
        block: pixels a side of a block.
    """

    values: Floats
    top: int
    left: int
    block: int


class Model:
    """A height model that is open, on the plane of a grid."""

    def __init__(self, raster: Any, path: str, frame: GridFrame) -> None:
        """Raises BadInput for what is no height model."""
        self.raster, self.path, self.frame = raster, path, frame
        self._check()
        wkt = raster.crs.to_wkt()
        self.factor = self._factor(wkt)
        try:
            self._forth = pyproj.Transformer.from_crs("EPSG:4326", wkt, always_xy=True)
        except pyproj.exceptions.ProjError:
            raise self.bad("its coordinate reference system is not on the earth; reproject it") from None

    def bad(self, what: str) -> BadInput:
        """The error that names this file."""
        return BadInput(f"{self.path}: {what}")

    # ---- what it may be

    def _check(self) -> None:
        raster = self.raster
        if raster.crs is None:
            raise self.bad(
                "the height model has no coordinate reference system; set one, as with gdal_edit.py -a_srs"
            )
        if raster.count != 1:
            raise self.bad(
                f"a height model has one band of metres, this has {raster.count}; give the one of heights"
            )
        if raster.colorinterp[0].name == "palette":
            raise self.bad("its numbers are those of a palette's colours; give a model of heights")
        if np.issubdtype(np.dtype(raster.dtypes[0]), np.complexfloating):
            raise self.bad("it holds complex numbers; give a model of heights")
        scale, offset = raster.scales[0], raster.offsets[0]
        if not (math.isfinite(scale) and math.isfinite(offset)) or scale == 0.0:
            raise self.bad(f"its scale is {scale:g} and its offset {offset:g}; give heights as they are")

    def _factor(self, wkt: str) -> float:
        """Metres in one of its units, as the band tells, else its vertical reference system."""
        unit = (self.raster.units[0] or "").strip()
        if unit.lower() not in _METRES:
            raise self.bad(f"its unit is '{unit}'; give heights in metres or feet")
        axes = pyproj.CRS(wkt).axis_info
        vertical = axes[2].unit_conversion_factor if len(axes) > 2 else None
        told = _METRES[unit.lower()] if unit else None
        if told is not None and vertical is not None and abs(told - vertical) > 1e-4:
            raise self.bad(
                f"its band is in '{unit}' and its vertical reference system in {axes[2].unit_name}; "
                "correct the one that is wrong"
            )
        return told or vertical or 1.0

    # ---- places

    def pixels(self, metres: Floats) -> tuple[Floats, Floats]:
        """Row and column [k] of points [k, 2] (east, south), in pixels whose centres are whole numbers."""
        latlon = self.frame.from_metres(metres)
        x, y = self._forth.transform(latlon[:, 1], latlon[:, 0])
        back = ~self.raster.transform
        x, y = np.asarray(x), np.asarray(y)
        return back.d * x + back.e * y + back.f - 0.5, back.a * x + back.b * y + back.c - 0.5

    def metres(self, rows: Floats, cols: Floats) -> Floats:
        """Points [k, 2] (east, south) of places in pixels [k]."""
        there = self.raster.transform
        x, y = (
            there.a * (cols + 0.5) + there.b * (rows + 0.5) + there.c,
            there.d * (cols + 0.5) + there.e * (rows + 0.5) + there.f,
        )
        lon, lat = self._forth.transform(x, y, direction="INVERSE")
        return self.frame.to_metres(np.stack([np.asarray(lat), np.asarray(lon)], axis=1))

    def pitch_m(self, middle: Floats) -> float:
        """Metres from pixel to pixel there, where they are nearest to each other."""
        row, col = self.pixels(middle + np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]))
        if not (np.isfinite(row).all() and np.isfinite(col).all()):
            return math.inf
        per_metre = max(math.hypot(row[i] - row[0], col[i] - col[0]) for i in (1, 2))
        return 1.0 / max(per_metre, 1e-9)

    # ---- heights

    def patch(self, box: tuple[float, float, float, float], step_m: float, pitch_m: float) -> Patch | None:
        """What lies in a box (west, north, east, south) of the plane, no finer than `step_m`; None: nothing."""
        west, north, east, south = box
        grid = np.stack(np.meshgrid(np.linspace(west, east, 33), np.linspace(north, south, 33)), axis=-1)
        row, col = self.pixels(grid.reshape(-1, 2))
        known = np.isfinite(row) & np.isfinite(col)
        if not known.any():
            return None
        block = max(1, math.floor(step_m / pitch_m))
        pad = _PAD * block
        top, left = (
            max(0, math.floor(row[known].min()) - pad),
            max(0, math.floor(col[known].min()) - pad),
        )
        bottom = min(self.raster.height, math.ceil(row[known].max()) + pad + 1)
        right = min(self.raster.width, math.ceil(col[known].max()) + pad + 1)
        if bottom <= top or right <= left:
            return None
        strips, at_once = [], max(1, _STRIP // ((right - left) * block)) * block
        for first in range(top, bottom, at_once):
            strips.append(
                _highest(self._read(first, left, min(at_once, bottom - first), right - left), block)
            )
        return Patch(_without_holes(np.vstack(strips)), top, left, block)

    def _read(self, top: int, left: int, height: int, width: int) -> Floats:
        from rasterio.windows import Window

        band = self.raster.read(1, window=Window(left, top, width, height), masked=True)
        told = np.asarray(band.astype(np.float64).filled(np.nan))
        with np.errstate(over="ignore", invalid="ignore"):
            metres = (told * self.raster.scales[0] + self.raster.offsets[0]) * self.factor
            metres[~((metres >= _LOWEST_M) & (metres <= _HIGHEST_M))] = np.nan
        return np.asarray(metres)

    def sample(self, patch: Patch, points: Floats) -> Floats:
        """Heights at points [k, 2], bilinear between blocks; NaN off the patch or beside a void."""
        row, col = self.pixels(points)
        half = 0.5 * (patch.block - 1)
        y, x = (row - patch.top - half) / patch.block, (col - patch.left - half) / patch.block
        rows, cols = patch.values.shape
        with np.errstate(invalid="ignore"):
            inside = (y >= -0.5) & (y <= rows - 0.5) & (x >= -0.5) & (x <= cols - 0.5)
        return np.where(inside, bilinear(patch.values, y, x), np.nan)

    def blocks(self, patch: Patch) -> tuple[Floats, Floats]:
        """The middles [k, 2] on the plane of all blocks that are no void, and their heights [k]."""
        rows, cols = np.nonzero(np.isfinite(patch.values))
        half = 0.5 * (patch.block - 1)
        points = self.metres(
            np.asarray(patch.top + rows * patch.block + half, dtype=np.float64),
            np.asarray(patch.left + cols * patch.block + half, dtype=np.float64),
        )
        return points, patch.values[rows, cols]


def _highest(values: Floats, block: int) -> Floats:
    """The highest of each block; at the end of a row or column a block has fewer pixels."""
    if block == 1:
        return values
    rows, cols = (-(-size // block) * block for size in values.shape)
    padded = np.full((rows, cols), np.nan)
    padded[: values.shape[0], : values.shape[1]] = values
    squares = padded.reshape(rows // block, block, cols // block, block)
    return np.asarray(np.fmax.reduce(np.fmax.reduce(squares, axis=3), axis=1))


def _without_holes(values: Floats) -> Floats:
    """Zeros that lie amid mountains are voids that nobody marked: a shore has low ground beside it."""
    zero = values == 0.0
    if not zero.any() or zero.all():
        return values
    labels, count = ndimage.label(zero, structure=np.ones((3, 3)))
    around = ndimage.grey_dilation(labels, size=(3, 3))
    beside = (around > 0) & ~zero & np.isfinite(values)
    out = values.copy()
    order = np.argsort(around[beside], kind="stable")
    owners, heights = around[beside][order], values[beside][order]
    starts = np.searchsorted(owners, np.arange(1, count + 2))
    for label in range(1, count + 1):
        border = heights[starts[label - 1] : starts[label]]
        if len(border) and float(np.quantile(border, _CLIFF_SHARE)) > _CLIFF_M:
            out[labels == label] = np.nan
    return out


def is_there(path: str) -> bool:
    """Whether a file has that name."""
    return Path(path).is_file()
