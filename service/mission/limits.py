"""What must hold for the aircraft to be sent anywhere: pure checks over what is known, and three small memories.

A check returns reasons as sentences' ends; none means that it has no objection. The memories (`PositionTrust`,
`Progress`, `Lasting`) are given the time, in seconds of the service's clock, and look at no clock themselves.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

from service.config import FlightSettings
from service.geometry import distance_m, moved
from service.mavlink.telemetry import Telemetry, Wind

_FIX_3D = 3
_MARGIN_S = 1.5  # the vehicle tells its health once a second: so long may it have been bad unnoticed
_REMEMBERED = 100
_GPS_MESSAGES = frozenset({"GPS_RAW_INT", "GPS2_RAW"})
_HEALTH_MESSAGES = frozenset({"ESTIMATOR_STATUS", "EKF_STATUS_REPORT", "SYS_STATUS"})
_GOOD_EPH, _GOOD_ACCURACY_M = 2.0, 5.0  # as good as enough satellites, where the receiver does not count them


@dataclass(frozen=True, slots=True)
class Objection:
    """Why something must not be sent; `cause` is what must pass first: "position", "limits", "ground", "link",
    "apart" (from the other aircraft), "air" (its own word that it is there) or "state"."""

    cause: str
    reason: str


def position_objections(t: Telemetry, flight: FlightSettings, fresh_s: float) -> list[str]:
    """Why the position must not be trusted now: GPS_RAW_INT, the estimator's status, the position's age.

    The age is counted up to the last heartbeat: when that stays away too, the link is lost, and not the position.
    `fresh_s` seconds is the most that it may be, and that the link may take there and back: what comes late is old.
    `flight.min_satellites` of 0 asks for no GPS at all.
    """
    objections: list[str] = []
    age = t.heartbeat_time - t.position_time
    if age > fresh_s:
        objections.append(f"no new position for {age:.0f} s" if math.isfinite(age) else "no position")
    objections.append(_delay_objection(t.round_trip_s, fresh_s))
    if flight.min_satellites > 0:
        objections.append(_gps_objection(t, flight))
    objections.append(_health_objection(t))
    return [objection for objection in objections if objection]


def _delay_objection(round_trip_s: float | None, fresh_s: float) -> str:
    if round_trip_s is None or round_trip_s <= fresh_s:
        return ""
    if math.isinf(round_trip_s):
        return "the link was silent, and has yet to show how slow it is"
    return f"the link takes {round_trip_s:.0f} s there and back, and the position may be as old"


def _gps_objection(t: Telemetry, flight: FlightSettings) -> str:
    if t.fix < _FIX_3D:
        return "the GPS is not heard any longer" if t.old & _GPS_MESSAGES else "the GPS has no 3D fix"
    if t.satellites is not None:
        few = t.satellites < flight.min_satellites
        return f"the GPS has {t.satellites} satellites, fewer than {flight.min_satellites}" if few else ""
    accurate = t.horizontal_accuracy_m is not None and t.horizontal_accuracy_m <= _GOOD_ACCURACY_M
    if accurate or (t.eph is not None and t.eph <= _GOOD_EPH):
        return ""
    return "the GPS tells neither its satellites nor how accurate it is"


def _health_objection(t: Telemetry) -> str:
    """The estimator's own word and that of SYS_STATUS; what was told, and is not any longer, is no good word."""
    if t.estimator_ok is False:
        return "the autopilot's position estimate is not healthy"
    if t.sensors_failed:
        return f"the autopilot calls not healthy: {', '.join(t.sensors_failed)}"
    if t.estimator_ok is None and (silent := t.old & _HEALTH_MESSAGES):
        return f"the health of the autopilot's position estimate is not told any longer ({', '.join(sorted(silent))})"
    return ""


def reference_objection(t: Telemetry, flight: FlightSettings) -> str:
    """Why heights must not be trusted now, or nothing: HOME_POSITION and the position's two altitudes say how high home
    lies above the sea, and have to say the same."""
    if t.home is None or not t.position_known:
        return ""
    said = t.home_alt_amsl_m + t.home_lifted_m
    if abs(t.home.alt_amsl_m - said) <= flight.max_jump_m:
        return ""
    return f"home is {t.home.alt_amsl_m:.0f} m above the sea as told, and {said:.0f} m as the position says"


def not_airborne(t: Telemetry) -> str:
    """Why an armed aircraft may not be in the air by its own word, without which it is sent nowhere; or nothing."""
    if not t.armed or t.landed_state == "in_air":
        return ""
    says = (
        "does not say whether" if t.landed_state == "undefined" else f"says {t.landed_state!r}, and not that"
    )
    return f"the autopilot {says} the aircraft is in the air"


def no_stop(t: Telemetry) -> bool:
    """No waypoint can stop it: it may not be in the air by its own word, or where it is is not known."""
    placed = t.position_known and math.isfinite(t.lat + t.lon + t.alt_amsl_m)
    return bool(not_airborne(t)) or not placed


