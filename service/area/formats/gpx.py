"""GPX of any receiver or map program (GPX 1.0 and 1.1), by gpxpy.

It knows no polygons: a track that comes back to its start is one.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import gpxpy

from service.area.document import Document, Item, Json, label, one_line, settings_in, short_text
from service.area.geojson import Where
from service.area.words import outline

_UNUSED = re.compile(r"<(ele|time|magvar|geoidheight|hdop|vdop|pdop|sat|fix|speed|course)>[^<]{0,60}</\1>")
"""What nothing is made of here, and what receivers write words into ('n/a') where numbers belong."""
_COMMA = re.compile(r"""\b(lat|lon)\s*=\s*(["'])(-?\d{1,3}),(\d{1,20})\2""")
"""A degree as German and French programs write it."""


def read_gpx(text: str, where: Where) -> Document:
    """Waypoints as points, tracks and routes as lines, or as polygons where they end where they began.

    Raises:
        BadInput: gpxpy cannot make sense of it.
    """
    try:
        gpx = gpxpy.parse(_COMMA.sub(r"\1=\2\3.\4\2", _UNUSED.sub("", text)))
    except (gpxpy.gpx.GPXException, ValueError, TypeError, AttributeError) as error:
        raise where.bad(f"this GPX cannot be read ({one_line(error)}); export it again") from None
    document = Document(
        "GPX", name=one_line(gpx.name or ""), description=one_line(gpx.description or "", 10_000)
    )
    for number, waypoint in enumerate(gpx.waypoints):
        _add(document, label("waypoint", number, waypoint.name or ""), waypoint, [_position(waypoint)])
    for number, route in enumerate(gpx.routes):
        _add(
            document,
            label("route", number, route.name or ""),
            route,
            [_position(each) for each in route.points],
        )
    for number, track in enumerate(gpx.tracks):
        called = label("track", number, track.name or "")
        pieces = [[_position(each) for each in segment.points] for segment in track.segments]
        for own, positions in _lines(document, called, track, [each for each in pieces if each]):
            _add(document, own, track, positions)
    return document


def _lines(
    document: Document, called: str, track: Any, pieces: list[list[list[float]]]
) -> Iterator[tuple[str, list[list[float]]]]:
    """The lines of a track with their labels. A receiver begins a new piece where it had no fix for a while: pieces
    that go around ground only together are one line."""
    whole, name = [each for piece in pieces for each in piece], one_line(track.name or "")
    around = [outline(positions, name, always=True) is not None for positions in (*pieces, whole)]
    if len(pieces) > 1 and around[-1] and not any(around[:-1]):
        document.notes.append(f"{called}: its {len(pieces)} parts are taken as one, which goes around ground")
        yield called, whole
        return
    for part, positions in enumerate(pieces, 1):
        yield called if len(pieces) == 1 else f"{called}, part {part}", positions


def _add(document: Document, called: str, thing: Any, positions: list[list[float]]) -> None:
    said = {**settings_in(thing.comment or ""), **settings_in(thing.description or "")}
    name = one_line(thing.name or "")
    geometry: Json
    if isinstance(thing, gpxpy.gpx.GPXWaypoint):
        geometry = {"type": "Point", "coordinates": positions[0]}
    elif len(positions) < 2:
        document.notes.append(f"{called}: left out, it has no length")
        return
    elif said.get("role") != "prior" and (ring := outline(positions, name, always=True)) is not None:
        geometry = {"type": "Polygon", "coordinates": [ring]}
    else:
        geometry = {"type": "LineString", "coordinates": positions}
    hints = (short_text(thing.description), short_text(thing.comment))
    document.items.append(Item(called, geometry, said, name, hints=hints))


def _position(point: Any) -> list[float]:
    return [float(point.longitude), float(point.latitude)]
