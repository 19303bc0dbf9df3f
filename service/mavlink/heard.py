"""What was heard, each with its time, and the telemetry that can be believed of it now.

Every message (of every battery, every receiver) is kept with the time at which it was taken over. `view` puts together
those that are not old; what only old ones tell is unknown. The age of what was told counts the time in which the
vehicle was heard at all: while its heartbeats stay away nothing grows old, for then the link is lost, and everybody is
told that.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from service.mavlink.batteries import Battery, together
from service.mavlink.framing import Message
from service.mavlink.heights import ToldAltitudes
from service.mavlink.landing import Landing
from service.mavlink.readers import READERS
from service.mavlink.sentinels import KnownFields
from service.mavlink.settings import MavlinkSettings
from service.mavlink.sources import SOURCES
from service.mavlink.telemetry import Gps, Telemetry

_GROUPS = frozenset({"battery", "gps", "estimator_ok", "sticks"})
_KEPT_WHEN_OLD = ("lat", "lon", "alt_amsl_m", "alt_home_m", "home_lifted_m")
_MOST_BATTERIES = 16
_BETWEEN_BEATS_S = 1.5
_AGAIN_S = 0.1  # while the link is lost things stay as they are, and need not be sorted out at each look
_Key = tuple[str, int]


@dataclass(frozen=True, slots=True)
class _Told:
    """What one message has told."""

    time: float
    heard_s: float
    fields: Mapping[str, Any]
    had_percent: bool = False
    stamp: int = 0
    """The vehicle's own time of it, in whatever unit; 0: not told."""


_STAMPED_WHEN_SET = frozenset({"HOME_POSITION", "GPS_GLOBAL_ORIGIN"})
"""PX4 stamps them with the time at which the place was set, however often it tells it."""


