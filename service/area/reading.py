"""From an area file to a checked `SearchArea`: roles, weights, limits."""

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from service.area.geojson import (
    Where,
    as_multipolygon,
    check_crs,
    load_json,
    multipolygon,
    number,
    position,
    quote,
    read_bytes,
)
from service.area.model import Exclusion, LatLon, PointPrior, PolygonPrior, Prior, SearchArea
from service.area.projection import REACH_M, Projection, surface_m2

ROLES = {
    "search": ("Polygon", "MultiPolygon"),
    "prior": ("Polygon", "MultiPolygon", "Point"),
    "exclude": ("Polygon", "MultiPolygon"),
    "launch": ("Point",),
}
"""The geometry types that each `properties.role` may have."""

POLYGONS = ("Polygon", "MultiPolygon")
GEOMETRY_TYPES = (*POLYGONS, "Point", "MultiPoint", "LineString", "MultiLineString", "GeometryCollection")
MAX_LAUNCH_M = 2000.0
MAX_LATITUDE = 85.0
FAR_SIGMAS = 4.0
"""A point prior further than this from the area says nothing about where in the area the target is."""


def read_area(
    path: str | Path, *, max_area_km2: float = 100.0, max_launch_m: float = MAX_LAUNCH_M
) -> SearchArea:
    """Read and check an area file (RFC 7946 GeoJSON, WGS84).

    A bare Polygon or MultiPolygon, a Feature, or a FeatureCollection. A polygon without
    `properties.role` is the search area. A prior without `weight` has weight 1.

    Args:
        path: the file.
        max_area_km2: the largest surface of the search area, in square kilometres.
        max_launch_m: how far the launch point may be from the search area, in metres.

    Raises:
        BadInput: one sentence with the file, the feature and the fix.
    """
    return parse_area(
        read_bytes(path), source=str(path), max_area_km2=max_area_km2, max_launch_m=max_launch_m
    )


def parse_area(
    data: bytes, *, source: str, max_area_km2: float = 100.0, max_launch_m: float = MAX_LAUNCH_M
) -> SearchArea:
    """`read_area` for content that is already in memory; `source` names it in messages."""
    where = Where(source)
    parts = _collect(load_json(data, where), where)
    if not parts.search:
        raise where.bad("the search area is empty: no Polygon has the role 'search'; draw one")
    polygon = as_multipolygon(shapely.union_all(parts.search))
    taken = shapely.union_all([item.polygon for item in parts.exclusions if not item.searchable])
    ground = as_multipolygon(shapely.difference(polygon, taken))
    if ground.is_empty:
        raise where.bad("the exclusions cover the whole search area; make them smaller or the area larger")
    _check_extent(polygon, where, max_area_km2)
    area = SearchArea(
        source=source,
        name=parts.name or Path(source).stem,
        description=parts.description,
        polygon=polygon,
        ground=ground,
        priors=tuple(parts.priors),
        exclusions=tuple(parts.exclusions),
        launch=parts.launch,
        outside=parts.outside or 0.0,
    )
    check_launch(area, parts.launch_where, max_launch_m)
    _check_priors(area)
    return area


@dataclass
class _Parts:
    """What the features add up to while they are read."""

    name: str = ""
    description: str = ""
    search: list[shapely.MultiPolygon] = field(default_factory=list)
    priors: list[Prior] = field(default_factory=list)
    exclusions: list[Exclusion] = field(default_factory=list)
    launch: LatLon | None = None
    launch_where: Where = field(default_factory=lambda: Where(""))
    outside: float | None = None


