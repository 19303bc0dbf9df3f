"""A run as GeoJSON (RFC 7946): everything with a place, told apart by `role`."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import shapely

from service.export.features import Item, iso, items
from service.export.run import Run
from service.export.wishes import Wishes

DIGITS = 7  # of a degree: a centimetre


def write(run: Run, wishes: Wishes) -> bytes:
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
    collection = {
        "type": "FeatureCollection",
        "run": said,
        "features": [_feature(item) for item in items(run, wishes)],
    }
    return json.dumps(collection, allow_nan=False).encode()


def _feature(item: Item) -> dict[str, Any]:
    properties: dict[str, Any] = {"role": item.role, "name": item.name, **item.facts}
    if item.time is not None:
        properties["time"] = iso(item.time)
    if item.shape is None:
        line = [
            [round(fix.lon, DIGITS), round(fix.lat, DIGITS), round(fix.height_m, 2)] for fix in item.fixes
        ]
        geometry: dict[str, Any] = {"type": "LineString", "coordinates": line}
        properties["times"] = [iso(fix.time) for fix in item.fixes]
    else:
        rounded = shapely.transform(item.shape, lambda points: np.round(points, DIGITS))
        geometry = shapely.geometry.mapping(rounded)
    return {"type": "Feature", "properties": properties, "geometry": geometry}
