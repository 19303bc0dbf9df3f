"""From an area file to a checked `SearchArea`: what its things add up to, and everything that is wrong with it."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import shapely

from service.area.checks import MAX_LAUNCH_M, check_extent, check_launch, check_prior, ring_notes
from service.area.document import Document, few_notes
from service.area.faults import refuse
from service.area.formats import read_document
from service.area.geojson import MOST_POSITIONS, Where, as_multipolygon, read_bytes
from service.area.model import Prior, SearchArea
from service.area.roles import POLYGONS, Parts, guard, take, take_outside


def read_area(
    path: str | Path, *, max_area_km2: float = 100.0, max_launch_m: float = MAX_LAUNCH_M
) -> SearchArea:
    """Read and check an area file: GeoJSON (RFC 7946, WGS84), or what `service.area.formats` reads besides.

    A bare Polygon or MultiPolygon, a Feature, or a FeatureCollection. A polygon without
    `properties.role` is the search area. A prior without `weight` has weight 1.

    Args:
        path: the file.
        max_area_km2: the largest surface of the search area, in square kilometres.
        max_launch_m: how far the launch point may be from the search area, in metres.

    Raises:
        BadInput: one sentence with the file, the feature and the fix; `BadArea` where there are several.
    """
    return parse_area(
        read_bytes(path), source=str(path), max_area_km2=max_area_km2, max_launch_m=max_launch_m
    )


def parse_area(
    data: bytes, *, source: str, max_area_km2: float = 100.0, max_launch_m: float = MAX_LAUNCH_M
) -> SearchArea:
    """`read_area` for content that is already in memory; `source` names it in messages."""
    document = read_document(data, Where(source))
    return area_of(document, source=source, max_area_km2=max_area_km2, max_launch_m=max_launch_m)


def area_of(
    document: Document, *, source: str, max_area_km2: float = 100.0, max_launch_m: float = MAX_LAUNCH_M
) -> SearchArea:
    """The area that a document describes; see `read_area`.

    What only its name made us take for something is left out with a note where it cannot be that.
    """
    where = Where(source)
    notes, faults = list(document.notes), list(document.faults)
    parts = _collect(document, where, notes, faults)
    if not parts.search and not faults:
        faults.append(_empty(document.format, notes))
    if faults and not parts.drawn:  # what lies where cannot be told
        refuse(source, faults)
    polygon = as_multipolygon(shapely.union_all(parts.search))
    taken = shapely.union_all([item.polygon for item in parts.exclusions if not item.searchable])
    ground = as_multipolygon(shapely.difference(polygon, taken))
    if ground.is_empty:
        raise where.bad("the exclusions cover the whole search area; make them smaller or the area larger")
    check_extent(polygon, where, max_area_km2)
    area = SearchArea(
        source=source,
        name=parts.name or Path(source).stem,
        description=parts.description,
        polygon=polygon,
        ground=ground,
        priors=(),
        exclusions=tuple(parts.exclusions),
        launch=parts.launch,
        outside=parts.outside or 0.0,
        covers=tuple(parts.covers),
        target=parts.target,
        transit=as_multipolygon(shapely.union_all(parts.transit)) if parts.transit else None,
    )
    if parts.launch_item is not None:
        here = Where(source, parts.launch_item.label)
        check = functools.partial(check_launch, area, here, max_launch_m)
        if not _holds(parts, here, notes, faults, check):
            area = replace(area, launch=None)
    priors: list[Prior] = []
    for prior in parts.priors:
        here = Where(source, prior.label)
        if _holds(parts, here, notes, faults, functools.partial(check_prior, area, prior)):
            priors.append(prior)
    refuse(source, faults)
    area = replace(area, priors=tuple(priors))
    return replace(area, notes=(*few_notes(notes), *ring_notes(area)))


_ROLE = "no Polygon has the role 'search'; draw one"
_DRAWN = {
    "GPX": "GPX has no polygons; make a track or route that comes back to its start",
    "QGroundControl plan": "draw a survey or an inclusion fence around it",
}


def _empty(form: str, notes: list[str]) -> str:
    """That there is nothing to search, with how it would be drawn in a form of file, and what was drawn instead."""
    said = f"the search area is empty: {_DRAWN.get(form, _ROLE)}, or draw it on the map of 'roisearch-service plan'"
    few = [note for note in notes if "left out" in note][:3]
    return f"{said} ({'; '.join(few)})." if few else f"{said}."


def _collect(document: Document, where: Where, notes: list[str], faults: list[str]) -> Parts:
    """What the things of a document add up to; each fault is kept, and reading goes on."""
    parts = Parts(document.name, document.description, drawn=not document.faults)
    held: dict[str, Any] = {"outside": document.outside}
    guard(where, lambda: take_outside(parts, held, where), faults)
    positions = 0
    for item in document.items:
        positions += _count(item.geometry)
        if positions > MOST_POSITIONS:
            raise where.bad(
                f"more than {MOST_POSITIONS} positions are drawn; simplify the outlines, or export only the area"
            )
        here = Where(where.source, item.label)
        wrong: list[str] = []
        if not guard(where, functools.partial(take, parts, item, here), wrong):
            if item.guessed and item.properties["role"] != "exclude":  # which is believed to be kept to
                item.dropped = True
                notes += [f"{each.rstrip('.')}; left out" for each in wrong]
            else:
                faults += wrong
                parts.drawn = parts.drawn and item.geometry["type"] not in POLYGONS
    parts.drawn = parts.drawn and bool(parts.search)
    return parts


def _holds(parts: Parts, here: Where, notes: list[str], faults: list[str], check: Callable[[], None]) -> bool:
    """Whether a thing passes a check; its refusal is a note where the thing was guessed, and a fault otherwise."""
    wrong: list[str] = []
    good = guard(here, check, wrong)
    item = parts.guessed.get(here.part)
    if item is not None and not good:
        item.dropped = True
        notes += [f"{each.rstrip('.')}; left out" for each in wrong]
    else:
        faults += wrong
    return good


def _count(geometry: Any) -> int:
    """How many positions a geometry has, about: lists of numbers."""
    open_lists, count = [geometry.get("coordinates")], 0
    while open_lists:
        each = open_lists.pop()
        if isinstance(each, list) and each:
            if isinstance(each[0], list):
                open_lists += each
            else:
                count += 1
    return count