def _collect(root: dict[str, Any], where: Where) -> _Parts:
    parts = _Parts(name=_text(root, "name"), description=_text(root, "description"))
    check_crs(root, where)
    kind = root.get("type")
    if kind == "FeatureCollection":
        features = root.get("features")
        if not isinstance(features, list):
            raise where.bad("a FeatureCollection needs a list of 'features'; export the file again")
        _take_outside(parts, root, where)
        for index, feature in enumerate(features):
            _take_feature(parts, feature, _where_feature(where, index, feature))
    elif kind == "Feature":
        _take_outside(parts, root, where)
        _take_feature(parts, root, Where(where.source, "the feature"))
    elif isinstance(kind, str) and kind in GEOMETRY_TYPES:
        _take_outside(parts, root, where)
        _take_feature(parts, {"type": "Feature", "geometry": root}, Where(where.source, "the geometry"))
    else:
        raise where.bad(f"not GeoJSON: 'type' is {quote(kind)}; give a FeatureCollection, Feature or Polygon")
    return parts


def _where_feature(where: Where, index: int, feature: object) -> Where:
    label: object = None
    if isinstance(feature, dict):
        properties = feature.get("properties")
        label = properties.get("name") if isinstance(properties, dict) else None
        label = feature.get("id") if label is None else label
    shown = "" if label is None else f" ({quote(label)})"
    return Where(where.source, f"features[{index}]{shown}")


def _take_feature(parts: _Parts, feature: object, where: Where) -> None:
    if not isinstance(feature, dict) or feature.get("type") != "Feature":
        raise where.bad('not a GeoJSON Feature; each item of \'features\' needs "type": "Feature"')
    check_crs(feature, where)
    geometry = feature.get("geometry")
    if not isinstance(geometry, dict) or geometry.get("type") not in GEOMETRY_TYPES:
        kind = geometry.get("type") if isinstance(geometry, dict) else geometry
        raise where.bad(f"its geometry is {quote(kind)}; draw a Polygon, MultiPolygon or Point")
    check_crs(geometry, where)
    properties = feature.get("properties")
    if properties is None:
        properties = {}
    if not isinstance(properties, dict):
        raise where.bad("its 'properties' must be an object or null; export the file again")

    role = _role(properties, geometry["type"], where)
    if role == "search":
        parts.search.append(multipolygon(geometry, where))
        parts.name = parts.name or _text(properties, "name")
        parts.description = parts.description or _text(properties, "description")
        _take_outside(parts, properties, where)
        return
    if "outside" in properties:
        raise where.bad("'outside' belongs to the search area; move it to the feature with the role 'search'")
    if role == "exclude":
        searchable = properties.get("searchable", False)
        if not isinstance(searchable, bool):
            raise where.bad(f"searchable is {quote(searchable)}; write true or false")
        parts.exclusions.append(Exclusion(multipolygon(geometry, where), searchable, where.part))
    elif role == "prior":
        parts.priors.append(_prior(properties, geometry, where))
    else:
        if parts.launch is not None:
            raise where.bad("this is a second launch point; keep one")
        lon, lat = position(geometry.get("coordinates"), where)
        parts.launch, parts.launch_where = (lat, lon), where


def _role(properties: dict[str, Any], kind: str, where: Where) -> str:
    role = properties.get("role")
    if role is None:
        if kind in ROLES["search"]:
            return "search"
        raise where.bad(f"a {kind} needs a role; set properties.role to {_one_of(kind)}")
    if not isinstance(role, str) or role not in ROLES:
        raise where.bad(f"unknown role {quote(role)}; use search, prior, exclude or launch")
    if kind not in ROLES[role]:
        allowed = " or ".join(ROLES[role])
        raise where.bad(f"the role '{role}' cannot be a {kind}; draw it as a {allowed}")
    return role


def _one_of(kind: str) -> str:
    roles = [role for role, kinds in ROLES.items() if kind in kinds]
    return " or ".join(roles) or "search, prior, exclude or launch, and draw a Polygon or Point"


def _prior(properties: dict[str, Any], geometry: dict[str, Any], where: Where) -> Prior:
    weight = _positive(properties, "weight", where, default=1.0)
    if geometry["type"] != "Point":
        return PolygonPrior(multipolygon(geometry, where), weight, where.part)
    if "sigma_m" not in properties:
        raise where.bad("a point prior needs sigma_m; give the standard deviation in metres, such as 50")
    sigma_m = _positive(properties, "sigma_m", where, default=1.0)
    lon, lat = position(geometry.get("coordinates"), where)
    return PointPrior((lat, lon), sigma_m, weight, where.part)


