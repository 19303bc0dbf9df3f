"""A raster of factors from 0 to 1 as its mean over each cell: what hides a target, how well the ground is walked."""

from __future__ import annotations

import numpy as np
import pyproj

from service.area.frame import GridFrame
from service.area.projection import FloatArray
from service.errors import BadInput

_SIDE = 4  # points along the side of a cell at which a raster is read


def read_factors(file: str, frame: GridFrame, *, of: str, meaning: str) -> FloatArray:
    """The factors over each cell, float [rows, cols], 0 to 1; where the raster has none, 1.

    Args:
        file: a raster of one band that rasterio opens, in any coordinate reference system.
        frame: the cells.
        of: what it is a raster of, for messages.
        meaning: what a factor says, for messages.

    Raises:
        BadInput: rasterio is not installed, or the file is no such raster.
    """
    try:
        import rasterio
        from rasterio.errors import RasterioIOError
    except ImportError:
        raise BadInput(
            f"{file}: reading a raster of {of} needs rasterio; run pip install 'roisearch[geotiff]'"
        ) from None
    at = (np.arange(frame.cols * _SIDE) + 0.5) / _SIDE * frame.cell_m
    down = (np.arange(frame.rows * _SIDE) + 0.5) / _SIDE * frame.cell_m
    latlon = frame.from_metres(np.stack(np.meshgrid(at, down), axis=-1).reshape(-1, 2))
    try:
        with rasterio.open(file) as raster:
            if raster.crs is None or raster.count != 1 or raster.colorinterp[0].name == "palette":
                raise BadInput(
                    f"{file}: a raster of {of} has one band of factors from 0 to 1 and a coordinate reference system"
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
        raise BadInput(f"{file}: not a readable raster of {of} ({reason}); export it again") from None
    wrong = values[np.isfinite(values) & ((values < 0.0) | (values > 1.0))]
    if wrong.size:
        raise BadInput(f"{file}: has the factor {wrong[0]:g}; give {meaning}")
    inside = (row >= 0) & (row < values.shape[0]) & (col >= 0) & (col < values.shape[1])
    found = np.ones(len(latlon))
    found[inside] = np.nan_to_num(values[row[inside].astype(int), col[inside].astype(int)], nan=1.0)
    return np.asarray(found.reshape(frame.rows, _SIDE, frame.cols, _SIDE).mean(axis=(1, 3)))
