"""What each role of a feature means: one table, and how each is read."""

from __future__ import annotations

import difflib
import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

from service.area import lost_persons
from service.area.document import Item, Json, one_line
from service.area.faults import Together
from service.area.geojson import Where, line, multipolygon, number, position, quote
from service.area.model import (
    COVER_KINDS,
    Cover,
    Exclusion,
    LinePrior,
    PointPrior,
    PolygonPrior,
    Prior,
    RingPrior,
    TargetMotion,
)
from service.area.target import read_target
from service.area.words import MOST_COLUMNS
from service.geometry import LatLon

POLYGONS = ("Polygon", "MultiPolygon")
LINES = ("LineString", "MultiLineString")

_COMMON = frozenset(
    {"name", "title", "description", "id", "class", "height", "source", "sources", "notes", "parts"}
)
"""Properties that others use and that only look like ours."""


@dataclass
class Parts:
    """What the features add up to while they are read. `drawn`: all ground that they say was understood."""

    name: str = ""
    description: str = ""
    drawn: bool = True
    search: list[Any] = field(default_factory=list)
    priors: list[Prior] = field(default_factory=list)
    exclusions: list[Exclusion] = field(default_factory=list)
    covers: list[Cover] = field(default_factory=list)
    transit: list[Any] = field(default_factory=list)
    launch: LatLon | None = None
    launch_item: Item | None = None
    outside: float | None = None
    target: TargetMotion | None = None
    target_given: Any = None
    guessed: dict[str, Item] = field(default_factory=dict)


@dataclass(frozen=True)
class Role:
    """A role: the geometry types it may have, its own properties, and what takes a feature in."""

    kinds: tuple[str, ...]
    properties: frozenset[str]
    take: Callable[[Parts, Item, Where], None]


def take(parts: Parts, item: Item, where: Where) -> None:
    """Add a thing, which has a role, to the parts.

    Raises:
        BadInput: its role, its geometry or a property of it cannot be; `BadArea` where several cannot.
    """
    role, kind = _role(item.properties, where), item.geometry["type"]
    if kind not in ROLES[role].kinds:
        allowed = " or ".join(ROLES[role].kinds)
        raise where.bad(f"the role '{role}' cannot be a {kind}; draw it as a {allowed}")
    with Together(where.source) as each:
        for key, meant in _misspelt(role, item.properties).items():
            each.faults.append(
                f"{where.part}: it has no property {quote(key)} that is known; did you mean '{meant}'?"
            )
            item = replace(item, properties={**item.properties, meant: item.properties[key]})
        each(_check_belonging, role, item.properties, where)
        if not (item.guessed and each.faults):  # else it is left out, and no part of it may be taken
            each(ROLES[role].take, parts, item, where)
    if item.guessed:
        parts.guessed[item.label] = item


def take_outside(parts: Parts, holder: Json, where: Where) -> None:
    """Take the probability that the target is not in the area at all. Raises BadInput."""
    if holder.get("outside") is None:
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


def take_target(parts: Parts, properties: Json, where: Where) -> None:
    """Take how the target moves. Raises BadInput."""
    given = properties.get("target")
    if given is None:
        return
    if parts.target_given is not None and parts.target_given != given:
        raise where.bad(f"target is {quote(given)} here and {quote(parts.target_given)} before; give it once")
    parts.target, parts.target_given = read_target(given, where), given


def _role(properties: Json, where: Where) -> str:
    given = properties["role"]
    role = given.strip().lower() if isinstance(given, str) else given
    if isinstance(role, str) and role in ROLES:
        return role
    near = difflib.get_close_matches(role, ROLES, n=1) if isinstance(role, str) else []
    hint = f"did you mean '{near[0]}'?" if near else f"use {_listed()}"
    raise where.bad(f"unknown role {quote(given)}; {hint}")


def _listed() -> str:
    *first, last = ROLES
    return f"{', '.join(first)} or {last}"


def _check_belonging(role: str, properties: Json, where: Where) -> None:
    for key, given in (
        ("outside", "outside" in properties),
        ("target", isinstance(properties.get("target"), dict)),
    ):
        if role != "search" and given:
            raise where.bad(
                f"'{key}' belongs to the search area; move it to the feature with the role 'search'"
            )


def _misspelt(role: str, properties: Json) -> dict[str, str]:
    """Properties that look like one of a role that is not given, and which that is."""
    found: dict[str, str] = {}
    for key in properties if len(properties) <= MOST_COLUMNS else ():
        if key not in _COMMON and key not in KNOWN:
            near = difflib.get_close_matches(key, sorted(ROLES[role].properties), n=1, cutoff=0.8)
            if near and near[0] not in properties:
                found[key] = near[0]
    return found


def _take_search(parts: Parts, item: Item, where: Where) -> None:
    with Together(where.source) as each:
        shape = each(multipolygon, item.geometry, where)
        each(take_outside, parts, item.properties, where)
        each(take_target, parts, item.properties, where)
    parts.search.append(shape)
    parts.name = parts.name or _text(item.properties, "name", 200)
    parts.description = parts.description or _text(item.properties, "description", 10_000)


def _take_exclusion(parts: Parts, item: Item, where: Where) -> None:
    searchable = item.properties.get("searchable", False)
    if not isinstance(searchable, bool):
        raise where.bad(f"searchable is {quote(searchable)}; write true or false")
    parts.exclusions.append(Exclusion(multipolygon(item.geometry, where), searchable, where.part))


