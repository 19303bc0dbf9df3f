"""Where to fly when two aircraft stand in each other's way: to the nearest place that leaves room.

Over ground with heights the layers of two aircraft meet (the lower one up the slope is as high as the higher one below
it), and then each may wait for the other to move. So who has the worse right moves out of what the other waits for, and
who has been kept from every leg for long tries it from elsewhere.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

from roisearch.directions import STEPS
from service.geometry import LatLon
from service.mission.apart import SLACK_M
from service.mission.effects import SendWaypoint
from service.mission.phase import LOW_M
from service.mission.standing import Look

STANDS_MPS = 1.0
AGAIN_S = 5.0
_TURNS = 3  # eighths of a circle, from one time to the next
_TIMES = (1.5, 3.0, 6.0)  # the separation, so far off is looked for a place


class Aside:
    """Says where to make room, at most every few seconds: what was wanted then is to be flown first. Each time it looks
    in another direction first, as the last one may have led back to where it was kept."""

    def __init__(self) -> None:
        self._not_before = -math.inf
        self._turned = 0

    def place(self, look: Look) -> LatLon | None:
        """The nearest place to make room at, where that is wanted now and there is one."""
        t, traffic = look.seen.telemetry, look.helm.traffic
        if look.busy or look.now < self._not_before or not look.seen.others:
            return None
        if t.ground_speed_mps > STANDS_MPS or look.helm.goes_on(t):
            return None
        if t.alt_home_m < look.helm.heights.over_m((t.lat, t.lon)) - LOW_M:
            return None  # it climbs first, straight up
        if not traffic.in_the_way(t, look.seen.others, look.now):
            return None
        self._not_before = look.now + AGAIN_S
        for point in _places(look, self._turned):
            leg = look.helm.leg(point, t)
            waypoint = SendWaypoint(point, leg.altitude_m, on_way=True)
            if leg.climbs or look.helm.objection(waypoint, t, look.now) is not None:
                continue
            if traffic.makes_room(waypoint, t, look.seen.others, look.now):
                self._turned += _TURNS
                return point
        return None


def _places(look: Look, turned: int) -> Iterator[LatLon]:
    """Cells around that may be flown over, the nearest first, from a direction on."""
    directions = STEPS[turned % len(STEPS) :] + STEPS[: turned % len(STEPS)]
    chart, flight = look.chart, look.settings.flight
    (row, col), _ = chart.cell(look.seen.telemetry)
    rows, cols = chart.frame.shape
    for times in _TIMES:
        cells = math.ceil(times * (flight.separation_m + SLACK_M) / chart.frame.cell_m)
        for down, right in directions:
            there = row + cells * down, col + cells * right
            if 0 <= there[0] < rows and 0 <= there[1] < cols and chart.grid.flyable[there]:
                point = chart.latlon(there)
                if look.helm.allows(point):
                    yield point
