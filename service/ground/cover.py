"""What hides a target from above: areas of cover and a raster of factors, as one factor for each cell."""

from __future__ import annotations

import numpy as np
import pyproj

from service.area import Grid, SearchArea
from service.area.prior import cell_squares, covered_fraction
from service.area.projection import FloatArray
from service.config import Settings
from service.errors import BadInput

_SIDE = 4  # points along the side of a cell at which a raster is read


def visibility_of(area: SearchArea, grid: Grid, settings: Settings) -> FloatArray | None:
    """How much of what a look finds in the open it finds in each cell, float [rows, cols]; None: nothing hides.

    Where covers overlap the one drawn last counts; a cell is worth its parts. The raster's factor comes on top.
    Raises BadInput.
    """
    if not area.covers and not settings.ground.cover_file:
        return None
    visibility: FloatArray = np.ones(grid.frame.shape)
    squares = cell_squares(grid.frame) if area.covers else None
    for cover in area.covers:
        part = covered_fraction(squares, grid.frame.flatten(cover.polygon))
        visibility += part * (cover.visibility(settings.sensor.p_tp) - visibility)
    if settings.ground.cover_file:
        visibility *= _factors(settings.ground.cover_file, grid)
    return visibility


def _factors(file: str, grid: Grid) -> FloatArray:
    """The raster's factors over each cell, their mean; where it has none, 1."""
    try:
        import rasterio
        from rasterio.errors import RasterioIOError
    except ImportError:
        raise BadInput(
            f"{file}: reading a raster of cover needs rasterio; run pip install 'roisearch[geotiff]'"
        ) from None
    frame = grid.frame
    at = (np.arange(frame.cols * _SIDE) + 0.5) / _SIDE * frame.cell_m
    down = (np.arange(frame.rows * _SIDE) + 0.5) / _SIDE * frame.cell_m
    latlon = frame.from_metres(np.stack(np.meshgrid(at, down), axis=-1).reshape(-1, 2))
    try:
        with rasterio.open(file) as raster:
            if raster.crs is None or raster.count != 1 or raster.colorinterp[0].name == "palette":
                raise BadInput(
                    f"{file}: a raster of cover has one band of factors from 0 to 1 and a coordinate reference system"
                )
            forth = pyproj.Transformer.from_crs("EPSG:4326", raster.crs.to_wkt(), always_xy=True)
            x, y = forth.transform(latlon[:, 1], latlon[:, 0])
            back = ~raster.transform
            col = np.floor(back.a * np.asarray(x) + back.b * np.asarray(y) + back.c)
            row = np.floor(back.d * np.asarray(x) + back.e * np.asarray(y) + back.f)
            told = raster.read(1, masked=True).astype(np.float64) * raster.scales[0] + raster.offsets[0]
            values = np.asarray(told.filled(np.nan))
    except RasterioIOError as error:
        reason = str(error).splitlines()[0].rstrip(".")
        raise BadInput(f"{file}: not a readable raster of cover ({reason}); export it again") from None
    wrong = values[np.isfinite(values) & ((values < 0.0) | (values > 1.0))]
    if wrong.size:
        raise BadInput(
            f"{file}: has the factor {wrong[0]:g}; give what a look finds there, from 0 to 1 of the open"
        )
    inside = (row >= 0) & (row < values.shape[0]) & (col >= 0) & (col < values.shape[1])
    found = np.ones(len(latlon))
    found[inside] = np.nan_to_num(values[row[inside].astype(int), col[inside].astype(int)], nan=1.0)
    return np.asarray(found.reshape(frame.rows, _SIDE, frame.cols, _SIDE).mean(axis=(1, 3)))
