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
from sim.soak.tap import is_probe, motion_name

_STATE = re.compile(r"search ([A-Z]+):")
_SLACK_S = 0.1  # frames cross on the wire
_POSITIONS = 12
_TARGETS = 4  # of ours that it may name
_SAME_M = 3.0
_ORDER_S = 15.0
_DRAIN = 1.3 * 100.0 / ground.ENDURANCE_S  # percent a second that flying takes at most
_LEAST_PERCENT = 15.0  # the service goes home at 20
_SPENT_PERCENT = 20.0  # from which on it may have to come down before it is home
_UNKNOWN_S = 30.0  # without a level for so long, it is not known on the ground
_SETTLED_S = 25.0  # a search has reached its height after so long
_STOP_AGAIN_S = 5.0  # later than that it is one that may have been lost, which the journal counts
_NEAR_M = 60.0  # a stop lies this far ahead at most
_ACCEPTED = mavlink.MAV_RESULT_ACCEPTED
_BRAKE = 17  # ArduCopter's mode
_STAND_STILL = "SET_POSITION_TARGET_LOCAL_NED"
OPERATOR = "the operator's hold"
_KEPT = 60  # of what went over the wire before a violation
_TOLD = {"COMMAND_ACK", "POSITION_TARGET_GLOBAL_INT", "STATUSTEXT"}
AFTER = " [after {}]"
"""What a violation says of the fault that came last."""
_GUIDED = {"px4": 4 << 16 | 3 << 24, "ardupilot": 4}

_FLY = {"SEARCHING", "CONFIRMING", "RETURNING"}
_HOVER = {"HOLDING", "FOUND"}  # one stop, at the beginning
_ALLOWED: dict[str, set[str]] = {
    "MAV_CMD_DO_REPOSITION": _FLY | _HOVER,
    "MAV_CMD_DO_CHANGE_SPEED": _FLY | _HOVER,  # moves nothing: sent again once the mode was entered anew
    "MAV_CMD_NAV_RETURN_TO_LAUNCH": {"RETURNING"},
    "MAV_CMD_NAV_LAND": {"RETURNING"},
    "MAV_CMD_COMPONENT_ARM_DISARM": {"TAKEOFF"},
    "MAV_CMD_NAV_TAKEOFF": {"TAKEOFF"},
    "MAV_CMD_DO_SET_MODE": {"READY", "TAKEOFF", "RETURNING"},  # elsewhere an operator must have ordered it
}


Place = tuple[float, float, float]
"""Latitude, longitude, and metres above sea level."""


