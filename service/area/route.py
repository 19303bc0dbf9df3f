"""Straight legs and routes that keep clear of the exclusions.

The shortest way around polygons bends only at their corners. So a route is a shortest path
in the visibility graph: from, to, and the corners of the exclusions moved outwards, joined
wherever the straight leg is clear. It needs no cells: it works from a launch point outside
the grid, and does not depend on the cell size.
"""

import heapq
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from service.area.frame import BoolArray, GridFrame
from service.area.model import Exclusion
from service.area.projection import FloatArray
from service.area.zone import Zone
from service.errors import BadInput
from service.geometry import LatLon

_SPARE_M = 0.5
"""Leaving the zone by the nearest way ends this far outside it."""

_ABOUT = 1.5
"""So much longer than the nearest way out a leg out of the zone may be: the aircraft drifts while it is sent."""

_TOLERANCES_M = (0.5, 1.0, 2.0, 4.0, 8.0)
_MAX_CORNERS = 250
"""The outline of exclusions is simplified by these tolerances in turn until it has this many corners."""

_MOST_CORNERS = 500
"""With more, even simplified as far as that, a way home takes longer to find than an aircraft should wait for it."""

_MOST_DRAWN = 2000
"""Corners of the zone itself; one that has more is simplified, outwards, by what the aircraft keeps clear of anyway."""


@dataclass(frozen=True)
class KeepOut:
    """The exclusions on the plane of a grid, in its metres.

    Attributes:
        zone: the exclusions grown by the clearance; a leg must not touch it.
        corners: float [k, 2], where a route may bend, all outside the zone.
        shell: a slightly larger zone, whose edge is where one leaves it by the nearest way.
        core: the exclusions as drawn.
    """

    zone: Zone
    corners: FloatArray
    shell: shapely.Geometry
    core: Zone

    def clear(self, start: FloatArray, ends: FloatArray) -> BoolArray:
        """Which straight legs from a point [2] to points [k, 2] stay outside the zone, bool [k]."""
        legs = np.stack([np.broadcast_to(start, ends.shape), ends], axis=1)
        return np.asarray(~shapely.intersects(self.zone.prepared, shapely.linestrings(legs)), dtype=np.bool_)

    def way_out(self, point: FloatArray) -> FloatArray:
        """The point itself [2], or when it is in the zone the nearest point outside."""
        if not shapely.intersects_xy(self.zone.prepared, *point):
            return point
        edge = shapely.boundary(self.shell)
        nearest = shapely.shortest_line(shapely.Point(point), edge)
        return np.asarray(shapely.get_coordinates(nearest)[1])


def keep_out(frame: GridFrame, exclusions: Sequence[Exclusion], clearance_m: float) -> KeepOut:
    """The exclusions grown by `clearance_m` metres, ready for `leg_is_clear` and `way_home`.

    Raises:
        BadInput: they have more corners, simplified, than a route can be found around in time.
    """
    return keep_out_of(shapely.union_all([frame.flatten(item.polygon) for item in exclusions]), clearance_m)


def keep_out_of(flat: shapely.Geometry, clearance_m: float) -> KeepOut:
    """The same for exclusions on the plane. Raises BadInput as `keep_out`."""
    drawn = shapely.get_num_coordinates(flat)
    zone = shapely.buffer(flat, clearance_m)
    if shapely.get_num_coordinates(zone) > _MOST_DRAWN:  # as drawn by a river's bank or a computer
        spare = clearance_m / 2
        flat = shapely.simplify(shapely.buffer(flat, spare), spare)  # never inside of what was drawn
        zone = shapely.buffer(flat, clearance_m)
    for tolerance in _TOLERANCES_M:
        # A mitred outline grown by 2 x tolerance and then simplified by 1 x stays outside the zone.
        grown = shapely.buffer(flat, clearance_m + 2 * tolerance, join_style="mitre", mitre_limit=2.0)
        corners = shapely.get_coordinates(shapely.simplify(grown, tolerance))
        if len(corners) <= _MAX_CORNERS:
            break
    if len(corners) > _MOST_CORNERS:
        raise BadInput(
            f"the exclusions have {drawn} corners, and {len(corners)} when drawn to {_TOLERANCES_M[-1]:g} m; "
            f"a way around more than {_MOST_CORNERS} is not found in time, so draw fewer or simpler ones"
        )
    corners = np.unique(corners, axis=0)
    around = Zone(zone)
    outside = ~shapely.intersects_xy(around.prepared, corners[:, 0], corners[:, 1])
    return KeepOut(around, corners[outside], shapely.buffer(flat, clearance_m + _SPARE_M), Zone(flat))


