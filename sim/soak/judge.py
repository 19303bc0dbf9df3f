"""The judge on the wire: for every message of the service's that moves the aircraft, may it have been sent?

It knows what the service knows, because it reads the same frames in the same order: the state that the service has
told the pilot (STATUSTEXT "search STATE: ..."), the mode in the last heartbeat, the last few positions. Times are
wall times (monotonic).
"""

from __future__ import annotations

import math
import re
import threading
from collections import Counter, deque
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sim.soak import ground
from sim.soak.tap import motion_name

_STATE = re.compile(r"search ([A-Z]+):")
_SLACK_S = 0.6  # frames cross on the wire, and this process may have to wait for a processor
_POSITIONS = 12
_ORDER_S = 15.0
_NEAR_M = 60.0  # a stop lies this far ahead at most
_GUIDED = {"px4": 4 << 16 | 3 << 24, "ardupilot": 4}

_FLY = {"SEARCHING", "CONFIRMING", "RETURNING"}
_HOVER = {"HOLDING", "FOUND"}  # one stop, at the beginning
_ALLOWED: dict[str, set[str]] = {
    "MAV_CMD_DO_REPOSITION": _FLY | _HOVER,
    "MAV_CMD_DO_CHANGE_SPEED": {"SEARCHING", "CONFIRMING"},
    "MAV_CMD_NAV_RETURN_TO_LAUNCH": {"RETURNING"},
    "MAV_CMD_COMPONENT_ARM_DISARM": {"TAKEOFF"},
    "MAV_CMD_NAV_TAKEOFF": {"TAKEOFF"},
    "MAV_CMD_DO_SET_MODE": {"READY", "TAKEOFF", "RETURNING"},  # elsewhere an operator must have ordered it
}


class Judge:
    """Reads both directions of one link. `violations` are sentences."""

    def __init__(self, flavor: str, speedup: float) -> None:
        self.violations: list[str] = []
        self.motions: Counter[str] = Counter()
        self.state = "WAITING"
        self._guided_mode = _GUIDED[flavor]
        self._late_s = 1.0 / speedup + _SLACK_S
        self._lock = threading.Lock()
        self._positions: deque[ground.LatLon] = deque(maxlen=_POSITIONS)
        self._not_guided_since = math.inf
        self._taken_at = math.inf
        self._ordered_at = -math.inf
        self._sent_away_at = -math.inf  # when we last asked for another mode
        self._stop: ground.LatLon | None = None

    def ordered(self, now: float) -> None:
        """An operator has just ordered something: the aircraft may be taken from its pilot."""
        with self._lock:
            self._ordered_at, self._taken_at = now, math.inf

    def started_over(self) -> None:
        """The service is another process now."""
        with self._lock:
            self.state, self._taken_at = "WAITING", math.inf

    def from_autopilot(self, message: Any, now: float) -> None:
        """A message on its way to the service."""
        if message.get_srcSystem() != 1 or message.get_srcComponent() != 1:
            return
        with self._lock:
            if message.get_type() == "GLOBAL_POSITION_INT":
                self._positions.append((message.lat * 1e-7, message.lon * 1e-7))
            elif message.get_type() == "HEARTBEAT":
                self._heard_mode(message.custom_mode == self._guided_mode, now)

    def _heard_mode(self, guided: bool, now: float) -> None:
        if guided:
            self._not_guided_since = math.inf
            return
        self._not_guided_since = min(self._not_guided_since, now)
        ours = now - max(self._sent_away_at, self._ordered_at) < _ORDER_S
        if self.state in _FLY | _HOVER and not ours:
            self._taken_at = min(self._taken_at, now)

    def from_service(self, message: Any, now: float) -> None:
        """A message of the service's."""
        with self._lock:
            if message.get_type() == "STATUSTEXT":
                if (told := _STATE.match(message.text)) and told.group(1) != self.state:
                    self.state, self._stop = told.group(1), None
                return
            name = motion_name(message)
            if not name:
                return
            self.motions[name] += 1
            for objection in self._objections(name, message, now):
                self.violations.append(f"{name} in {self.state}: {objection}")

    def _objections(self, name: str, message: Any, now: float) -> list[str]:
        if name not in _ALLOWED:
            return ["this service has no use for it"]
        recently_ordered = now - self._ordered_at < _ORDER_S
        found = []
        if name in ("MAV_CMD_NAV_RETURN_TO_LAUNCH", "MAV_CMD_DO_SET_MODE"):
            self._sent_away_at = now
        if self.state not in _ALLOWED[name] and not (name == "MAV_CMD_DO_SET_MODE" and recently_ordered):
            found.append("not in this state")
        if now - self._taken_at > self._late_s:
            found.append(f"the pilot has had the aircraft for {now - self._taken_at:.2f} s")
        if name == "MAV_CMD_DO_REPOSITION":
            found += self._reposition(message, now)
        return found

    def _reposition(self, message: Any, now: float) -> list[str]:
        there = (message.x * 1e-7, message.y * 1e-7)
        found = []
        if now - self._not_guided_since > self._late_s:
            found.append(f"the mode has not been the guided one for {now - self._not_guided_since:.2f} s")
        if self.state in _HOVER:
            if self._stop is not None and self._stop != there:
                found.append("a second stop in one hover")
            self._stop = there
            if self._positions and min(_distance(here, there) for here in self._positions) > _NEAR_M:
                found.append("a stop far away")
        else:
            searching = self.state in ("SEARCHING", "CONFIRMING")
            objections = [ground.why_not(here, there, searching=searching) for here in self._positions]
            if objections and all(objections):
                found.append(objections[-1])
            height = message.z - ground.GROUND_AMSL_M
            if abs(height - ground.HEIGHT_M) > 1.0:
                found.append(f"{height:.1f} m above home")
        if message.param2 != 0:
            found.append("it may change the mode")
        if message.frame != mavlink.MAV_FRAME_GLOBAL:
            found.append(f"frame {message.frame}")
        return found


def _distance(here: ground.LatLon, there: ground.LatLon) -> float:
    (east, north), (east2, north2) = ground.metres(here), ground.metres(there)
    return math.hypot(east2 - east, north2 - north)
