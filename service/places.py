"""Places in the words of a team: decimal degrees, degrees and minutes, UTM, MGRS (USNG), or the grid of Great Britain.

`run.coordinates` chooses; report, terminal, page and the texts of exports keep to it, while files for programs stay in
degrees. The arithmetic is PROJ's (pyproj), GeoTrans' (mgrs) and Ordnance Survey's own (osbng), none of it ours.
"""

from __future__ import annotations

import math
import threading
from functools import lru_cache
from typing import Literal

import pyproj

from service.geometry import LatLon, wrapped_deg

Coordinates = Literal["degrees", "minutes", "utm", "mgrs", "osgb"]

_OS_EXTENT = (49.75, 61.01, -9.01, 2.01)
"""South, north, west, east of EPSG:27700, the National Grid, beyond which there are no references."""
_UTM_SOUTH, _UTM_NORTH = -80.0, 84.0


def written(place: LatLon, how: Coordinates) -> str:
    """A place (latitude, longitude) as text; in degrees where the grid that was asked for does not go.

    Degrees have six decimals (0.1 m), minutes three (2 m), UTM and MGRS metres. A reference of the National Grid has
    eight figures (10 m), as PROJ without the Ordnance Survey's table of shifts is good to a few metres.
    """
    lat, lon = place[0], wrapped_deg(place[1])
    if not (math.isfinite(lat) and math.isfinite(lon) and abs(lat) <= 90.0):
        return f"{lat:.6f}, {lon:.6f}"
    try:
        return _in_grid(lat, lon, how) or f"{lat:.6f}, {lon:.6f}"
    except (ValueError, RuntimeError):  # what a library does not know is no reason to say nothing
        return f"{lat:.6f}, {lon:.6f}"


def _in_grid(lat: float, lon: float, how: Coordinates) -> str | None:
    """A place as asked for; None in degrees, and where the grid does not go."""
    if how == "minutes":
        return f"{_minutes(lat, 2, 'NS')}, {_minutes(lon, 3, 'EW')}"
    if how == "utm" and _UTM_SOUTH <= lat < _UTM_NORTH:
        zone, band = _zone(lat, lon)
        east, north = _utm(zone, band < "N", threading.get_ident()).transform(lon, lat)
        return f"{zone}{band} {east:.0f} {north:.0f}"
    if how == "mgrs":
        text = _mgrs(lat, lon)
        square, figures = text[:-10], text[-10:]
        return f"{square[:-2]} {square[-2:]} {figures[:5]} {figures[5:]}"
    if how == "osgb" and _OS_EXTENT[0] <= lat <= _OS_EXTENT[1] and _OS_EXTENT[2] <= lon <= _OS_EXTENT[3]:
        return _os_grid(lat, lon)
    return None


def _minutes(angle: float, digits: int, sides: str) -> str:
    thousandths = round(abs(angle) * 60_000.0)
    degrees, rest = divmod(thousandths, 60_000)
    return f"{degrees:0{digits}d}° {rest / 1000.0:06.3f}′ {sides[angle < 0.0]}"


def _mgrs(lat: float, lon: float) -> str:
    import mgrs

    try:
        text: str = mgrs.MGRS().toMGRS(lat, lon, MGRSPrecision=5)
    except Exception as error:  # its own, which derives from nothing else
        raise ValueError(str(error)) from error
    return text


def _zone(lat: float, lon: float) -> tuple[int, str]:
    """The UTM zone with its exceptions (Norway, Svalbard), and the band of latitude, as MGRS has them."""
    head = _mgrs(lat, lon)[:-12]
    return int(head[:-1]), head[-1]


@lru_cache(maxsize=32)
def _utm(zone: int, south: bool, thread: int) -> pyproj.Transformer:
    """PROJ objects may not be used by two threads at once, so each thread has its own."""
    return pyproj.Transformer.from_crs(4326, (32700 if south else 32600) + zone, always_xy=True)


@lru_cache(maxsize=8)
def _british(thread: int) -> pyproj.Transformer:
    return pyproj.Transformer.from_crs(4326, 27700, always_xy=True)


def _os_grid(lat: float, lon: float) -> str | None:
    from osbng.errors import BNGExtentError
    from osbng.indexing import xy_to_bng

    east, north = _british(threading.get_ident()).transform(lon, lat)
    try:
        return str(xy_to_bng(east, north, "10m").bng_ref_formatted)
    except BNGExtentError:  # the grid's rectangle is smaller than its extent in degrees
        return None
