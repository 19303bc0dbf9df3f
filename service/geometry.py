"""Places, cells, and the short distances between places: the one file that knows how long a degree is, and that
longitude begins anew at 180 degrees.

What is laid over a whole area uses a projection (`service.area.projection`). This is for an aircraft and what is
within a few kilometres of it, on a sphere, good to 0.3 %.
"""

from __future__ import annotations

import math

Cell = tuple[int, int]
"""Row and column in the grid."""
LatLon = tuple[float, float]
"""Latitude and longitude in degrees."""
Metres = tuple[float, float]
"""East and north of some point."""

METRES_PER_DEGREE = 111_194.93
"""Of latitude, and of longitude on the equator: a sphere of 6371 km (IUGG mean radius)."""
_LEAST_NARROWING = 1e-6  # at a pole, where all meridians meet


def turn_deg(start: float, end: float) -> float:
    """From one angle or longitude to another the short way, in degrees from -180 up to 180."""
    return (end - start + 180.0) % 360.0 - 180.0


def wrapped_deg(angle: float) -> float:
    """The same angle or longitude between -180 and 180; what is there already stays to the last bit."""
    return angle if -180.0 <= angle <= 180.0 else (angle + 180.0) % 360.0 - 180.0


def narrowing(lat: float) -> float:
    """How much shorter a degree of longitude is at a latitude than on the equator; never 0."""
    return max(math.cos(math.radians(lat)), _LEAST_NARROWING)


def offset_m(start: LatLon, end: LatLon) -> Metres:
    """How far one place is east and north of another, in metres."""
    east = turn_deg(start[1], end[1]) * METRES_PER_DEGREE * narrowing((start[0] + end[0]) / 2.0)
    return east, (end[0] - start[0]) * METRES_PER_DEGREE


def distance_m(start: LatLon, end: LatLon) -> float:
    """Metres between two places."""
    return math.hypot(*offset_m(start, end))


def moved(start: LatLon, east_m: float, north_m: float) -> LatLon:
    """The place that is so far east and north of another."""
    lat, lon = start
    east_deg = east_m / (METRES_PER_DEGREE * narrowing(lat))
    return lat + north_m / METRES_PER_DEGREE, wrapped_deg(lon + east_deg)


def between(start: LatLon, end: LatLon, share: float) -> LatLon:
    """The place at a share of the way from one to another, the short way around."""
    lon = start[1] + share * turn_deg(start[1], end[1])
    return start[0] + share * (end[0] - start[0]), wrapped_deg(lon)
