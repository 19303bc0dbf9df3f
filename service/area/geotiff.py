"""A prior from a GeoTIFF of probabilities (extra `geotiff`)."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyproj
from numpy.typing import NDArray

from service.area.frame import GridFrame
from service.area.geojson import Where
from service.area.projection import FloatArray

_SAMPLES_PER_CELL = 8
"""A pixel is cut so that at least this many samples lie along the side of a cell."""

_MAX_CUT = 64
"""A pixel is cut into at most this many parts a side, so a pixel may be this many cells wide."""

POA_BAND = "POA"
"""Of several bands the one described by this is taken, as in the export of a run."""

_UNITS = ("", "1", "%", "percent", "probability", "unity")
"""Units of a band of probabilities; their size does not matter, as they are relative to each other."""

_CHUNK = 2_000_000
"""Samples located at once, to bound the memory."""


def read_geotiff_prior(
    path: str | Path, frame: GridFrame, covered: NDArray[np.float64] | NDArray[np.bool_]
) -> FloatArray:
    """Read a raster of probabilities onto a grid, conserving mass.

    A pixel's value is the relative probability that the target is in that pixel. Each pixel
    is cut into equal samples that are shared out to the cells they lie in, so no mass is lost
    or made up by interpolation, whatever the two resolutions and the raster's CRS. Nodata and NaN count
    as zero, and the band's scale and offset are applied. What lies off the grid, or on the uncovered part of a cell,
    is left out.

    Args:
        path: a GeoTIFF in any CRS, of one band or with one that is described as POA.
        frame: the grid.
        covered: how much of each cell is ground, float 0..1 or bool [rows, cols]
            (`Grid.covered` or `Grid.searchable`).

    Returns:
        float [rows, cols], summing to 1; give it to `Grid.with_prior`.

    Raises:
        BadInput: rasterio is not installed, the file is not a usable raster, has negative
            values, or no mass on the grid.
    """
    where = Where(str(path))
    try:
        import rasterio
        from rasterio.errors import RasterioIOError
    except ImportError:
        raise where.bad("reading a GeoTIFF needs rasterio; run pip install 'roisearch[geotiff]'") from None
    if not Path(path).is_file():
        raise where.bad("there is no such file; check the path")
    try:
        with rasterio.open(path) as raster:
            mass = _read(raster, frame, where)
    except RasterioIOError as error:
        reason = str(error).splitlines()[0].rstrip(".")
        raise where.bad(f"not a readable GeoTIFF ({reason}); export it again") from None
    mass *= covered
    if not mass.sum() > 0:
        raise where.bad(
            "the raster has no probability inside the area; check that it covers the area and its CRS"
        )
    return np.asarray(mass / mass.sum())


def _read(raster: Any, frame: GridFrame, where: Where) -> FloatArray:
    from rasterio.windows import Window

    if raster.crs is None:
        raise where.bad("the raster has no coordinate reference system; set one, as with gdal_edit.py -a_srs")
    if raster.count != 1 and POA_BAND not in raster.descriptions:
        raise where.bad(
            f"the raster has {raster.count} bands; give one band of probabilities, or call that band {POA_BAND}"
        )
    _refuse_other_meanings(raster, where)
    try:
        to_raster = pyproj.Transformer.from_crs("EPSG:4326", raster.crs.to_wkt(), always_xy=True)
    except pyproj.exceptions.ProjError:
        raise where.bad(
            "the raster's coordinate reference system is not on the earth; reproject it"
        ) from None
    mass: FloatArray = np.zeros(frame.shape)
    spot = _window(raster, frame, to_raster)
    if spot is None:
        return mass
    top, left, height, width = spot
    samples = _samples(raster, frame, to_raster, where)
    rows_at_once = max(1, _CHUNK // (width * samples.cut**2))
    for first in range(top, top + height, rows_at_once):
        count = min(rows_at_once, top + height - first)
        values = _values(raster, Window(left, first, width, count), where)
        _scatter(mass, values, (first, left), samples, raster, frame, to_raster)
    return mass


def _band(raster: Any) -> int:
    """The number of the band that holds the probabilities."""
    return 1 if raster.count == 1 else int(raster.descriptions.index(POA_BAND)) + 1


def _refuse_other_meanings(raster: Any, where: Where) -> None:
    """A band of colours, of metres or of decibels would be laid out like probabilities, and mean nothing."""
    number = _band(raster)
    if raster.colorinterp[number - 1].name == "palette":
        raise where.bad(
            "the raster's numbers are those of a palette's colours; give the probabilities themselves"
        )
    unit = (raster.units[number - 1] or "").strip()
    if unit.lower() not in _UNITS:
        raise where.bad(f"the raster's unit is '{unit}'; give probabilities, without a unit or in percent")
    scale, offset = raster.scales[number - 1], raster.offsets[number - 1]
    if not (math.isfinite(scale) and math.isfinite(offset)) or scale == 0.0:
        raise where.bad(
            f"the raster's scale is {scale:g} and its offset {offset:g}; give probabilities as they are"
        )


def _values(raster: Any, window: Any, where: Where) -> FloatArray:
    """The pixels of a window, nodata and NaN as zero; anything else that is no probability is refused."""
    number = _band(raster)
    band = raster.read(number, window=window, masked=True)
    if np.iscomplexobj(band):
        raise where.bad("the raster holds complex numbers; give probabilities")
    told = band.astype(np.float64) * raster.scales[number - 1] + raster.offsets[number - 1]
    values = np.asarray(told.filled(0.0))
    values[np.isnan(values)] = 0.0
    wrong = np.argwhere((values < 0) | np.isinf(values))
    if wrong.size:
        row, col = wrong[0]
        raise where.bad(
            f"pixel row {row + window.row_off}, column {col + window.col_off} is {values[row, col]:g}; give "
            "probabilities of 0 or more, and set the nodata value if it means missing"
        )
    return values


def _window(raster: Any, frame: GridFrame, to_raster: pyproj.Transformer) -> tuple[int, int, int, int] | None:
    """The pixels (top, left, height, width) that can lie on the grid; None when there are none."""
    along = np.linspace(0.0, 1.0, 33)
    edge = np.concatenate([np.stack([along, along * 0 + side], axis=1) for side in (0.0, 1.0)])
    border = np.concatenate([edge, edge[:, ::-1]]) * (np.array(frame.shape[::-1]) * frame.cell_m)
    latlon = frame.from_metres(border)
    x, y = to_raster.transform(latlon[:, 1], latlon[:, 0])
    finite = np.isfinite(x) & np.isfinite(y)
    cols, rows = _apply(~raster.transform, x[finite], y[finite])
    if not rows.size:
        return None
    top, bottom = _clip(rows.min() - 1, raster.height), _clip(rows.max() + 2, raster.height)
    left, right = _clip(cols.min() - 1, raster.width), _clip(cols.max() + 2, raster.width)
    return (top, left, bottom - top, right - left) if bottom > top and right > left else None


def _apply(transform: Any, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """An affine.Affine on arrays, which affine itself only does from version 3 on."""
    return transform.a * x + transform.b * y + transform.c, transform.d * x + transform.e * y + transform.f


def _clip(value: float, size: int) -> int:
    return int(min(max(math.floor(value), 0), size))


@dataclass(frozen=True)
class _Samples:
    """Into how many parts each side of a pixel is cut, and how large a part is, in cells (rows, cols)."""

    cut: int
    size: tuple[float, float]


def _samples(raster: Any, frame: GridFrame, to_raster: pyproj.Transformer, where: Where) -> _Samples:
    middle = (np.array(frame.shape) - 1) / 2
    latlon = frame.to_latlon(middle + np.array([[0, 0], [1, 0], [0, 1]]))
    x, y = to_raster.transform(latlon[:, 1], latlon[:, 0])
    cols, rows = _apply(~raster.transform, x, y)
    down, across = (math.hypot(cols[i] - cols[0], rows[i] - rows[0]) for i in (1, 2))
    if not min(down, across) * _MAX_CUT >= 1:
        raise where.bad(
            f"a pixel is wider than {_MAX_CUT} cells of {frame.cell_m:g} m; "
            "resample the raster to smaller pixels, as with gdalwarp -tr"
        )
    cut = min(max(math.ceil(_SAMPLES_PER_CELL / min(down, across)), 1), _MAX_CUT)
    return _Samples(cut, (1 / (down * cut), 1 / (across * cut)))


def _scatter(
    mass: FloatArray,
    values: FloatArray,
    corner: tuple[int, int],
    samples: _Samples,
    raster: Any,
    frame: GridFrame,
    to_raster: pyproj.Transformer,
) -> None:
    """Add the pixels' mass [h, w] to the cells [rows, cols] that their samples lie in."""
    row, col = np.nonzero(values)
    cut = samples.cut
    offset = (np.arange(cut) + 0.5) / cut
    rows = corner[0] + row[:, None, None] + offset[:, None] + 0 * offset
    cols = corner[1] + col[:, None, None] + 0 * offset[:, None] + offset
    x, y = _apply(raster.transform, cols.ravel(), rows.ravel())
    lon, lat = to_raster.transform(x, y, direction="INVERSE")
    east, south = frame.to_metres(np.stack([lat, lon], axis=1)).T / frame.cell_m
    share = np.repeat(values[row, col], cut * cut) / (cut * cut)
    for in_row, row_part in _split(south, samples.size[0]):
        for in_col, col_part in _split(east, samples.size[1]):
            inside = (in_row >= 0) & (in_row < frame.rows) & (in_col >= 0) & (in_col < frame.cols)
            cells = (in_row[inside].astype(np.int64), in_col[inside].astype(np.int64))
            np.add.at(mass, cells, (share * row_part * col_part)[inside])


def _split(middle: FloatArray, size: float) -> list[tuple[FloatArray, FloatArray]]:
    """The two cells along one axis that samples of `size` cells touch, with the part of each in them."""
    low, high = np.floor(middle - size / 2), np.floor(middle + size / 2)
    beyond = np.where(high > low, (middle + size / 2 - high) / size, 0.0)
    return [(low, 1.0 - beyond), (high, beyond)]