class Judge:
    """Reads both directions of one link. `violations` are sentences; `wire` is what went over it before the first one,
    a line a message: what moves the aircraft, where it says it goes, its answers and texts."""

    def __init__(self, flavor: str, speedup: float, *, hill: bool = False) -> None:
        self._speedup, self._hill = speedup, hill
        self.violations: list[str] = []
        self.wire: list[str] = []
        self._lately: deque[str] = deque(maxlen=_KEPT)
        self.motions: Counter[str] = Counter()
        self.state = "WAITING"
        self._guided_mode = _GUIDED[flavor]
        self._late_s = 1.0 / speedup + _SLACK_S
        self._lock = threading.Lock()
        self._positions: deque[ground.LatLon] = deque(maxlen=_POSITIONS)
        self._sent: deque[Place] = deque(maxlen=_TARGETS)
        self._named: Place | None = None
        self._not_guided_since = math.inf
        self._armed = False
        self._taken_at = math.inf
        self._ordered_at = -math.inf
        self._sent_away_at = -math.inf  # when we last asked for another mode
        self._stop: ground.LatLon | None = None
        self._stopped_there_at = -math.inf
        self._homes: deque[float] = deque(maxlen=_POSITIONS)  # metres above sea level, as told
        self._grounds: deque[float] = deque(
            maxlen=_POSITIONS
        )  # the same of the ground at the launch point, if the aircraft is where it was
        self._altitude = ground.GROUND_AMSL_M
        self._stopped_at, self._stopped_by = math.inf, ""
        self._level: tuple[float, float] | None = None  # percent, when
        self._state_since = -math.inf
        self._return_answered_at = -math.inf
        self._too_close = False
        self._braked = False  # and not flown on since
        self._crashed = False
        self._marsh_since = math.inf
        self.steady = False  # nothing goes on that may lower the aircraft
        self.during = ""  # the fault that came last

    def _keep(self, who: str, message: Any, now: float) -> None:
        said = {name: value for name, value in message.to_dict().items() if value}
        self._lately.append(f"{now * self._speedup:.1f} s, {who}: {said}")

    def _see(self, violation: str) -> None:
        self.wire = self.wire or list(self._lately)
        self.violations.append(f"{violation}{AFTER.format(self.during)}" if self.during else violation)

    def ordered(self, now: float) -> None:
        """An operator has just ordered something: the aircraft may be taken from its pilot."""
        with self._lock:
            self._ordered_at, self._taken_at = now, math.inf
            self._stopped_at, self._stopped_by = math.inf, ""
            self._stop = None  # a person's hold stops it anew

    def stopped(self, now: float, by: str) -> None:
        """A person (`by`) has stopped the aircraft: until an operator orders something nothing of ours moves it."""
        with self._lock:
            self._stopped_at, self._stopped_by = now, by
            self._lately.append(f"{now * self._speedup:.1f} s, stopped: {by}")

    def goes_elsewhere(self) -> bool:
        """Whether the autopilot names a target that is none of ours: somebody else's has not been overtaken by ours."""
        with self._lock:
            return self._named is not None and not any(_same(self._named, each) for each in self._sent)

    @property
    def is_stopped(self) -> bool:
        """Has a person stopped the aircraft, and nobody ordered anything since?"""
        with self._lock:
            return bool(self._stopped_by) or self._taken_at < math.inf

    def truth(self, up: float, here: ground.LatLon, now: float, *, crashed: bool = False) -> None:
        """Where the aircraft truly is, `up` metres above the ground below it, whatever it tells; or that it has
        crashed."""
        with self._lock:
            if crashed and not self._crashed:
                self._crashed = True
                # not ours where the autopilot lands it, by a position that jumps
                if self._not_guided_since == math.inf or self.during != "gps_jump":
                    self._see(f"the aircraft has crashed in {self.state}")
            self._grounds.append(self._altitude - up - ground.rise(here, hill=self._hill))
            searching = self.state in ("SEARCHING", "CONFIRMING")
            settled = searching and self.steady and (now - self._state_since) * self._speedup > _SETTLED_S
            too_close = ground.too_close(here, up, hill=self._hill) if settled else ""
            if too_close and not self._too_close:
                self._see(f"closer than allowed in {self.state}: {too_close}")
            self._too_close = bool(too_close)

    def excluded(self, since: float) -> None:
        """The marsh is excluded since then (monotonic); infinite: not any more."""
        with self._lock:
            self._marsh_since = since

    def started_over(self) -> None:
        """The service is another process now."""
        with self._lock:
            self.state, self._state_since = "WAITING", -math.inf

    def from_autopilot(self, message: Any, now: float) -> None:
        """A message on its way to the service."""
        if message.get_srcSystem() != 1 or message.get_srcComponent() != 1:
            return
        with self._lock:
            if message.get_type() in _TOLD:
                self._keep("autopilot", message, now)
            if message.get_type() == "GLOBAL_POSITION_INT":
                self._positions.append((message.lat * 1e-7, message.lon * 1e-7))
                self._altitude = message.alt / 1000.0
                self._homes.append((message.alt - message.relative_alt) / 1000.0)
            elif message.get_type() == "POSITION_TARGET_GLOBAL_INT":
                over_home = message.coordinate_frame == mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT
                home = self._homes[-1] if over_home and self._homes else 0.0
                self._named = (message.lat_int * 1e-7, message.lon_int * 1e-7, message.alt + home)
            elif message.get_type() in ("SYS_STATUS", "BATTERY_STATUS"):
                if message.battery_remaining >= 0:
                    self._level = (float(message.battery_remaining), now)
            elif message.get_type() == "COMMAND_ACK":
                if message.command == mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH:
                    self._return_answered_at = now
                if message.command == mavlink.MAV_CMD_DO_REPOSITION and message.result != _ACCEPTED:
                    self._stop = None  # it has not stopped there: the next stop is where it can by then
            elif message.get_type() == "HEARTBEAT":
                self._armed = bool(message.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)
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
                    self._state_since = now
                return
            if is_probe(message) and (self._guided_mode == _GUIDED["px4"] or self._armed):
                self._see("a place that is not on earth is asked for in flight, or of who would fly there")
            name = motion_name(message)
            if not name:
                return
            self.motions[name] += 1
            self._keep("service", message, now)
            for objection in self._objections(name, message, now):
                self._see(f"{name} in {self.state}: {objection}")

    def _objections(self, name: str, message: Any, now: float) -> list[str]:
        taken = now - self._taken_at
        found = [f"the pilot has had the aircraft for {taken:.2f} s"] if taken > self._late_s else []
        if self._is_brake(name, message):
            self._sent_away_at = now
            return found
        if name not in _ALLOWED:
            return ["this service has no use for it"]
        recently_ordered = now - self._ordered_at < _ORDER_S
        if name in ("MAV_CMD_NAV_RETURN_TO_LAUNCH", "MAV_CMD_DO_SET_MODE"):
            self._sent_away_at = now
        leads_out = name == "MAV_CMD_DO_SET_MODE" and (recently_ordered or self._braked)
        if self.state not in _ALLOWED[name] and not leads_out:
            found.append("not in this state")
        if name == "MAV_CMD_DO_REPOSITION":
            found += self._reposition(message, now)
        spent = self._level is not None and self._level[0] <= _SPENT_PERCENT
        if name == "MAV_CMD_NAV_LAND" and self._return_answered_at < self._state_since and not spent:
            found.append("it lands where it is, and the return home was never answered")
        return [*found, *self._against_a_person(name, now), *self._on_an_unknown_battery(name, now)]

    def _is_brake(self, name: str, message: Any) -> bool:
        """Stops that need no position, while it hovers: a reposition to nowhere, the mode BRAKE, no velocity."""
        if name == "MAV_CMD_DO_REPOSITION" and message.get_type() == "COMMAND_LONG":
            stops = math.isnan(message.param5) and math.isnan(message.param6) and message.param2 == 0.0
        elif name == "MAV_CMD_DO_SET_MODE":
            stops = self._guided_mode == _GUIDED["ardupilot"] and message.param2 == _BRAKE
        else:
            velocity = [getattr(message, axis, 1.0) for axis in ("vx", "vy", "vz")]
            stops = name.startswith(_STAND_STILL) and not any(velocity)
        braked = stops and self.state in _HOVER | _FLY
        self._braked = braked or (self._braked and name != "MAV_CMD_DO_REPOSITION")
        return braked

    def _against_a_person(self, name: str, now: float) -> list[str]:
        """It may stop or fly home after an operator's hold; after anybody else's word nothing at all."""
        late = now - self._stopped_at
        own = self._stopped_by == OPERATOR and self.state in _HOVER | {"RETURNING"}
        if late <= self._late_s or own or name == "MAV_CMD_DO_CHANGE_SPEED":
            return []
        by, self._stopped_at = self._stopped_by, math.inf  # one violation is enough
        return [f"moved {late:.2f} s after a person's stop ({by})"]

    def _on_an_unknown_battery(self, name: str, now: float) -> list[str]:
        if name in ("MAV_CMD_COMPONENT_ARM_DISARM", "MAV_CMD_NAV_TAKEOFF"):
            if self._level is None or (now - self._level[1]) * self._speedup > _UNKNOWN_S:
                return ["took off on an unknown battery"]
            return []
        if name != "MAV_CMD_DO_REPOSITION" or self.state not in ("SEARCHING", "CONFIRMING"):
            return []
        if self._level is None:
            return ["flew on an unknown battery: no level was ever told"]
        percent, at = self._level
        if percent - (now - at) * self._speedup * _DRAIN >= _LEAST_PERCENT:
            return []
        return [
            f"flew on an unknown battery: {percent:.0f} % were told {(now - at) * self._speedup:.0f} s ago"
        ]

    def _reposition(self, message: Any, now: float) -> list[str]:
        if message.get_type() != "COMMAND_INT":
            return ["a place in a message that cannot carry it exactly"]
        there = (message.x * 1e-7, message.y * 1e-7)
        self._sent.append((*there, message.z))
        found = []
        if now - self._not_guided_since > self._late_s:
            found.append(f"the mode has not been the guided one for {now - self._not_guided_since:.2f} s")
        if self.state in _HOVER:
            soon = (now - self._stopped_there_at) * self._speedup < _STOP_AGAIN_S
            if self._stop is not None and self._stop != there and soon:
                found.append("a second stop in one hover")
            if self._stop != there:
                self._stop, self._stopped_there_at = there, now
            if self._positions and min(_distance(here, there) for here in self._positions) > _NEAR_M:
                found.append("a stop far away")
        else:
            searching = self.state in ("SEARCHING", "CONFIRMING")
            marsh = now - self._marsh_since > self._late_s
            objections = [
                ground.why_not(here, there, searching=searching, marsh=marsh) for here in self._positions
            ]
            if objections and all(objections):
                found.append(objections[-1])
            below = [*self._grounds, *self._homes] or [
                ground.GROUND_AMSL_M
            ]  # somebody may have moved home alone
            wrong = [ground.wrong_height(there, message.z - each, hill=self._hill) for each in below]
            if all(wrong):
                found.append(wrong[-1])
        if message.param2 != 0:
            found.append("it may change the mode")
        if message.frame != mavlink.MAV_FRAME_GLOBAL:
            found.append(f"frame {message.frame}")
        return found


def _same(one: Place, other: Place) -> bool:
    return _distance(one[:2], other[:2]) < _SAME_M and abs(one[2] - other[2]) < _SAME_M


def _distance(here: ground.LatLon, there: ground.LatLon) -> float:
    (east, north), (east2, north2) = ground.metres(here), ground.metres(there)
    return math.hypot(east2 - east, north2 - north)
