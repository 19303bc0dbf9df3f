"""QGroundControl plans (.plan, version 1): surveys, geofence and home, as its file format documentation has them."""

from __future__ import annotations

import json
import math
from typing import Any

import shapely

from service.area.document import Document, Item, Json, label
from service.area.geojson import Where, number
from service.area.projection import Projection

_CORNERS = 64
"""Of a circle of the geofence, drawn around it: an exclusion is never smaller than it was drawn."""


def read_plan(root: Json, where: Where) -> Document:
    """Surveys and corridor scans are searched, and the inclusion polygons of the geofence where there are none; what
    the fence excludes is excluded; the planned home is the launch point.

    Raises:
        BadInput: it is no plan of QGroundControl.
    """
    document = Document("QGroundControl plan")
    mission, fence = root.get("mission"), root.get("geoFence")
    if not isinstance(mission, dict):
        if not isinstance(fence, dict):
            raise where.bad("this plan has no mission and no fence; save it again in QGroundControl")
        mission = {}  # of a plan that is a fence alone
    items = mission.get("items")
    _take_items(document, items if isinstance(items, list) else [])
    surveyed = any(item.kind == "survey" for item in document.items)
    if isinstance(fence, dict):
        if isinstance(fence.get("polygon"), list):
            document.notes.append("the fence: left out, it is of the first version of plans; save it again")
        _take_fence(document, fence, surveyed)
    home = mission.get("plannedHomePosition")
    if isinstance(home, dict):
        home = home.get("coordinate")  # of the first version of plans
    if isinstance(home, list) and len(home) >= 2:
        point = {"type": "Point", "coordinates": _swapped(home)}
        document.items.append(Item("the planned home", point, {"role": "launch"}, "home", guessed=True))
    rally = root.get("rallyPoints")
    points = rally.get("points") if isinstance(rally, dict) else None
    if isinstance(points, list) and points:
        document.notes.append(f"rally points ({len(points)}): left out, the aircraft lands where it started")
    return document


def _take_items(document: Document, items: list[Any]) -> None:
    simple = 0
    for index, item in enumerate(items):
        if not isinstance(item, dict):
            continue
        kind = item.get("complexItemType")
        called = label("mission item", index, str(kind or ""))
        if kind == "survey" and item.get("polygon") == []:
            document.notes.append(f"{called}: left out, its polygon was never drawn")
        elif kind == "survey" and isinstance(item.get("polygon"), list):
            document.items.append(
                Item(called, _polygon(item["polygon"]), {"role": "search"}, "survey", "survey")
            )
        elif kind == "CorridorScan":
            corridor = _corridor(item)
            if corridor is None:
                document.faults.append(f"{called}: it needs a line and a width in metres; draw it again.")
            else:
                document.items.append(Item(called, corridor, {"role": "search"}, "survey", "survey"))
        elif kind is not None:
            document.notes.append(
                f"{called}: left out, only a survey or a corridor scan says where to search"
            )
        else:
            simple += 1
    if simple:
        document.notes.append(f"waypoints and commands ({simple}): left out, the search finds its own way")


def _take_fence(document: Document, fence: Json, surveyed: bool) -> None:
    for shape, key in (("fence polygon", "polygons"), ("fence circle", "circles")):
        shapes = fence.get(key)
        for index, each in enumerate(shapes if isinstance(shapes, list) else []):
            if not isinstance(each, dict):
                continue
            called = label(shape, index)
            geometry = _polygon(each.get("polygon")) if key == "polygons" else _circle(each.get("circle"))
            if key == "circles" and geometry["coordinates"] is None:
                document.faults.append(f"{called}: it needs a centre and a radius in metres; draw it again.")
                continue
            if each.get("polygon") == []:
                document.notes.append(f"{called}: left out, it was never drawn")
                continue
            if each.get("inclusion") is False:
                document.items.append(Item(called, geometry, {"role": "exclude"}, f"no-fly {called}"))
            elif surveyed:
                document.notes.append(
                    f"{called}: left out, beside a survey; flight.margin_m says how far outside it one flies"
                )
            else:
                document.items.append(Item(called, geometry, {"role": "search"}, called))


def _polygon(corners: Any) -> Json:
    """QGroundControl writes [latitude, longitude], and does not repeat the first corner."""
    if not isinstance(corners, list):
        return {"type": "Polygon", "coordinates": corners}
    ring = [_swapped(corner) for corner in corners]
    return {"type": "Polygon", "coordinates": [[*ring, ring[0]] if ring else []]}


def _corridor(scan: Json) -> Json | None:
    """The strip of a corridor scan, as wide as it says; None when it is no strip."""
    line, width = scan.get("polyline"), number(scan.get("CorridorWidth"))
    corners = [_position(each) for each in line] if isinstance(line, list) else []
    known = [each for each in corners if each is not None]
    if len(known) < 2 or len(known) < len(corners) or width is None or not 0 < width < 1e5:
        return None
    plane = Projection(*known[0])
    strip = shapely.buffer(shapely.LineString(plane.forward(known)), width / 2, cap_style="flat")
    if strip.is_empty:  # all corners are one place
        return None
    outline = shapely.transform(strip, lambda metres: plane.inverse(metres)[:, ::-1])
    drawn: Json = json.loads(shapely.to_geojson(outline))
    return drawn


def _circle(circle: Any) -> Json:
    centre = _position(circle.get("center")) if isinstance(circle, dict) else None
    radius = number(circle.get("radius")) if isinstance(circle, dict) else None
    if centre is None or radius is None or not 0 < radius < 1e6:
        return {"type": "Polygon", "coordinates": None}
    around = radius / math.cos(math.pi / _CORNERS)
    turns = [2.0 * math.pi * step / _CORNERS for step in range(_CORNERS)]
    metres = [[around * math.sin(turn), around * math.cos(turn)] for turn in turns]
    ring = [[float(point[1]), float(point[0])] for point in Projection(*centre).inverse(metres)]
    return {"type": "Polygon", "coordinates": [[*ring, ring[0]]]}


def _position(given: Any) -> tuple[float, float] | None:
    """(latitude, longitude), if it is one."""
    if not isinstance(given, list) or len(given) < 2:
        return None
    lat, lon = number(given[0]), number(given[1])
    return (lat, lon) if lat is not None and lon is not None and abs(lat) <= 90 and abs(lon) <= 180 else None


def _swapped(position: Any) -> Any:
    return [position[1], position[0]] if isinstance(position, list) and len(position) >= 2 else position
