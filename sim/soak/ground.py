"""The ground of the soak, and where an aircraft over it may be sent: worked out apart from the service."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import shapely

LatLon = tuple[float, float]
_METRES_PER_DEGREE = 111_194.93
_LAT, _LON = 47.05, 8.3


def _ring(corners: Sequence[tuple[float, float]]) -> list[list[float]]:
    """(east, north) in metres from the south-west corner, as longitude and latitude, closed."""
    narrow = _METRES_PER_DEGREE * math.cos(math.radians(_LAT))
    ring = [[_LON + east / narrow, _LAT + north / _METRES_PER_DEGREE] for east, north in corners]
    return [*ring, ring[0]]


# An L of 260 x 200 m with something in it that is not flown over, and a launch point outside.
FIELD = [(0.0, 0.0), (260.0, 0.0), (260.0, 200.0), (140.0, 200.0), (140.0, 110.0), (0.0, 110.0)]
POND = [(60.0, 40.0), (100.0, 40.0), (100.0, 75.0), (60.0, 75.0)]
LAUNCH = (-20.0, 10.0)
CELL_M, HEIGHT_M, GROUND_AMSL_M, MARGIN_M = 20.0, 15.0, 400.0, 30.0
BOUNDS = {
    "south": _LAT,
    "west": _LON,
    "north": _LAT + 110.0 / _METRES_PER_DEGREE,
    "east": _LON + 0.0018,
}


def launch() -> LatLon:
    """The launch point (latitude, longitude)."""
    lon, lat = _ring([LAUNCH])[0]
    return lat, lon


def area() -> dict[str, Any]:
    """The area file."""
    lat, lon = launch()

    def feature(geometry: dict[str, Any], **properties: Any) -> dict[str, Any]:
        return {"type": "Feature", "properties": properties, "geometry": geometry}

    return {
        "type": "FeatureCollection",
        "features": [
            feature({"type": "Polygon", "coordinates": [_ring(FIELD)]}, name="soak", outside=0.1),
            feature({"type": "Polygon", "coordinates": [_ring(POND)]}, role="exclude"),
            feature({"type": "Point", "coordinates": [lon, lat]}, role="launch"),
        ],
    }


def metres(point: LatLon) -> tuple[float, float]:
    """(east, north) of the south-west corner, in metres."""
    lat, lon = point
    east = (lon - _LON) * _METRES_PER_DEGREE * math.cos(math.radians(_LAT))
    return east, (lat - _LAT) * _METRES_PER_DEGREE


_AREA, _POND = shapely.Polygon(FIELD), shapely.Polygon(POND)
_SEARCH = _AREA.buffer(MARGIN_M + 2.0)
_WAY = shapely.union_all([_AREA, _POND, shapely.Point(LAUNCH)]).convex_hull.buffer(MARGIN_M + 2.0)
_KEPT_OUT = _POND.buffer(-2.0)  # the service keeps 5 m; positions on the wire are as old as the wire is slow


def why_not(here: LatLon, there: LatLon, *, searching: bool) -> str:
    """Why an aircraft at one place must not be sent to another, or nothing."""
    start, end = shapely.Point(metres(here)), shapely.Point(metres(there))
    leg = shapely.LineString([start, end])
    zone = _SEARCH if searching else _WAY
    if not zone.contains(end):
        return f"{end.distance(_AREA):.0f} m outside the area"
    if _WAY.contains(start) and not _WAY.contains(leg):
        return "the leg leaves the way from and to the area"
    if leg.intersects(_KEPT_OUT) and not _POND.buffer(6.0).contains(start):
        return "the leg crosses the pond"
    if _KEPT_OUT.contains(end):
        return "in the pond"
    return ""