def hold_objection(held_s: float, flight: FlightSettings) -> str:
    """Why hovering for a fault has to end after so many seconds, or nothing."""
    return f"hovered for {held_s:.0f} s" if held_s > flight.max_hold_s else ""


def wind_objection(wind: Wind | None, flight: FlightSettings) -> str:
    """Why the wind is too much, or nothing; one that is not known (None) is told elsewhere, and no objection."""
    if wind is None or wind.speed_mps <= flight.max_wind_mps:
        return ""
    return f"wind of {wind.speed_mps:.0f} m/s, more than {flight.max_wind_mps:g} m/s"


@dataclass(frozen=True, slots=True)
class Sample:
    """A position; when it was told by the service's clock, and the vehicle's time since boot: seconds; degrees, m/s."""

    told: float
    boot_s: float
    lat: float
    lon: float
    north_mps: float
    east_mps: float

    @classmethod
    def of(cls, t: Telemetry) -> Sample | None:
        """The sample in a snapshot, if the vehicle has told one."""
        if t.boot_time_s is None or not t.position_known:
            return None
        return cls(t.position_time, t.boot_time_s, t.lat, t.lon, t.velocity_ned_mps[0], t.velocity_ned_mps[1])


def jump_m(before: Sample, after: Sample) -> float:
    """Metres between where `after` is and where the speeds of both say it should be."""
    seconds = after.boot_s - before.boot_s
    north = 0.5 * (before.north_mps + after.north_mps) * seconds
    east = 0.5 * (before.east_mps + after.east_mps) * seconds
    return distance_m(moved((before.lat, before.lon), east, north), (after.lat, after.lon))


class PositionTrust:
    """Whether the position may be trusted, and when it could not be.

    A position that was doubted is trusted again once there was nothing to object to for `flight.settle_s`
    seconds (the first time at once). A jump counts as an objection at its moment. `fresh_s`: see
    `position_objections`.
    """

    def __init__(self, flight: FlightSettings, fresh_s: float) -> None:
        self._flight, self._fresh_s = flight, fresh_s
        self._last: Sample | None = None
        self._was_good = False
        self._well_since = math.inf
        self._doubted: deque[tuple[float, float]] = deque(maxlen=_REMEMBERED)  # closed intervals of the clock
        self.doubts: list[str] = []
        """Why the position is not trusted now, as sentences' ends; empty: it is."""

    def update(self, t: Telemetry, now: float) -> list[str]:
        """Take a snapshot in; returns `doubts`."""
        objections = position_objections(t, self._flight, self._fresh_s) + self._jumped(t)
        if objections:
            if not self.doubts:
                self._doubted.append((now - _MARGIN_S, math.inf))
            self.doubts, self._well_since = objections, math.inf
        elif self.doubts:
            self._well_since = min(self._well_since, now)
            if now - self._well_since >= self._flight.settle_s or not self._was_good:
                began, _ = self._doubted[-1]
                self._doubted[-1] = (began, now)
                self.doubts = []
        self._was_good |= not self.doubts
        return self.doubts

    def trusted_at(self, time: float) -> bool:
        """False when the position of that time was, or is now known to have been, doubtful."""
        return not any(began <= time <= ended for began, ended in self._doubted)

    def _jumped(self, t: Telemetry) -> list[str]:
        before, after = self._last, Sample.of(t)
        if before is not None and after is not None and before.told == after.told:
            return []  # other messages have told the time since boot, but no new position has come
        self._last = after
        if before is None or after is None or after.boot_s <= before.boot_s:
            return []
        slack = 0.5 * self._flight.speed_mps * (after.boot_s - before.boot_s)
        jump = jump_m(before, after)
        return [f"the position jumped by {jump:.0f} m"] if jump > self._flight.max_jump_m + slack else []


class Progress:
    """Whether the aircraft comes nearer to its waypoint."""

    def __init__(self, patience_s: float, near_m: float) -> None:
        """No progress for `patience_s` seconds is too long; within `near_m` metres it has arrived."""
        self._patience_s, self._near_m = patience_s, near_m
        self.clear()

    def clear(self) -> None:
        """There is no waypoint, or a new one."""
        self._best_m, self._since = math.inf, math.inf

    def stuck(self, remaining_m: float, now: float) -> str:
        """Take the distance to the waypoint in; says why the aircraft counts as stuck, or nothing."""
        if remaining_m < self._best_m - 1.0 or remaining_m <= self._near_m or not math.isfinite(self._since):
            self._best_m, self._since = min(self._best_m, remaining_m), now
        waited = now - self._since
        if waited <= self._patience_s:
            return ""
        return f"no progress towards the waypoint for {waited:.0f} s, it is {remaining_m:.0f} m away"


class Lasting:
    """An objection that counts only once it has lasted."""

    def __init__(self, seconds: float) -> None:
        self._seconds, self._since = seconds, math.inf

    def after(self, objection: str, now: float) -> str:
        """The objection once it has been there for so long without a break, else nothing."""
        self._since = min(self._since, now) if objection else math.inf
        return objection if now - self._since >= self._seconds else ""
