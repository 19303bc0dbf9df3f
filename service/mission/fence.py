"""Where the aircraft may be sent and where it may be: the area with a margin, the way from and to it, and heights.

While it searches, the aircraft keeps to the area grown by a margin. On its way to the area and home it keeps to the
convex hull of the area, of where it starts and lands and of the exclusions between, which it flies around, grown by
the same margin. Outside (drift, a pilot) a leg may only lead in, on one straight piece.

Pure geometry on the plane of the grid, in metres (east, south).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import shapely

from service.area.zone import Zone
from service.config import FlightSettings
from service.geometry import Metres

_CORNERING_M = 10.0  # how far off the line between two cells' centres the aircraft may turn
_DETOUR_M = 15.0  # how far outside an exclusion a way around it may bend
_SLACK_M = 2.0


@dataclass(frozen=True, eq=False)
class Fence:
    """The two zones: `search` while searching, `way` on the way from and to the area."""

    search: Zone
    way: Zone

    @classmethod
    def around(
        cls,
        outline: shapely.Geometry,
        bases: Sequence[Metres],
        exclusions: shapely.Geometry,
        cell_m: float,
        margin_m: float,
    ) -> Fence:
        """The fence of an area.

        Args:
            outline: the area as drawn.
            bases: where the aircraft starts and lands.
            exclusions: what is not flown over.
            cell_m: the side of a cell: the margin is never too narrow to fly over the outermost cells.
            margin_m: how far outside the area it may be.
        """
        margin = max(margin_m, cell_m * math.sqrt(0.5) + _CORNERING_M)
        way = shapely.union_all([outline, *(shapely.Point(base) for base in bases)]).convex_hull.buffer(
            margin
        )
        ahead = list(shapely.get_parts(exclusions))
        while between := [part for part in ahead if part.intersects(way)]:
            way = shapely.union_all([way, *(part.buffer(_DETOUR_M) for part in between)]).convex_hull
            ahead = [part for part in ahead if not any(part is each for each in between)]
        return cls(Zone(outline.buffer(margin)), Zone(way))

    def zone(self, *, on_way: bool) -> Zone:
        """The zone that counts now."""
        return self.way if on_way else self.search

    def leg_objection(self, here: Metres, there: Metres, *, on_way: bool) -> str:
        """Why a leg must not be flown, as a sentence's end, or nothing."""
        zone, name = self.zone(on_way=on_way), self.name(on_way=on_way)
        if not shapely.contains_xy(zone.prepared, *there):
            return f"lies outside {name}"
        outside = shapely.difference(shapely.LineString([here, there]), zone.shape)
        if outside.is_empty:
            return ""
        leads_in = outside.geom_type == "LineString" and not shapely.contains_xy(zone.prepared, *here)
        return "" if leads_in else f"lies behind ground outside {name}"

    def outside_m(self, here: Metres, *, on_way: bool) -> float:
        """How far outside the zone a place lies, in metres; 0 inside."""
        return float(shapely.distance(self.zone(on_way=on_way).shape, shapely.Point(here)))

    @staticmethod
    def name(*, on_way: bool) -> str:
        """The zone in words."""
        return "the way to the area and its margin" if on_way else "the area and its margin"


def height_objection(height_m: float, flight: FlightSettings) -> str:
    """Why the aircraft must not be at a height above home, as a sentence's end, or nothing."""
    if height_m > flight.max_height_m + _SLACK_M:
        return f"{height_m:.0f} m above home, more than {flight.max_height_m:g} m"
    if height_m < flight.min_height_m - _SLACK_M:
        return f"{height_m:.0f} m above home, less than {flight.min_height_m:g} m"
    return ""


class Straying:
    """An aircraft that has been where it may be, and is not any more."""

    def __init__(self) -> None:
        self._was_in = False

    def forget(self) -> None:
        """It may be on its way in again."""
        self._was_in = False

    def read(self, objection: str) -> str:
        """The objection to where it is now, once there was none before; else nothing."""
        self._was_in |= not objection
        return objection if self._was_in else ""
