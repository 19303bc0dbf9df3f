"""The geofence: inclusion and exclusion polygons and circles, as uploaded with mission type FENCE."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from sim.autopilot.commands import whole
from sim.autopilot.dialect import M

_POLYGONS = {
    M.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION: True,
    M.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION: False,
}
_CIRCLES = {M.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION: True, M.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION: False}


def inside_polygon(x: float, y: float, corners: Sequence[tuple[float, float]]) -> bool:
    """Is the point inside, by counting the edges a ray crosses."""
    inside = False
    for (ax, ay), (bx, by) in zip(corners, [*corners[1:], corners[0]], strict=True):
        if (ay > y) != (by > y) and x < ax + (y - ay) * (bx - ax) / (by - ay):
            inside = not inside
    return inside


class Fence:
    """Shapes in 1e-7 degrees; empty allows everything."""

    def __init__(self) -> None:
        self._polygons: list[tuple[bool, list[tuple[float, float]]]] = []
        self._circles: list[tuple[bool, float, float, float]] = []

    def load(self, items: Sequence[Any]) -> None:
        """Take the fence from mission items."""
        self._polygons, self._circles = [], []
        k = 0
        while k < len(items):
            item = items[k]
            if item.command in _POLYGONS:
                count = max(whole(item.param1), 1)
                corners = [(float(each.x), float(each.y)) for each in items[k : k + count]]
                self._polygons.append((_POLYGONS[item.command], corners))
                k += count
                continue
            if item.command in _CIRCLES:
                self._circles.append(
                    (_CIRCLES[item.command], float(item.x), float(item.y), float(item.param1))
                )
            k += 1

    @property
    def empty(self) -> bool:
        """No shape at all."""
        return not self._polygons and not self._circles

    def allows(self, latitude_e7: float, longitude_e7: float) -> bool:
        """Inside every inclusion and outside every exclusion."""
        for wanted, corners in self._polygons:
            if inside_polygon(latitude_e7, longitude_e7, corners) != wanted:
                return False
        for wanted, x, y, radius in self._circles:
            east = (longitude_e7 - y) * math.cos(math.radians(x * 1e-7))
            if (math.hypot(latitude_e7 - x, east) * 0.0111319 <= radius) != wanted:
                return False
        return True
