"""Ground that was searched, as outlines for maps of others: rings without holes, of few corners.

An outline never covers ground that was not searched: a hole is cut through, and corners are saved inwards only.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from service.area.frame import GridFrame
from service.geometry import LatLon

POD_AT_LEAST = 0.5
"""Ground counts as searched when its cumulative probability of detection is this at least."""
MOST_OUTLINES, MOST_CORNERS = 12, 60
"""So that an event stays small enough for a datagram; the largest outlines are told."""
_INWARDS = (0.0, 0.25, 0.5, 1.0, 2.0)


@dataclass(frozen=True)
class Outline:
    """A closed ring of (lat, lon), a place inside it, and its hectares."""

    ring: tuple[LatLon, ...]
    inside: LatLon
    hectares: float


def outlines(frame: GridFrame, searched: NDArray[np.bool_]) -> list[Outline]:
    """The outlines of the cells that are `searched`, bool [rows, cols], the largest first."""
    shape = shapely.union_all(np.array(list(_runs(frame, searched)), dtype=object))
    pieces = [piece for part in shapely.get_parts(shape) for piece in _without_holes(part)]
    simple = (each for piece in pieces for each in _of_few_corners(piece, frame.cell_m))
    largest = sorted(simple, key=lambda each: -float(each.area))[:MOST_OUTLINES]
    return [_outline(frame, each) for each in largest]


def _runs(frame: GridFrame, searched: NDArray[np.bool_]) -> Iterator[shapely.Polygon]:
    """The cells of each row that touch, as one box in the grid's metres."""
    edges = np.diff(np.pad(searched, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    for (row, first), (_, end) in zip(np.argwhere(edges == 1), np.argwhere(edges == -1), strict=True):
        yield shapely.box(*(frame.cell_m * np.array([first, row, end, row + 1], dtype=np.float64)))


def _without_holes(part: shapely.Polygon) -> Iterator[shapely.Polygon]:
    """The part, cut from north to south through the middle of each of its holes."""
    if not part.interiors:
        yield part
        return
    west, north, east, south = part.bounds
    cut = shapely.Polygon(part.interiors[0]).centroid.x
    for half in (shapely.box(west, north, cut, south), shapely.box(cut, north, east, south)):
        for piece in shapely.get_parts(part.intersection(half)):
            if isinstance(piece, shapely.Polygon):
                yield from _without_holes(piece)


def _of_few_corners(piece: shapely.Polygon, cell_m: float) -> list[shapely.Polygon]:
    """The piece, or what lies inside it with few enough corners; nothing of one that is too narrow for that."""
    for inwards in _INWARDS:
        inner = piece.buffer(-inwards * cell_m, join_style="mitre").simplify(0.99 * inwards * cell_m)
        parts = [each for each in shapely.get_parts(inner) if not each.is_empty and not each.interiors]
        if parts and all(len(each.exterior.coords) <= MOST_CORNERS for each in parts):
            return parts
    return []


def _outline(frame: GridFrame, piece: shapely.Polygon) -> Outline:
    inside = shapely.point_on_surface(piece)
    places = frame.from_metres([*piece.exterior.coords, (inside.x, inside.y)]).tolist()
    ring = tuple((lat, lon) for lat, lon in places[:-1])
    return Outline(ring, (places[-1][0], places[-1][1]), float(piece.area) * 1e-4)
