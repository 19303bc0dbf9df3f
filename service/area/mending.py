"""Outlines as hands, receivers and programs draw them: rings that cross themselves by a slip, or are left open."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from service.area.document import Json

MOST_CORNERS = 2000
"""Of a ring whose crossings are looked for: they can be as many as the square of this."""
ROUGH_DEG = 1e-5
"""About a metre: what a longer ring is simplified by before."""
SLIP = 0.95
"""A ring is crossed by a slip if it winds around so much of all that it encloses; a bow-tie does not."""
THIN = 0.1
"""A ring with less surface than this part of a circle of its length goes out and back, not around."""


def mend(geometry: Json) -> str | None:
    """Let a Polygon or MultiPolygon be what its rings go around where they cross themselves by a slip or are left open.

    Changes the geometry in place, and returns the note that says so; None where nothing was to be mended, or where
    what is wrong is no slip and stays for the reader to refuse.
    """
    whole = geometry.get("coordinates")
    parts = [whole] if geometry["type"] == "Polygon" else whole
    if not isinstance(parts, list):
        return None
    made: list[Any] = []
    closed = [_close(ring) for rings in parts if isinstance(rings, list) for ring in rings]
    changed = False
    for rings in parts:
        mended = _mended(rings)
        changed = changed or mended is not None
        made += [rings] if mended is None else mended
    if not changed:
        return "its outline does not come back to its start; it is closed" if any(closed) else None
    single = len(made) == 1
    geometry.update(type="Polygon" if single else "MultiPolygon", coordinates=made[0] if single else made)
    return "its outline crosses itself by a slip; all that it goes around is taken"


def _close(ring: Any) -> bool:
    """Repeat the first position of a ring at its end where it is missing; whether it was."""
    if not isinstance(ring, list) or len(ring) < 3 or not all(isinstance(each, list) for each in ring):
        return False
    if ring[0][:2] == ring[-1][:2]:
        return False
    ring.append(ring[0])
    return True


def goes_around(ring: list[Any]) -> bool:
    """Whether a closed line, positions [n][2+] in degrees, goes around ground: not out and back, and no bow-tie."""
    points = _points(ring)
    if points is None:
        return True  # its fault is told where positions are read
    points[:, 0] *= math.cos(math.radians(float(points[:, 1].mean())))
    ground = _enclosed(points)
    length = float(np.hypot(*np.diff(points, axis=0).T).sum())
    return ground is not None and 4.0 * math.pi * shapely.area(ground) > THIN * length**2


def _mended(rings: Any) -> list[Any] | None:
    """The polygons, as GeoJSON has them, that the rings of one make up; None where they stay as they are."""
    if not isinstance(rings, list) or not rings:
        return None
    read = [_points(ring) for ring in rings]
    points = [each for each in read if each is not None]
    if len(points) < len(read) or all(shapely.is_valid(shapely.Polygon(each)) for each in points):
        return None
    grounds = [_enclosed(each) for each in points]
    known = [each for each in grounds if each is not None]
    if len(known) < len(grounds):
        return None
    ground = shapely.difference(known[0], shapely.union_all(known[1:])) if known[1:] else known[0]
    shapes = [each for each in shapely.get_parts(ground) if each.geom_type == "Polygon" and each.area > 0]
    return [
        [shapely.get_coordinates(ring).tolist() for ring in (each.exterior, *each.interiors)]
        for each in shapes
    ] or None


def _points(ring: Any) -> NDArray[np.float64] | None:
    """A closed ring as float [n, 2], or None where it is none: whoever reads it says why."""
    if not isinstance(ring, list) or len(ring) < 4:
        return None
    for each in ring:
        if not isinstance(each, list) or len(each) < 2:
            return None
        if not all(type(part) in (int, float) and abs(part) <= 360 for part in each[:2]):
            return None
    points = np.array([each[:2] for each in ring], dtype=np.float64)
    jumps = (np.abs(np.diff(points[:, 0])) > 180).any()
    return None if jumps or (points[0] != points[-1]).any() else points


def _enclosed(points: NDArray[np.float64]) -> shapely.Geometry | None:
    """All that a ring goes around; None where it winds around too little of it to have been meant so."""
    ring = shapely.Polygon(points)
    if shapely.is_valid(ring):
        return ring
    if len(points) > MOST_CORNERS:
        line = shapely.simplify(shapely.LineString(points), ROUGH_DEG, preserve_topology=False)
        points = shapely.get_coordinates(line)
        if not 4 <= len(points) <= MOST_CORNERS:
            return None
        ring = shapely.Polygon(points)
    pieces = shapely.polygonize([shapely.unary_union(shapely.LineString(points))])
    ground = shapely.union_all(shapely.get_parts(pieces))
    meant = shapely.area(ground) > 0 and shapely.area(ring) >= SLIP * shapely.area(ground)
    return ground if meant else None
