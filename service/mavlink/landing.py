"""Whether the aircraft is in the air, for autopilots whose EXTENDED_SYS_STATE does not come, or sticks.

What the autopilot says is believed unless it cannot be: an aircraft whose motors have been off for a while does not
fly; one that has risen since it was armed, without ever saying anything but 'on the ground', does; and one that stays
at its height does not take off any longer.
"""

from __future__ import annotations

import math

_OFF_S = 3.0
_RISEN_M = 5.0
_LEVEL_M, _LEVEL_S = 0.5, 4.0


class Landing:
    """The judge of one vehicle's landed state."""

    def __init__(self) -> None:
        self._armed = False
        self._off_since = math.inf
        self._armed_at_m = math.nan
        self._flew = False
        self._level_m, self._level_since = math.nan, math.inf
        self._up = False  # it was level while it said that it takes off

    def on_armed(self, armed: bool, now: float) -> None:
        """What a heartbeat shows."""
        if armed and not self._armed:
            self._armed_at_m, self._flew, self._up = math.nan, False, False
        self._armed = armed
        self._off_since = math.inf if armed else min(self._off_since, now)

    def judge(self, told: str, height_m: float, now: float) -> str:
        """The landed state to go by: what is told ("undefined": nothing), its height above home in metres (NaN: not
        known)."""
        if not self._armed:
            return "on_ground" if now - self._off_since >= _OFF_S else told
        self._flew |= told in ("takeoff", "in_air", "landing")
        if not math.isfinite(self._armed_at_m):
            self._armed_at_m = height_m
        risen = height_m - self._armed_at_m > _RISEN_M
        if told == "takeoff" and risen:
            return "in_air" if self._climbed(height_m, now) else told
        self._level_since, self._up = math.inf, False
        return "in_air" if told == "on_ground" and risen and not self._flew else told

    def _climbed(self, height_m: float, now: float) -> bool:
        """Whether the climb is over: it has been level for a while."""
        if not abs(height_m - self._level_m) <= _LEVEL_M or math.isinf(self._level_since):
            self._level_m, self._level_since = height_m, now
        self._up |= now - self._level_since >= _LEVEL_S
        return self._up