def _positive(properties: dict[str, Any], key: str, where: Where, *, default: float) -> float:
    raw = properties.get(key, default)
    value = number(raw)
    if value is None or not math.isfinite(value) or value <= 0:
        raise where.bad(f"{key} is {quote(raw)}; give a finite number greater than 0")
    return value


def _take_outside(parts: _Parts, holder: dict[str, Any], where: Where) -> None:
    if "outside" not in holder:
        return
    value = number(holder["outside"])
    if value is None or not 0 <= value < 1:
        raise where.bad(
            f"outside is {quote(holder['outside'])}; "
            "give the probability that the target is not in the area, at least 0 and less than 1"
        )
    if parts.outside is not None and parts.outside != value:
        raise where.bad(f"outside is {value:g} here and {parts.outside:g} before; give it once")
    parts.outside = value


def _text(holder: dict[str, Any], key: str) -> str:
    """A text on one line: what a terminal would take for an order (RFC 8259 allows any) becomes a space."""
    value = holder.get(key)
    if not isinstance(value, str):
        return ""
    return "".join(sign if sign.isprintable() else " " for sign in value).strip()


def _check_extent(polygon: shapely.MultiPolygon, where: Where, max_area_km2: float) -> None:
    west, south, east, north = polygon.bounds
    if east - west > 180:
        raise where.bad("the area lies on both sides of the antimeridian; search one side of it at a time")
    if max(-south, north) > MAX_LATITUDE:
        raise where.bad(
            f"the area reaches latitude {north if north > -south else south:g}; "
            f"stay within {MAX_LATITUDE:g} degrees, as compasses fail near the poles"
        )
    km2 = surface_m2(polygon) / 1e6
    if km2 > max_area_km2:
        raise where.bad(
            f"the area covers {km2:.4g} km², over the limit of {max_area_km2:g} km²; "
            "draw a smaller area or raise the limit"
        )
    corners = Projection.around(polygon).flatten(shapely.convex_hull(polygon))
    reach = float(np.hypot(*shapely.get_coordinates(corners).T).max())
    if reach > REACH_M:
        raise where.bad(
            f"the area reaches {reach / 1000:.3g} km from its centre, more than {REACH_M / 1000:g} km; "
            "divide it into several searches"
        )


def check_launch(area: SearchArea, where: Where, max_launch_m: float = MAX_LAUNCH_M) -> None:
    """Refuse a launch point that is further than `max_launch_m` metres from the search area.

    Raises:
        BadInput: it is; `where` names it in the message.
    """
    if area.launch is None:
        return
    away = _distance_m(area.polygon, area.launch)
    if away > max_launch_m:
        lat, lon = area.launch
        swapped = abs(lon) <= 90 and _distance_m(area.polygon, (lon, lat)) <= max_launch_m
        fix = "swap longitude and latitude" if swapped else "move it to the edge of the area"
        raise where.bad(
            f"the launch point is {away / 1000:.4g} km from the area, "
            f"more than {max_launch_m / 1000:g} km; {fix}"
        )


def _check_priors(area: SearchArea) -> None:
    for prior in area.priors:
        where = Where(area.source, prior.label)
        if isinstance(prior, PolygonPrior):
            if as_multipolygon(shapely.intersection(prior.polygon, area.ground)).is_empty:
                raise where.bad(
                    "the prior lies entirely outside the area that is searched; move it or remove it"
                )
        elif _distance_m(area.ground, prior.position) > FAR_SIGMAS * prior.sigma_m:
            raise where.bad(
                f"the prior lies entirely outside the area that is searched "
                f"(over {FAR_SIGMAS:g} sigma_m from it); move it, widen it or remove it"
            )


def _distance_m(polygon: shapely.MultiPolygon, point: LatLon) -> float:
    """Metres from a point to the nearest ground of a polygon, 0 inside."""
    plane = Projection.around(polygon)
    return float(shapely.distance(plane.flatten(polygon), shapely.Point(plane.forward(point)[0])))
