"""The rasters of a run as one GeoTIFF: where the target may be now, how well was searched, and what was believed first.

A pixel is a cell: nothing is resampled, so the sums are those of the search. The grid is turned, and so is the
raster: its corner and axes stand in the file's affine transform (ModelTransformationTag), in metres of the azimuthal
equidistant plane around the area, which the file describes in full. GDAL and QGIS place it on any map.
"""

from __future__ import annotations

import math

import numpy as np

from service.area.frame import GridFrame
from service.area.geotiff import POA_BAND
from service.errors import BadInput
from service.export.features import iso
from service.export.model import ExportedRun
from service.export.wishes import Wishes

NODATA = -1.0
BANDS = (
    (POA_BAND, "probability of area: that the target is in the cell, now"),
    ("POD", "probability of detection: that the looks so far would have found it there"),
    ("prior", "probability of area before the search"),
)


def write(run: ExportedRun, wishes: Wishes) -> bytes:
    """Three float64 bands, `NODATA` where nothing is searched; POA and prior sum to 1 with what is outside."""
    try:
        from rasterio.crs import CRS
        from rasterio.io import MemoryFile
        from rasterio.transform import Affine
    except ImportError:
        raise BadInput("writing a GeoTIFF needs rasterio; run pip install 'roisearch[geotiff]'") from None
    frame, grid = run.frame, run.grid
    bands = (run.poa, run.pod, grid.prior * (1.0 - grid.outside))
    tags = {
        "TIFFTAG_SOFTWARE": "roisearch",
        "TIFFTAG_IMAGEDESCRIPTION": f"{run.area.name}: {run.summary}",
        "as_of": iso(run.last),
        "pos": repr(run.pos),
        "outside": repr(run.belief.outside),
    }
    with MemoryFile() as memory:
        with memory.open(
            driver="GTiff",
            width=frame.cols,
            height=frame.rows,
            count=len(bands),
            dtype="float64",
            crs=CRS.from_proj4(plane(frame)),
            transform=Affine(*affine(frame)),
            nodata=NODATA,
            compress="deflate",
        ) as raster:
            raster.update_tags(**tags)
            for number, ((name, about), values) in enumerate(zip(BANDS, bands, strict=True), 1):
                raster.write(np.where(grid.searchable, values, NODATA), number)
                raster.set_band_description(number, name)
                raster.update_tags(number, about=about)
        return bytes(memory.read())


def plane(frame: GridFrame) -> str:
    """The plane under the grid as PROJ writes it."""
    return f"+proj=aeqd +lat_0={frame.lat!r} +lon_0={frame.lon!r} +datum=WGS84 +units=m +no_defs"


def affine(frame: GridFrame) -> tuple[float, float, float, float, float, float]:
    """(a, b, c, d, e, f): x = a col + b row + c, y = d col + e row + f in metres of the plane, pixel corners."""
    turn = math.radians(frame.bearing_deg)
    sin, cos = math.sin(turn), math.cos(turn)
    west, north, cell = frame.west_m, frame.north_m, frame.cell_m
    return (
        cell * cos,
        -cell * sin,
        west * cos + north * sin,
        -cell * sin,
        -cell * cos,
        north * cos - west * sin,
    )
