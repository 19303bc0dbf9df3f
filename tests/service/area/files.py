"""Small area files for the tests: GeoJSON values, positions as (longitude, latitude)."""

import json
from typing import Any

from service.area import SearchArea, parse_area
from service.area.projection import Projection

Json = dict[str, Any]

HERE = (47.0, 11.0)
"""(latitude, longitude) of the middle of most test areas."""


def at(east: float, north: float, centre: tuple[float, float] = HERE) -> list[float]:
    """[longitude, latitude] of a point given in metres from a centre."""
    lat, lon = Projection(*centre).inverse([[east, north]])[0]
    return [float(lon), float(lat)]


def ring(corners: list[tuple[float, float]], centre: tuple[float, float] = HERE) -> list[list[float]]:
    """A closed ring of positions through corners in metres from a centre."""
    return [at(east, north, centre) for east, north in [*corners, corners[0]]]


def box(
    west: float, south: float, east: float, north: float, centre: tuple[float, float] = HERE
) -> list[list[float]]:
    """A closed rectangle, in metres from a centre."""
    return ring([(west, south), (east, south), (east, north), (west, north)], centre)


def polygon(*rings: list[list[float]]) -> Json:
    return {"type": "Polygon", "coordinates": list(rings)}


def point(position: list[float]) -> Json:
    return {"type": "Point", "coordinates": position}


def feature(geometry: Any, **properties: Any) -> Json:
    return {"type": "Feature", "properties": properties, "geometry": geometry}


def collection(*features: Any, **members: Any) -> Json:
    return {"type": "FeatureCollection", **members, "features": list(features)}


def square(half: float = 200.0, centre: tuple[float, float] = HERE) -> Json:
    """The search area most tests use: a square of 2 x half metres."""
    return feature(polygon(box(-half, -half, half, half, centre)), role="search")


def parse(value: Any, **limits: float) -> SearchArea:
    """Check a GeoJSON value as if it were read from 'field.geojson'."""
    return parse_area(json.dumps(value).encode(), source="field.geojson", **limits)
