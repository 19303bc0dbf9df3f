"""What people call the places of a search: names from the area file for its regions, and where to write them on a map.

A region takes the name of the prior that lies there most densely: 'the burn' is said and not 'region 3'. A prior that
spreads over most of the area names nothing; a region without a name is called after its side of the area.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any, TypedDict

import numpy as np
import shapely

from service.area import SearchArea
from service.area.document import name_in
from service.area.frame import GridFrame
from service.area.model import LinePrior, PointPrior, PolygonPrior, Prior, prior_shape

SIDES = ("north", "north-east", "east", "south-east", "south", "south-west", "west", "north-west")
_WIDE = 0.5  # of the area: a prior that covers more says nothing about where
_SIGMAS = 2.0  # a point's place, for its name
_LEAST = 0.02  # of a prior's ground: less of it in a region does not name that
_MIDDLE = 0.15  # of the area's size: nearer to its middle is no side


class PlaceName(TypedDict):
    """A name of the area file with its place in degrees; `role` is "prior", "exclude" or "cover"."""

    name: str
    role: str
    lat: float
    lon: float


def place_names(area: SearchArea) -> list[PlaceName]:
    """The names of an area file and where they belong on a map."""
    parts: list[tuple[str, str, shapely.Geometry]] = [
        (each.label, "prior", prior_shape(each)) for each in area.priors
    ]
    parts += [(each.label, "exclude", each.polygon) for each in area.exclusions]
    parts += [(each.label, "cover", each.polygon) for each in area.covers]
    told: list[PlaceName] = []
    for label, role, shape in parts:
        wide = shape.area > _WIDE * area.polygon.area
        if (name := name_in(label)) and not wide:
            middle = shapely.point_on_surface(shape)
            told.append({"name": name, "role": role, "lat": float(middle.y), "lon": float(middle.x)})
    return told


def region_names(area: SearchArea, frame: GridFrame, outlines: Sequence[dict[str, Any]]) -> list[str]:
    """A name for each region of interest, region 1 first; no two are alike.

    Args:
        area: the checked area file.
        frame: the grid.
        outlines: the regions as features (`shapes.region_features`), numbered from 1 without gaps or with.
    """
    whole = frame.flatten(area.polygon)
    known = [(name_in(each.label), each.weight, extent) for each in area.priors
             if (extent := _extent(each, frame)).area <= _WIDE * whole.area]  # fmt: skip
    flat = {
        each["properties"]["number"]: frame.flatten(shapely.geometry.shape(each["geometry"]))
        for each in outlines
    }
    numbers = range(1, max(flat, default=0) + 1)
    plain = {number: _name(flat.get(number), known, whole, frame) for number in numbers}
    return _apart(plain, flat, frame)


def _name(
    region: shapely.Geometry | None,
    known: Sequence[tuple[str, float, shapely.Geometry]],
    whole: shapely.Geometry,
    frame: GridFrame,
) -> str:
    """The name of one region."""
    if region is None:
        return "open ground"
    shares = [
        (weight * share, name)
        for name, weight, extent in known
        if name and (share := shapely.intersection(region, extent).area / extent.area) >= _LEAST
    ]
    if shares:
        return max(shares)[1]
    side = _side(whole, region, frame)
    return f"open ground in the {side}" if side else "open ground in the middle"


def _side(whole: shapely.Geometry, part: shapely.Geometry, frame: GridFrame) -> str:
    """Where a part lies of a whole, as a point of the compass; empty: in its middle."""
    here, there = np.array(whole.centroid.coords[0]), np.array(part.centroid.coords[0])
    if np.linalg.norm(there - here) < _MIDDLE * np.sqrt(whole.area):
        return ""
    return _direction(here, there, frame)


def _direction(here: Any, there: Any, frame: GridFrame) -> str:
    east, south = there - here
    bearing = np.degrees(np.arctan2(east, -south)) + frame.bearing_deg
    return SIDES[round(float(bearing) / 45.0) % 8]


def _apart(plain: dict[int, str], flat: dict[int, shapely.Geometry], frame: GridFrame) -> list[str]:
    """Names of which no two are alike: those of one place are told apart by their sides, else by their numbers."""
    often = Counter(plain.values())
    named: dict[int, str] = {}
    for number, name in plain.items():
        if often[name] == 1 or number not in flat:
            named[number] = name
            continue
        others = [flat[each] for each, same in plain.items() if same == name and each in flat]
        here = np.mean([each.centroid.coords[0] for each in others], axis=0)
        named[number] = f"{name}, {_direction(here, np.array(flat[number].centroid.coords[0]), frame)}"
    often = Counter(named.values())
    return [name if often[name] == 1 else f"{name} ({number})" for number, name in named.items()]


def _extent(prior: Prior, frame: GridFrame) -> shapely.Geometry:
    """The ground that a prior's name stands for, in the grid's metres."""
    flat = frame.flatten(prior_shape(prior))
    if isinstance(prior, PolygonPrior):
        return flat
    if isinstance(prior, LinePrior):
        return shapely.buffer(flat, prior.width_m / 2)
    return shapely.buffer(
        flat, _SIGMAS * prior.sigma_m if isinstance(prior, PointPrior) else prior.rings_m[0]
    )
