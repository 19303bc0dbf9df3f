"""Heights for a route that is laid down before the flight: each of its points clears both legs that meet there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from service.area import Grid
from service.config import SPARE_M, FlightSettings
from service.geometry import LatLon
from service.ground.leg import GroundProfile, profile
from service.ground.relief import Floats, Relief

_PIECE_M = 60.0


@dataclass(frozen=True, eq=False)
class Route:
    """Points and the height at which each is flown, above the ground at the launch point.

    Between two points the lower of their heights clears the leg, so it does not matter how an autopilot gets from one
    height to the other.
    """

    points: tuple[LatLon, ...]
    heights: tuple[float, ...]


def route_over(grid: Grid, relief: Relief, flight: FlightSettings, points: Sequence[LatLon]) -> Route:
    """A route through points over ground with heights: legs are cut so that it follows the ground."""
    places = grid.frame.to_metres(points)
    cut = [places[0]]
    for start, end in pairwise(places):
        count = max(1, int(np.ceil(np.hypot(*(end - start)) / _PIECE_M)))
        cut += [start + share * (end - start) for share in np.arange(1, count + 1) / count]
    legs = [_leg(relief, start, end) for start, end in pairwise(cut)]
    least = [leg.highest_m + flight.clearance_m + SPARE_M for leg in legs]
    ground = relief.height_at(np.array(cut))
    heights = [
        max(float(below) + flight.altitude_m, *(least[i] for i in (k - 1, k) if 0 <= i < len(least)))
        for k, below in enumerate(ground)
    ]
    latlon = grid.frame.from_metres(np.array(cut))
    return Route(tuple((float(lat), float(lon)) for lat, lon in latlon), tuple(heights))


@dataclass(frozen=True, eq=False)
class SideView:
    """What a route looks like from the side: metres along it, the ground, the highest within reach, and the flight."""

    along: Floats
    ground: Floats
    roof: Floats
    flight: Floats

    @property
    def least(self) -> tuple[float, float]:
        """The least clearance, and how far along that is."""
        clear = self.flight - self.roof
        where = int(np.argmin(clear))
        return float(clear[where]), float(self.along[where])


def from_the_side(grid: Grid, relief: Relief, route: Route) -> SideView:
    """The route's profile; between two points it is drawn as a straight line."""
    places = grid.frame.to_metres(route.points)
    columns: list[tuple[Floats, ...]] = []
    before = 0.0
    for k in range(len(places) - 1):
        seen = _leg(relief, places[k], places[k + 1])
        share = seen.along / seen.length_m if seen.length_m > 0.0 else np.zeros(len(seen.along))
        flight = route.heights[k] + share * (route.heights[k + 1] - route.heights[k])
        columns.append((before + seen.along, seen.ground, seen.roof, flight))
        before += seen.length_m
    return SideView(*(np.concatenate(column) for column in zip(*columns, strict=True)))


def _leg(relief: Relief, start: Floats, end: Floats) -> GroundProfile:
    return profile(relief, (float(start[0]), float(start[1])), (float(end[0]), float(end[1])))
