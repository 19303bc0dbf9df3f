"""A run as GeoJSON (RFC 7946): everything with a place, told apart by `role`."""

from __future__ import annotations

import json
from typing import Any

import shapely

from service.export.features import PlacedItem, iso, items
from service.export.model import ExportedRun
from service.export.wishes import Wishes
from service.view.shapes import DIGITS, collection, feature, plain, point


def write(run: ExportedRun, wishes: Wishes) -> bytes:
    """The run as a FeatureCollection; its own properties are in `run`, which readers may ignore."""
    said = {
        "name": run.name,
        "area": run.area.name,
        "state": run.state,
        "as_of": iso(run.last),
        "pos": run.pos,
        "outside": run.belief.outside,
        "looks": run.looks,
        "planner": run.settings.search.planner,
    }
    return json.dumps(
        collection([_feature(item) for item in items(run, wishes)], run=said), allow_nan=False
    ).encode()


def _feature(item: PlacedItem) -> dict[str, Any]:
    properties: dict[str, Any] = {"name": item.name, **item.facts}
    if item.time is not None:
        properties["time"] = iso(item.time)
    if item.shape is None:
        line = [
            [round(fix.lon, DIGITS), round(fix.lat, DIGITS), round(fix.height_m, 2)] for fix in item.fixes
        ]
        geometry: dict[str, Any] = {"type": "LineString", "coordinates": line}
        properties["times"] = [iso(fix.time) for fix in item.fixes]
    elif isinstance(item.shape, shapely.Point):
        geometry = point(item.shape.y, item.shape.x)
    else:
        geometry = plain(item.shape)
    return feature(geometry, item.role, **properties)
