"""What of a run has a place, as a flat list: the one thing that GeoJSON, KML and GPX are all made from."""

from __future__ import annotations

import datetime
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import shapely

from service.area.document import name_in
from service.area.prior import cell_squares
from service.export.gaps import find_gaps
from service.export.model import ExportedFind, ExportedRun, Fix
from service.export.wishes import Wishes
from service.view.shapes import on_earth

_CORNERS = 48


@dataclass(frozen=True)
class PlacedItem:
    """A thing with a place.

    Attributes:
        role: search, exclude, launch, region, gap, track, hit, detection, uncertainty or found.
        name: for a person, a few words.
        shape: shapely, x = longitude, y = latitude in degrees; None for a track.
        fixes: of a track.
        time: of something that happened, seconds since the epoch.
        facts: more, by name.
    """

    role: str
    name: str
    shape: shapely.Geometry | None = None
    fixes: Sequence[Fix] = ()
    time: float | None = None
    facts: dict[str, Any] = field(default_factory=dict)


def items(run: ExportedRun, wishes: Wishes) -> list[PlacedItem]:
    """Everything, from the ground up: what is listed later is drawn on top."""
    return [
        *_ground(run),
        *_regions(run),
        *_gaps(run, wishes),
        *(
            PlacedItem("track", _called(number, piece), fixes=piece)
            for number, piece in enumerate(run.track, 1)
        ),
        *(PlacedItem("hit", f"hit {number}", _point(*at)) for number, at in enumerate(run.hits, 1)),
        *_detections(run),
        *_found(run),
    ]


def _called(number: int, piece: Sequence[Fix]) -> str:
    """What a piece of the track is called."""
    whose = f", aircraft {piece[0].aircraft}" if piece[0].aircraft else ""
    return f"track {number}{whose}"


def iso(time: float) -> str:
    """A time in seconds since the epoch as ISO 8601 in UTC, to the millisecond."""
    moment = datetime.datetime.fromtimestamp(time, datetime.UTC)
    return moment.isoformat(timespec="milliseconds").replace("+00:00", "Z")


def _point(lat: float, lon: float) -> shapely.Point:
    return shapely.Point(lon, lat)


def _ground(run: ExportedRun) -> Iterable[PlacedItem]:
    area = run.area
    yield PlacedItem("search", area.name, area.polygon)
    for number, exclusion in enumerate(area.exclusions, 1):
        facts = {"searchable": exclusion.searchable}
        called = f"exclusion {number}" + (f", {name}" if (name := name_in(exclusion.label)) else "")
        yield PlacedItem("exclude", called, exclusion.polygon, facts=facts)
    yield PlacedItem("launch", "launch", _point(*run.grid.launch))


def _regions(run: ExportedRun) -> Iterable[PlacedItem]:
    squares, poa = cell_squares(run.frame), run.poa
    for number in range(1, int(run.labels.max(initial=0)) + 1):
        inside = run.labels == number
        if inside.any():
            facts = {"poa": float(poa[inside].sum()), "pod": float(run.pod[inside].mean())}
            shape = on_earth(run.frame, shapely.union_all(squares[inside]))
            yield PlacedItem("region", f"ROI {number}", shape, facts=facts)


def _gaps(run: ExportedRun, wishes: Wishes) -> Iterable[PlacedItem]:
    for number, gap in enumerate(find_gaps(run, wishes), 1):
        facts = {
            "poa": gap.poa,
            "pod": gap.pod,
            "area_m2": round(gap.area_m2, 1),
            "cells": gap.cells,
            "flyable": gap.flyable,
            "place": run.written(*gap.middle),
        }
        yield PlacedItem("gap", f"gap {number}", gap.polygon, facts=facts)


def _detections(run: ExportedRun) -> Iterable[PlacedItem]:
    for number, each in enumerate(run.detections, 1):
        facts = {
            "class": each.kind,
            "score": each.score,
            "source": each.source,
            "counted": each.counted,
            "place": run.written(each.lat, each.lon),
        }
        yield PlacedItem(
            "detection", f"detection {number}", _point(each.lat, each.lon), time=each.time, facts=facts
        )


def _found(run: ExportedRun) -> Iterable[PlacedItem]:
    """The find, and the ellipse that holds the target with 95 % if it is there."""
    find = run.find
    if find is None:
        return
    major, minor, bearing = find.ellipse
    spread = {
        "semi_major_m": round(major, 1),
        "semi_minor_m": round(minor, 1),
        "bearing_deg": round(bearing, 1),
    }
    name = "where the target is with 95 %"
    yield PlacedItem(
        "uncertainty", name, on_earth(run.frame, _ellipse(run, find)), facts={"holds": 0.95, **spread}
    )
    facts = {
        "probability": find.probability,
        "sigma_m": find.sigma_m,
        "place": run.written(find.lat, find.lon),
    }
    yield PlacedItem("found", "found", _point(find.lat, find.lon), time=find.time, facts=facts)


def _ellipse(run: ExportedRun, find: ExportedFind) -> shapely.Polygon:
    """In the grid's metres (east, south), whose north is turned from the true one."""
    major, minor, bearing = find.ellipse
    turned = math.radians(bearing - run.frame.bearing_deg)
    along = np.array([math.sin(turned), -math.cos(turned)])
    across = np.array([math.cos(turned), math.sin(turned)])
    turn = np.linspace(0.0, 2.0 * np.pi, _CORNERS, endpoint=False)[:, None]
    middle = run.frame.to_metres([(find.lat, find.lon)])[0]
    return shapely.Polygon(middle + major * np.cos(turn) * along + minor * np.sin(turn) * across)