class Heard:
    """The memory of one vehicle's messages. `base` is what does not come from them: heartbeat, control, readiness."""

    def __init__(self, settings: MavlinkSettings) -> None:
        self._shortest_s = settings.shortest_age_s
        self._base = Telemetry()
        self.boot_s: float | None = None
        """The vehicle's own time since it booted."""
        self._gap_s = 0.0
        self._told: dict[_Key, _Told] = {}
        self._times: dict[str, float] = {}
        self._fields: dict[str, Any] = {}  # of Telemetry, as far as messages that are not old tell them
        self._landing = Landing()
        self._heights = ToldAltitudes()
        self._old: frozenset[str] = frozenset()
        self._sorted_until = -math.inf  # nothing becomes old before
        self._seen: Telemetry | None = None

    @property
    def sea_m(self) -> float:
        """How far all altitudes above the sea have been corrected upwards, in metres."""
        return self._heights.sea_m

    @property
    def base(self) -> Telemetry:
        """What does not come from the messages of the table."""
        return self._base

    @base.setter
    def base(self, value: Telemetry) -> None:
        silent_s = value.heartbeat_time - self._base.heartbeat_time
        if math.isfinite(silent_s):
            self._gap_s += max(0.0, silent_s - _BETWEEN_BEATS_S)
        if value.heartbeat_time != self._base.heartbeat_time:
            self._landing.on_armed(value.armed, value.heartbeat_time)
        self._base, self._seen = value, None

    def forget(self, base: Telemetry) -> None:
        """The vehicle has rebooted: nothing that it told before is true any longer."""
        self._told.clear()
        self._times.clear()
        self._heights.begin()
        self._base, self._seen, self._sorted_until = base, None, -math.inf

    def take(self, message: Message, now: float) -> bool:
        """Take a message over; False when it is not one of the table, tells nothing that could be used,
        or has the stamp of the one before."""
        name = message.get_type()
        reader = READERS.get(name)
        fields = None if reader is None else reader(KnownFields(message))
        if fields is None:
            return False
        battery = fields.get("battery")
        number = battery.number if isinstance(battery, Battery) else 0
        if number >= _MOST_BATTERIES:
            return False
        before = self._told.get((name, number))
        stamp = getattr(message, "time_boot_ms", 0) or getattr(message, "time_usec", 0)
        if before is not None and stamp and stamp == before.stamp and name not in _STAMPED_WHEN_SET:
            return False  # said again, and no younger than it was
        if name == "GLOBAL_POSITION_INT":
            fields = {**fields, **self._over_the_ground(fields, now)}
        had = isinstance(battery, Battery) and battery.percent is not None
        had = had or (before is not None and before.had_percent)
        self._told[name, number] = _Told(now, self._heard_s(now), fields, had, stamp)
        self._times[name] = now
        if before is None or name in self._old or not _GROUPS.isdisjoint(fields):
            self._sorted_until = -math.inf
        else:
            self._fields.update(fields)
        self._seen = None
        return True

    def view(self, now: float) -> Telemetry:
        """What can be believed now."""
        if now >= self._sorted_until:
            self._sort_out(now)
            self._seen = None
        if self._seen is None:
            self._seen = self._put_together(now)
        return self._seen

    # ---- inside

    def _over_the_ground(self, fields: Mapping[str, Any], now: float) -> dict[str, float]:
        """The height of a position, which home does not change by moving while the aircraft flies."""
        if not self._base.armed or self._fields.get("landed_state") == "on_ground":
            self._heights.begin()
        sea_m, home_m, down_mps = fields["alt_amsl_m"], fields["alt_home_m"], fields["velocity_ned_mps"][2]
        height_m = self._heights.read(sea_m, home_m, down_mps, now)
        return {"alt_home_m": height_m, "home_lifted_m": self._heights.lifted_m}

    def _heard_s(self, now: float) -> float:
        """Time in which the vehicle was heard, up to now."""
        last = self._base.heartbeat_time
        return (min(now, last + _BETWEEN_BEATS_S) if math.isfinite(last) else now) - self._gap_s

    def _limit_s(self, key: _Key) -> float:
        return max(SOURCES[key[0]].old_after_s, self._shortest_s)

    def _sort_out(self, now: float) -> None:
        """Which messages are old, and what the others tell together."""
        heard_s = self._heard_s(now)
        fresh: list[_Told] = []
        batteries: list[Battery] = []
        old: set[str] = set()
        self._fields, self._sorted_until = {}, math.inf
        for key, told in self._told.items():
            stale = heard_s - told.heard_s > self._limit_s(key)
            if stale:
                old.add(key[0])
                self._fields |= {name: told.fields[name] for name in _KEPT_WHEN_OLD if name in told.fields}
            else:
                fresh.append(told)
                self._fields |= {name: told.fields[name] for name in told.fields if name not in _GROUPS}
                self._sorted_until = min(self._sorted_until, told.time + self._limit_s(key))
            if "battery" in told.fields:
                batteries.append(replace(told.fields["battery"], old=stale, had_percent=told.had_percent))
        self._sorted_until = max(self._sorted_until, now + _AGAIN_S)
        self._old = frozenset(old)
        self._fields |= _charge(batteries) | _receivers(fresh)
        self._fields["estimator_ok"] = _all_agree([told.fields.get("estimator_ok") for told in fresh])
        self._fields["sticks"] = max(_known(told.fields.get("sticks") for told in fresh), default=None)

    def _put_together(self, now: float) -> Telemetry:
        told, height = self._fields.get("landed_state", "undefined"), self._fields.get("alt_home_m", math.nan)
        t = replace(
            self._base,
            told=dict(self._times),
            old=self._old,
            boot_time_s=self.boot_s,
            position_time=self._times.get("GLOBAL_POSITION_INT", -math.inf),
            status_time=self._times.get("SYS_STATUS", -math.inf),
            **{**self._fields, "landed_state": self._landing.judge(told, height, now)},
        )
        if math.isfinite(t.heading_deg):
            return t
        heading = t.yaw_deg if math.isfinite(t.yaw_deg) else t.course_deg
        return replace(t, heading_deg=heading) if math.isfinite(heading) else t


def _charge(batteries: list[Battery]) -> dict[str, Any]:
    charge = together(batteries)
    return {
        "battery_percent": charge.percent,
        "battery_voltage_v": charge.voltage_v,
        "battery_current_a": charge.current_a,
        "battery_consumed_mah": charge.consumed_mah,
        "battery_state": charge.state,
    }


def _receivers(fresh: list[_Told]) -> dict[str, Any]:
    """The better of the receivers: the autopilot navigates by that one, or by both."""
    found: list[Gps] = [told.fields["gps"] for told in fresh if "gps" in told.fields]
    best = max(found, key=lambda gps: (gps.fix, gps.satellites or 0), default=Gps())
    return {
        "fix": best.fix,
        "satellites": best.satellites,
        "eph": best.eph,
        "horizontal_accuracy_m": best.horizontal_accuracy_m,
    }


def _all_agree(verdicts: list[bool | None]) -> bool | None:
    said = [verdict for verdict in verdicts if verdict is not None]
    return all(said) if said else None


def _known(values: Any) -> list[float]:
    return [value for value in values if value is not None]
