"""Three grounds of our own that are hard to fly over, as height models with an area each.

Heights are functions of metres east and north of a corner, so that a flight over them can be judged without the
raster: what it clears is asked of the function.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
METRES_PER_DEGREE = 111_194.93
LAT, LON = 47.05, 8.3
BASE_M = 450.0
_PITCH_M, _AROUND_M = 8.0, 1300.0


@dataclass(frozen=True)
class SyntheticGround:
    """One ground.

    Attributes:
        name: what it is called.
        height: metres above the sea at metres east and north of the corner.
        size: the area's sides east and north, metres.
        launch: where the search starts, metres east and north.
    """

    name: str
    height: Callable[[Floats, Floats], Floats]
    size: tuple[float, float]
    launch: tuple[float, float]

    def launch_amsl_m(self) -> float:
        """The ground at the launch point."""
        east, north = self.launch
        return float(self.height(np.array([east]), np.array([north]))[0])


def _slope(east: Floats, north: Floats) -> Floats:
    """600 m up over the length of the area."""
    return BASE_M + 600.0 * np.clip(east / 1500.0, -0.3, 1.3) + 4.0 * np.sin(north / 35.0)


def _ridge(east: Floats, north: Floats) -> Floats:
    """A ridge of 110 m across the area, with a saddle."""
    crest = 110.0 - 45.0 * np.exp(-(((north - 120.0) / 60.0) ** 2))
    return BASE_M + crest * np.exp(-(((east - 400.0 + 0.2 * north) / 70.0) ** 2))


def _gorge(east: Floats, north: Floats) -> Floats:
    """A gorge 65 m deep along the area, with walls of about one in one and a bend."""
    middle = 150.0 + 50.0 * np.sin(east / 140.0)
    across = np.abs(north - middle)
    return BASE_M - 65.0 * (1.0 - np.clip((across - 30.0) / 65.0, 0.0, 1.0)) + 0.0 * east


GROUNDS = {
    each.name: each
    for each in (
        SyntheticGround("slope", _slope, (1500.0, 240.0), (-40.0, 60.0)),
        SyntheticGround("ridge", _ridge, (700.0, 400.0), (30.0, 30.0)),
        SyntheticGround("gorge", _gorge, (700.0, 300.0), (-30.0, 20.0)),
    )
}


def latlon(east: float, north: float) -> tuple[float, float]:
    """A place in degrees."""
    narrow = METRES_PER_DEGREE * math.cos(math.radians(LAT))
    return LAT + north / METRES_PER_DEGREE, LON + east / narrow


def metres(lat: Floats, lon: Floats) -> tuple[Floats, Floats]:
    """East and north of the corner."""
    narrow = METRES_PER_DEGREE * math.cos(math.radians(LAT))
    return (lon - LON) * narrow, (lat - LAT) * METRES_PER_DEGREE


def area(ground: SyntheticGround) -> dict[str, Any]:
    """The area file: the ground's rectangle, likely at three places, and its launch point."""
    width, depth = ground.size

    def place(east: float, north: float) -> list[float]:
        lat, lon = latlon(east, north)
        return [lon, lat]

    def feature(geometry: dict[str, Any], **properties: Any) -> dict[str, Any]:
        return {"type": "Feature", "properties": properties, "geometry": geometry}

    ring = [place(*corner) for corner in ((0, 0), (width, 0), (width, depth), (0, depth), (0, 0))]
    spots = [(0.35, 0.5), (0.6, 0.7), (0.9, 0.4)]
    return {
        "type": "FeatureCollection",
        "features": [
            feature({"type": "Polygon", "coordinates": [ring]}, name=ground.name, outside=0.02),
            *(
                feature({"type": "Point", "coordinates": place(x * width, y * depth)}, role="prior", sigma_m=45.0)
                for x, y in spots
            ),
            feature({"type": "Point", "coordinates": place(*ground.launch)}, role="launch"),
        ],
    }  # fmt: skip


def write(ground: SyntheticGround, folder: Path) -> tuple[Path, Path]:
    """Write area and height model (a GeoTIFF in degrees) into a folder; returns their paths."""
    folder.mkdir(parents=True, exist_ok=True)
    area_file, dem = folder / f"{ground.name}.geojson", folder / f"{ground.name}.tif"
    area_file.write_text(json.dumps(area(ground)), encoding="utf-8")
    write_heights(ground, dem)
    return area_file, dem


def write_heights(ground: SyntheticGround, dem: Path) -> None:
    """Write a ground's height model, far beyond its area on all sides, as a GeoTIFF in degrees."""
    import rasterio
    from rasterio.transform import from_origin

    east = np.arange(-_AROUND_M, ground.size[0] + _AROUND_M, _PITCH_M)
    north = np.arange(ground.size[1] + _AROUND_M, -_AROUND_M, -_PITCH_M)
    x, y = np.meshgrid(east, north)
    values = ground.height(x.ravel(), y.ravel()).reshape(x.shape)
    side_lat = _PITCH_M / METRES_PER_DEGREE
    side_lon = side_lat / math.cos(math.radians(LAT))
    top, left = latlon(float(east[0]), float(north[0]))
    with rasterio.open(
        dem, "w", driver="GTiff", width=len(east), height=len(north), count=1, dtype="float32", crs="EPSG:4326",
        transform=from_origin(left - side_lon / 2, top + side_lat / 2, side_lon, side_lat), compress="deflate",
    ) as raster:  # fmt: skip
        raster.write(values.astype("float32"), 1)
        raster.units = ("metre",)
