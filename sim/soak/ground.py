"""The ground of the soak, and where an aircraft over it may be sent: worked out apart from the service."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import shapely

from sim.grounds import Floats, SyntheticGround

LatLon = tuple[float, float]
_METRES_PER_DEGREE = 111_194.93
_LAT, _LON = 47.05, 8.3


def ring(corners: Sequence[tuple[float, float]]) -> list[list[float]]:
    """(east, north) in metres from the south-west corner, as longitude and latitude, closed."""
    narrow = _METRES_PER_DEGREE * math.cos(math.radians(_LAT))
    ring = [[_LON + east / narrow, _LAT + north / _METRES_PER_DEGREE] for east, north in corners]
    return [*ring, ring[0]]


# An L of 260 x 200 m with something in it that is not flown over, and a launch point outside.
FIELD = [(0.0, 0.0), (260.0, 0.0), (260.0, 200.0), (140.0, 200.0), (140.0, 110.0), (0.0, 110.0)]
POND = [(60.0, 40.0), (100.0, 40.0), (100.0, 75.0), (60.0, 75.0)]
MARSH = [(170.0, 20.0), (205.0, 20.0), (205.0, 60.0), (170.0, 60.0)]  # told in flight, and taken back
LAUNCH = (-20.0, 10.0)
CELL_M, HEIGHT_M, GROUND_AMSL_M, MARGIN_M = 20.0, 15.0, 400.0, 30.0
ENDURANCE_S = 600.0  # of the aircraft's battery
CLEARANCE_M = 8.0  # of the ground, where there is a hill
_SLOPPY_M = 2.0  # of it: how far a multirotor sinks or overshoots in passing
BOUNDS = {
    "south": _LAT,
    "west": _LON,
    "north": _LAT + 110.0 / _METRES_PER_DEGREE,
    "east": _LON + 0.0018,
}


def _hill(east: Floats, north: Floats) -> Floats:
    """Lower than the search is high above the launch point, so that a pilot who flies level meets no ground."""
    return GROUND_AMSL_M + 11.0 * np.exp(-((east - 200.0) ** 2 + (north - 80.0) ** 2) / (2.0 * 25.0**2))


HILL = SyntheticGround("hill", _hill, (260.0, 200.0), LAUNCH)
"""The ground of half of all flights; that of the others is flat, and they have no height model."""


def launch() -> LatLon:
    """The launch point (latitude, longitude)."""
    lon, lat = ring([LAUNCH])[0]
    return lat, lon


def area() -> dict[str, Any]:
    """The area file."""
    lat, lon = launch()

    def feature(geometry: dict[str, Any], **properties: Any) -> dict[str, Any]:
        return {"type": "Feature", "properties": properties, "geometry": geometry}

    return {
        "type": "FeatureCollection",
        "features": [
            feature({"type": "Polygon", "coordinates": [ring(FIELD)]}, name="soak", outside=0.1),
            feature({"type": "Polygon", "coordinates": [ring(POND)]}, role="exclude"),
            feature({"type": "Point", "coordinates": [lon, lat]}, role="launch"),
        ],
    }


def square(side_m: float) -> dict[str, Any]:
    """The area file of a square, with the launch point of the field beside it."""
    lat, lon = launch()
    corners = [(0.0, 0.0), (side_m, 0.0), (side_m, side_m), (0.0, side_m)]
    shapes: list[tuple[dict[str, Any], dict[str, Any]]] = [
        ({"type": "Polygon", "coordinates": [ring(corners)]}, {"name": "square"}),
        ({"type": "Point", "coordinates": [lon, lat]}, {"role": "launch"}),
    ]
    features = [{"type": "Feature", "properties": each, "geometry": shape} for shape, each in shapes]
    return {"type": "FeatureCollection", "features": features}


def metres(point: LatLon) -> tuple[float, float]:
    """(east, north) of the south-west corner, in metres."""
    lat, lon = point
    east = (lon - _LON) * _METRES_PER_DEGREE * math.cos(math.radians(_LAT))
    return east, (lat - _LAT) * _METRES_PER_DEGREE


_AREA, _POND = shapely.Polygon(FIELD), shapely.Polygon(POND)
_SEARCH = _AREA.buffer(MARGIN_M + 2.0)
_WAY = shapely.union_all([_AREA, _POND, shapely.Point(LAUNCH)]).convex_hull.buffer(MARGIN_M + 2.0)
_LOW = 0.6  # of the height it searches at
_SLACK_M, _INSIDE_M = 2.0, 6.0  # the service keeps 5 m; positions on the wire are as old as the wire is slow
_KEPT_OUT = _POND.buffer(-_SLACK_M)
_MARSH = shapely.Polygon(MARSH)


def rise(here: LatLon, *, hill: bool) -> float:
    """How much higher the ground is here than at the launch point."""
    if not hill:
        return 0.0
    east, north = (np.array([each]) for each in metres(here))
    return float(HILL.height(east, north)[0]) - HILL.launch_amsl_m()


def too_close(here: LatLon, up: float, *, hill: bool = False) -> str:
    """Why an aircraft that searches is where it must not be, `up` metres above the ground below it, or nothing."""
    if up < (CLEARANCE_M - _SLOPPY_M if hill else _LOW * HEIGHT_M):
        return f"{up:.1f} m above the ground"
    if _KEPT_OUT.contains(shapely.Point(metres(here))):
        return "over the pond"
    return ""


def wrong_height(there: LatLon, up: float, *, hill: bool) -> str:
    """Why an aircraft must not be sent so many metres above the launch point, or nothing."""
    if not hill:
        return f"{up:.1f} m above home" if abs(up - HEIGHT_M) > 1.0 else ""
    above = up - rise(there, hill=True)
    lowest, highest = CLEARANCE_M - 0.5, 2.0 * HEIGHT_M + CLEARANCE_M
    return "" if lowest <= above <= highest else f"{above:.1f} m above the ground"


def why_not(here: LatLon, there: LatLon, *, searching: bool, marsh: bool = False) -> str:
    """Why an aircraft at one place must not be sent to another, or nothing; `marsh`: that is excluded by now."""
    start, end = shapely.Point(metres(here)), shapely.Point(metres(there))
    leg = shapely.LineString([start, end])
    zone = _SEARCH if searching else _WAY
    if not zone.contains(end):
        return f"{end.distance(_AREA):.0f} m outside the area"
    if _WAY.contains(start) and not _WAY.contains(leg):
        return "the leg leaves the way from and to the area"
    for name, water in (("pond", _POND), ("marsh", _MARSH))[: 2 if marsh else 1]:
        kept_out = water.buffer(-_SLACK_M)
        if leg.intersects(kept_out) and not water.buffer(_INSIDE_M).contains(start):
            return f"the leg crosses the {name}"
        if kept_out.contains(end):
            return f"in the {name}"
    return ""