def shortest_route(blocked: KeepOut, start: FloatArray, end: FloatArray) -> list[FloatArray] | None:
    """The bends and the end of the shortest clear route between points [2] in metres; None if there is none.

    From inside the zone it first leaves by the nearest way; into the zone it enters likewise.
    """
    first, last = blocked.way_out(start), blocked.way_out(end)
    points = np.vstack([first, last, blocked.corners])
    length = np.full(len(points), np.inf)
    came_from = np.full(len(points), -1)
    done = np.zeros(len(points), dtype=bool)
    length[0] = 0.0
    queue = [(0.0, 0)]
    while queue and not done[1]:
        _, here = heapq.heappop(queue)
        if done[here]:
            continue
        done[here] = True
        others = np.flatnonzero(~done)
        reach = length[here] + np.hypot(*(points[others] - points[here]).T)
        others = others[reach < length[others]]
        others = others[blocked.clear(points[here], points[others])]
        length[others] = length[here] + np.hypot(*(points[others] - points[here]).T)
        came_from[others] = here
        for index in others:
            heapq.heappush(queue, (float(length[index]), int(index)))
    if not done[1]:
        return None
    bends = [1]
    while came_from[bends[-1]] >= 0:
        bends.append(int(came_from[bends[-1]]))
    route = [points[index] for index in reversed(bends)]
    route = route[1:] if first is start else route
    return route if last is end else [*route, end]


def leg_is_clear(frame: GridFrame, blocked: KeepOut, start: LatLon, end: LatLon) -> bool:
    """Whether the straight leg between two positions stays outside every exclusion and its clearance."""
    points = frame.to_metres([start, end])
    return bool(blocked.clear(points[0], points[1:])[0])


def leads_out(frame: GridFrame, blocked: KeepOut, start: LatLon, end: LatLon) -> bool:
    """Whether a straight leg leaves the zone that it begins in by about the nearest way, and stays outside."""
    points = frame.to_metres([start, end])
    inside = shapely.intersection(blocked.zone.shape, shapely.LineString(points))
    begins, ends = shapely.intersects_xy(blocked.zone.prepared, points[:, 0], points[:, 1])
    nearest = shapely.distance(shapely.Point(points[0]), shapely.boundary(blocked.shell))
    about = inside.length <= _ABOUT * nearest + _SPARE_M
    return bool(begins and not ends and inside.geom_type == "LineString" and about)


def way(frame: GridFrame, blocked: KeepOut, start: LatLon, end: LatLon) -> list[LatLon] | None:
    """The shortest route between two positions that no exclusion is in the way of.

    Returns:
        the positions to fly to in order, the last being `end`; just [`end`] when the straight
        leg is clear. When `start` lies inside an exclusion or its clearance (wind, drift), the
        first position is the nearest one outside; the same, backwards, for `end`. None: an
        exclusion closes every way.
    """
    points = frame.to_metres([start, end])
    route = shortest_route(blocked, points[0], points[1])
    if route is None:
        return None
    bends = [(float(lat), float(lon)) for lat, lon in frame.from_metres(np.array(route[:-1]))]
    return [*bends, end]
