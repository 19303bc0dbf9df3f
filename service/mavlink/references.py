"""What heights and places are counted from, and whether that has moved.

Home, the origin of the estimator's frame, and sea level (the altitude of home that the two altitudes of a position
imply) are all told by the vehicle, and all of them can move in flight: a barometer's correction, another geoid, a new
home by a ground station. One message is not believed; what two in a row say is an event with both values. PX4 tells a
new origin once only: that is believed where the position has jumped with it.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import replace

from service.geometry import distance_m, offset_m
from service.mavlink.events import Home, ReferenceMoved
from service.mavlink.telemetry import Telemetry

_MOVED_M = 10.0  # more than home drifts when it is set anew at arming
_HEIGHT_M = 5.0
_SURE_AFTER = 2
_TOGETHER_S = 30.0  # the origin is told seldom, and the position often
_ALIKE = 0.2  # of the way: as near a jump has to come to the way of the origin
_LONGEST_STEP_S = 3.0


class References:
    """The references as they were when they were first told, or last moved."""

    def __init__(self) -> None:
        self._known: dict[str, Home] = {}
        self._moved: dict[str, tuple[Home, int]] = {}
        self._last: tuple[Telemetry, float] | None = None
        self._jumps: deque[tuple[float, float, float]] = deque(maxlen=20)  # when, east, north

    def forget(self) -> None:
        """The vehicle has rebooted: they are told anew."""
        self._known.clear()
        self._moved.clear()
        self._jumps.clear()
        self._last = None

    def read(self, t: Telemetry, message: str, now: float) -> ReferenceMoved | None:
        """Take in what a message has told; returns what has moved, once that is sure."""
        if message == "HOME_POSITION":
            return self._look("home", t.home, now)
        if message == "GPS_GLOBAL_ORIGIN":
            moved = self._look("origin", t.origin, now)
            if moved is None:
                return self._with_the_position(now)
            return replace(moved, position_too=self._went_along(moved))
        if message == "GLOBAL_POSITION_INT":
            if self._note_jump(t, now) and (moved := self._with_the_position(now)):
                return moved
            if math.isfinite(t.alt_home_m):
                return self._look("sea level", Home(0.0, 0.0, t.alt_amsl_m - t.alt_home_m), now)
        return None

    def _with_the_position(self, now: float) -> ReferenceMoved | None:
        """An origin that was told anew once, where the position has jumped with it."""
        if "origin" not in self._moved:
            return None
        moved = ReferenceMoved(
            now, "origin", self._known["origin"], self._moved["origin"][0], position_too=True
        )
        if not self._went_along(moved):
            return None
        self._known["origin"] = self._moved.pop("origin")[0]
        return moved

    def _note_jump(self, t: Telemetry, now: float) -> bool:
        """Whether the position is far from where the speeds of the last two say it should be."""
        last, self._last = self._last, (t, now)
        if last is None or not 0.0 < now - last[1] <= _LONGEST_STEP_S:
            return False
        before, seconds = last[0], now - last[1]
        east, north = offset_m((before.lat, before.lon), (t.lat, t.lon))
        pace_north, pace_east = (
            0.5 * (before.velocity_ned_mps[axis] + t.velocity_ned_mps[axis]) * seconds for axis in (0, 1)
        )
        jump = (east - pace_east, north - pace_north)
        jumps = math.hypot(*jump) > _MOVED_M
        if jumps:
            self._jumps.append((now, *jump))
        return jumps

    def _went_along(self, moved: ReferenceMoved) -> bool:
        """Whether the position has lately jumped as far, and to the same side, as the origin has moved."""
        a, b = moved.before, moved.after
        way = offset_m((a.lat, a.lon), (b.lat, b.lon))
        far = math.hypot(*way)
        lately = [jump for when, *jump in self._jumps if moved.time - when <= _TOGETHER_S]
        return far > _MOVED_M and any(math.dist(way, jump) <= _ALIKE * far for jump in lately)

    def _look(self, what: str, found: Home | None, now: float) -> ReferenceMoved | None:
        if found is None:
            return None
        known = self._known.setdefault(what, found)
        if _same(known, found):
            self._moved.pop(what, None)
            return None
        before, times = self._moved.get(what, (found, 0))
        times = times + 1 if _same(before, found) else 1
        self._moved[what] = found, times
        if times < _SURE_AFTER:
            return None
        del self._moved[what]
        self._known[what] = found
        return ReferenceMoved(now, what, known, found)


def _same(a: Home, b: Home) -> bool:
    near = distance_m((a.lat, a.lon), (b.lat, b.lon)) <= _MOVED_M
    return near and abs(a.alt_amsl_m - b.alt_amsl_m) <= _HEIGHT_M
