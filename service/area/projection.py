"""Degrees to metres on a plane around one point.

The projection is azimuthal equidistant on the WGS84 ellipsoid. Distances from its centre
are exact; across the radius they are stretched by c / sin(c) = 1 + c²/6, where c is the
distance from the centre over the earth's radius: 1.6e-6 at 20 km, 6.6e-6 at 40 km, the same
at every latitude and in every direction. Transverse Mercator stretches by 1 + c²/2 at c east
or west of its meridian, three times as much, so the demanded 1e-5 would end at 28 km.
"""

import threading
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import pyproj
import shapely
from numpy.typing import ArrayLike, NDArray
from shapely.geometry.polygon import orient

FloatArray = NDArray[np.float64]

REACH_M = 40_000.0
"""How far from the centre distances are good to 1e-5; areas that reach further are refused."""

_EDGE_STEP_DEG = 0.01
"""Edges are straight in longitude and latitude (RFC 7946, section 3.1.1), not on the plane: cut to
pieces of this length, the two differ by less than 0.1 m wherever we search."""

_GEOD = pyproj.Geod(ellps="WGS84")


def surface_m2(polygon: shapely.MultiPolygon) -> float:
    """The surface of polygons in degrees on the ellipsoid, holes taken off, in square metres."""
    return sum(abs(_GEOD.geometry_area_perimeter(orient(part))[0]) for part in polygon.geoms)


@lru_cache(maxsize=64)
def _proj(lat: float, lon: float, thread: int) -> pyproj.Proj:
    """PROJ objects may not be used by two threads at once, so each thread has its own."""
    return pyproj.Proj(proj="aeqd", lat_0=lat, lon_0=lon, ellps="WGS84", units="m")


@dataclass(frozen=True)
class Projection:
    """The plane that touches the earth at (`lat`, `lon`)."""

    lat: float
    lon: float

    def forward(self, latlon: ArrayLike) -> FloatArray:
        """Positions [k, 2] (latitude, longitude) to metres [k, 2] (east, north)."""
        points = np.asarray(latlon, dtype=np.float64).reshape(-1, 2)
        east, north = _proj(self.lat, self.lon, threading.get_ident())(points[:, 1], points[:, 0])
        return np.stack([east, north], axis=1)

    def inverse(self, metres: ArrayLike) -> FloatArray:
        """Metres [k, 2] (east, north) to positions [k, 2] (latitude, longitude)."""
        points = np.asarray(metres, dtype=np.float64).reshape(-1, 2)
        lon, lat = _proj(self.lat, self.lon, threading.get_ident())(points[:, 0], points[:, 1], inverse=True)
        return np.stack([lat, lon], axis=1)

    def flatten(self, shape: shapely.Geometry) -> shapely.Geometry:
        """A geometry in degrees (x = longitude) as one in metres (x = east, y = north)."""
        dense = shapely.segmentize(shape, _EDGE_STEP_DEG)
        flat = shapely.transform(dense, lambda points: self.forward(points[:, ::-1]))
        return flat if shapely.is_valid(flat) else shapely.make_valid(flat)

    @classmethod
    def around(cls, shape: shapely.Geometry) -> "Projection":
        """The plane that touches the earth in the middle of a geometry in degrees."""
        west, south, east, north = shapely.bounds(shape)
        return cls(lat=float((south + north) / 2), lon=float((west + east) / 2))