def _take_cover(parts: Parts, item: Item, where: Where) -> None:
    kind, raw = item.properties.get("kind"), item.properties.get("p_tp")
    p_tp = None if raw is None else number(raw)
    if raw is not None and (p_tp is None or not 0.0 <= p_tp <= 1.0):
        raise where.bad(f"p_tp is {quote(raw)}; give the chance that one look finds the target there, 0 to 1")
    known = isinstance(kind, str) and kind.strip().lower() in COVER_KINDS
    if not known and (kind is not None or p_tp is None):
        raise where.bad(f"the kind of cover is {quote(kind)}; use {', '.join(COVER_KINDS)}, or give its p_tp")
    name = kind.strip().lower() if isinstance(kind, str) else "cover"
    parts.covers.append(Cover(multipolygon(item.geometry, where), name, p_tp, where.part))


def _take_transit(parts: Parts, item: Item, where: Where) -> None:
    parts.transit.append(multipolygon(item.geometry, where))


def _take_prior(parts: Parts, item: Item, where: Where) -> None:
    properties, geometry = item.properties, item.geometry
    with Together(where.source) as each:
        weight = each(positive, properties, "weight", where, 1.0)
        prior: Prior
        if geometry["type"] in POLYGONS:
            prior = PolygonPrior(each(multipolygon, geometry, where), weight, where.part)
        elif geometry["type"] in LINES:
            width_m = each(positive, properties, "width_m", where, needed=_WIDTH)
            prior = LinePrior(each(line, geometry, where), width_m, weight, where.part)
        else:
            sigma_m = each(positive, properties, "sigma_m", where, needed=_SIGMA)
            prior = PointPrior(each(_place, geometry, where), sigma_m, weight, where.part)
    parts.priors.append(prior)


def _take_ipp(parts: Parts, item: Item, where: Where) -> None:
    with Together(where.source) as each:
        weight = each(positive, item.properties, "weight", where, 1.0)
        place = each(_place, item.geometry, where)
        rings = each(_rings, item.properties, where)
    rings_m, about = rings
    parts.priors.append(RingPrior(place, rings_m, about, weight, where.part))


def _rings(properties: Json, where: Where) -> tuple[tuple[float, float, float, float], str]:
    """The distances in metres within which 25, 50, 75 and 95 % are found, and whose they are. Raises BadInput."""
    if "rings_m" in properties:
        given = (
            [number(each) for each in properties["rings_m"]]
            if isinstance(properties["rings_m"], list)
            else []
        )
        good = [each for each in given if each is not None and math.isfinite(each) and each > 0]
        if len(given) != 4 or len(good) != 4 or sorted(set(good)) != good:
            raise where.bad(
                f"rings_m is {quote(properties['rings_m'])}; give the distances in metres within which 25, 50, 75 and "
                "95 % are found, each larger than the last"
            )
        return (good[0], good[1], good[2], good[3]), "rings_m"
    subject, terrain = properties.get("subject"), properties.get("terrain")
    if not isinstance(subject, str):
        raise where.bad("an ipp needs a subject, such as 'hiker', or rings_m")
    if terrain is not None and not isinstance(terrain, str):
        raise where.bad(f"terrain is {quote(terrain)}; use {', '.join(lost_persons.TERRAINS)}")
    try:
        return lost_persons.rings(subject, terrain)
    except ValueError as error:
        raise where.bad(str(error)) from None


def _take_launch(parts: Parts, item: Item, where: Where) -> None:
    if parts.launch is not None:
        raise where.bad("this is a second launch point; keep one")
    parts.launch, parts.launch_item = _place(item.geometry, where), item


def _place(geometry: Json, where: Where) -> LatLon:
    """Where a Point is. Raises BadInput."""
    lon, lat = position(geometry.get("coordinates"), where)
    return lat, lon


_WIDTH = "a line prior needs width_m; give the width of the strip in metres, such as 60"
_SIGMA = "a point prior needs sigma_m; give the standard deviation in metres, such as 50"


def positive(
    properties: Json, key: str, where: Where, default: float | None = None, *, needed: str = ""
) -> float:
    """A property that is a finite number above 0. Raises BadInput, with `needed` where it is missing."""
    raw = properties.get(key, default)
    if needed and key not in properties:
        raise where.bad(needed)
    value = number(raw)
    if value is None or not math.isfinite(value) or value <= 0:
        raise where.bad(f"{key} is {quote(raw)}; give a finite number greater than 0")
    return value


def _text(holder: Json, key: str, most: int) -> str:
    value = holder.get(key)
    return one_line(value, most) if isinstance(value, str) else ""


ROLES: dict[str, Role] = {
    "search": Role(POLYGONS, frozenset({"outside", "target"}), _take_search),
    "prior": Role((*POLYGONS, "Point", *LINES), frozenset({"weight", "sigma_m", "width_m"}), _take_prior),
    "ipp": Role(("Point",), frozenset({"weight", "subject", "terrain", "rings_m"}), _take_ipp),
    "exclude": Role(POLYGONS, frozenset({"searchable"}), _take_exclusion),
    "cover": Role(POLYGONS, frozenset({"kind", "p_tp"}), _take_cover),
    "transit": Role(POLYGONS, frozenset(), _take_transit),
    "launch": Role(("Point",), frozenset(), _take_launch),
}
"""Every `properties.role` there is."""

KNOWN = frozenset({"role"}).union(*(role.properties for role in ROLES.values()))
"""Every property that some role has."""


def guard(where: Where, call: Callable[[], None], faults: list[str]) -> bool:
    """Call something and keep what it refuses as faults, without the file's name; False when it did."""
    each = Together(where.source)
    each(call)
    faults += each.faults
    return not each.faults
