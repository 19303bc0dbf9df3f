"""A ground station that holds scripted dialogues with one vehicle and notes what comes back.

All times are the vehicle's own. It sends a heartbeat every second, and neutral sticks ten times a second
while `sticks` is set.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

from tests.conformance.wire import Wire, codec, mav

NAN = float("nan")
METRES_PER_DEGREE = 111_194.93
GUIDED = {"px4": "AUTO_LOITER", "ardupilot": "GUIDED"}
PILOT = {"px4": "POSCTL", "ardupilot": "LOITER"}
HEIGHT = 20.0  # of the hover the air exchanges start from

_PX4_MAIN = ["", "MANUAL", "ALTCTL", "POSCTL", "AUTO", "ACRO", "OFFBOARD", "STABILIZED"]
_PX4_SUB = ["0", "READY", "TAKEOFF", "LOITER", "MISSION", "RTL", "LAND", "7", "FOLLOW", "PRECLAND"]
_COPTER = {0: "STABILIZE", 1: "ACRO", 2: "ALT_HOLD", 3: "AUTO", 4: "GUIDED", 5: "LOITER", 6: "RTL", 9: "LAND"}
_LANDED = ["UNDEFINED", "ON_GROUND", "IN_AIR", "TAKEOFF", "LANDING"]
_WANTED_HZ = {
    "GLOBAL_POSITION_INT": 20,
    "EXTENDED_SYS_STATE": 5,
    "SYS_STATUS": 2,
    "ATTITUDE": 10,
    "GPS_RAW_INT": 2,
    "BATTERY_STATUS": 1,
    "HOME_POSITION": 1,
    "POSITION_TARGET_GLOBAL_INT": 5,
    "VFR_HUD": 4,
    "SYSTEM_TIME": 1,
}
_KEPT = (
    "PARAM_VALUE",
    "MESSAGE_INTERVAL",
    "MISSION_ACK",
    "MISSION_COUNT",
    "MISSION_REQUEST",
    "MISSION_REQUEST_INT",
    "MISSION_ITEM_INT",
)


def entry(group: str, value: int) -> str:
    """Name of an enum entry without the group's name."""
    found = mav.enums[group].get(value)
    return found.name.removeprefix(group + "_") if found else str(value)


class Sample(NamedTuple):
    """One GLOBAL_POSITION_INT: metres from the origin of the exchange, m/s."""

    time: float
    north: float
    east: float
    up: float
    speed: float
    climb: float
    north_speed: float


class Leg:
    """A way flown: from where it stood to a target, from now on."""

    def __init__(self, dialogue: Dialogue, north: float, east: float) -> None:
        self._dialogue = dialogue
        self._first = len(dialogue.track)
        self.target = (north, east)
        self.start = (dialogue.here.north, dialogue.here.east)
        self.began = dialogue.now
        self.acks: list[str] = []

    @property
    def samples(self) -> list[Sample]:
        """The motion since it began."""
        return self._dialogue.track[self._first :]

    @property
    def remaining(self) -> float:
        """Metres left."""
        here = self._dialogue.here
        return math.dist((here.north, here.east), self.target)

    @property
    def moved(self) -> float:
        """Metres it has been away from the start."""
        return max((math.dist((s.north, s.east), self.start) for s in self.samples), default=0.0)

    @property
    def settled(self) -> bool:
        """At the target and slow."""
        return self.remaining < 1.0 and self._dialogue.here.speed < 0.5

    def motion(self) -> dict[str, Any]:
        """Arrival within a metre, coming to rest there, peak speed and accelerations, overshoot."""
        length = math.dist(self.start, self.target) or 1.0
        toward = tuple((b - a) / length for a, b in zip(self.start, self.target, strict=True))
        arrive = settle = None
        beyond, speeds, due = 0.0, [], self.began
        for s in self.samples:
            near = math.dist((s.north, s.east), self.target) < 1.0
            if near and arrive is None:
                arrive = s.time - self.began
            if near and s.speed < 0.5 and settle is None:
                settle = s.time - self.began
            along = (s.north - self.start[0]) * toward[0] + (s.east - self.start[1]) * toward[1]
            beyond = max(beyond, along - length)
            if s.time >= due:  # at 5 Hz, as the real ones were measured
                speeds.append(s.speed)
                due = max(due + 0.2, s.time)
        gains = [(b - a) / 0.4 for a, b in zip(speeds, speeds[2:], strict=False)] or [0.0]
        return {
            "arrive_s": arrive,
            "settle_s": settle,
            "peak_speed_mps": max(speeds, default=0.0),
            "overshoot_m": beyond,
            "peak_accel_mps2": max(gains),
            "peak_decel_mps2": -min(gains),
        }


class Dialogue:
    """One conversation with one vehicle over a wire."""

    def __init__(self, wire: Wire, flavor: str) -> None:
        self.wire, self.flavor, self.px4 = wire, flavor, flavor == "px4"
        self.codec = codec()
        self.system = 0
        self.latest: dict[str, Any] = {}
        self.arrivals: dict[str, list[float]] = {}
        self.track: list[Sample] = []
        self.acks: list[Any] = []
        self.kept: list[Any] = []
        self.modes: list[str] = []
        self.landed: list[str] = []
        self.texts: list[str] = []
        self.first_bytes: set[int] = set()
        self.origin = (0, 0, 0)  # 1e-7 degrees, millimetres AMSL
        self.sticks = self.silent = self._streaming = False
        self._beat_at = self._stick_at = -1e9
        self._ready_since: float | None = None

    # ---- what is heard
    @property
    def now(self) -> float:
        """Vehicle time, seconds."""
        return self.wire.now

    @property
    def here(self) -> Sample:
        """The latest position."""
        return self.track[-1]

    @property
    def mode(self) -> str:
        """The flight mode by its name."""
        number = self.latest["HEARTBEAT"].custom_mode
        if not self.px4:
            return _COPTER.get(number, str(number))
        main = _PX4_MAIN[number >> 16 & 255]
        return f"AUTO_{_PX4_SUB[number >> 24]}" if main == "AUTO" else main

    @property
    def armed(self) -> bool:
        """The armed flag of the last heartbeat."""
        return bool(self.latest["HEARTBEAT"].base_mode & mav.MAV_MODE_FLAG_SAFETY_ARMED)

    @property
    def ready(self) -> bool:
        """The pre-arm check of the last SYS_STATUS."""
        status = self.latest.get("SYS_STATUS")
        return bool(status and status.onboard_control_sensors_health & mav.MAV_SYS_STATUS_PREARM_CHECK)

    @property
    def surely_ready(self) -> bool:
        """The pre-arm check has stayed healthy: ArduCopter's may read so for a moment too early."""
        return self._ready_since is not None and self.now - self._ready_since >= 4.0

    def begin(self) -> None:
        """Forget what was heard, for a new exchange."""
        self.acks, self.kept, self.texts, self.track, self.arrivals = [], [], [], [], {}
        self.modes, self.landed = self.modes[-1:], self.landed[-1:]
        position = self.latest.get("GLOBAL_POSITION_INT")
        if position is not None:
            self.origin = (position.lat, position.lon, position.alt - position.relative_alt)
            self._sample(position)

    def origin_home(self) -> None:
        """Measure from home from now on."""
        home = self.latest["HOME_POSITION"]
        self.origin = (home.latitude, home.longitude, home.altitude)
        self.track = []
        self._sample(self.latest["GLOBAL_POSITION_INT"])

    def pump(self) -> Any | None:
        """Take the next message, and keep up the heartbeat and the sticks."""
        if self.now - self._beat_at >= 1.0 and self.system and not self.silent:
            self._beat_at = self.now
            self.send(mav.MAVLink_heartbeat_message(mav.MAV_TYPE_GCS, mav.MAV_AUTOPILOT_INVALID, 0, 0, 4, 3))
        if self.sticks and self.now - self._stick_at >= 0.1:
            self._stick_at = self.now
            self.send(mav.MAVLink_manual_control_message(self.system, 0, 0, 500, 0, 0))
        message = self.wire.read()
        if message is None or message.get_type() == "BAD_DATA" or message.get_srcComponent() != 1:
            return None
        kind = message.get_type()
        if not self.system and kind == "HEARTBEAT":
            self.system = message.get_srcSystem()
        self.arrivals.setdefault(kind, []).append(self.now)
        self.first_bytes.add(message.get_msgbuf()[0])
        self.latest[kind] = message
        self._note(kind, message)
        return message

    def _note(self, kind: str, message: Any) -> None:
        if kind == "GLOBAL_POSITION_INT":
            self._sample(message)
        elif kind == "SYS_STATUS":
            if not self.ready:
                self._ready_since = None
            elif self._ready_since is None:
                self._ready_since = self.now
        elif kind == "HEARTBEAT":
            _append_new(self.modes, self.mode)
        elif kind == "EXTENDED_SYS_STATE":
            _append_new(self.landed, _LANDED[message.landed_state])
        elif kind == "STATUSTEXT":
            self.texts.append(message.text)
        elif kind == "COMMAND_ACK":
            self.acks.append(message)
        elif kind in _KEPT:
            self.kept.append(message)

    def metres(self, latitude_e7: float, longitude_e7: float) -> tuple[float, float]:
        """North and east of the origin."""
        shrink = math.cos(math.radians(self.origin[0] * 1e-7))
        return (
            (latitude_e7 - self.origin[0]) * 1e-7 * METRES_PER_DEGREE,
            (longitude_e7 - self.origin[1]) * 1e-7 * METRES_PER_DEGREE * shrink,
        )

    def _sample(self, g: Any) -> None:
        north, east = self.metres(g.lat, g.lon)
        speed = math.hypot(g.vx, g.vy) / 100.0
        self.track.append(
            Sample(self.now, north, east, g.relative_alt / 1e3, speed, -g.vz / 100.0, g.vx / 100.0)
        )

    def wait(self, condition: Callable[[], Any], seconds: float) -> bool:
        """Listen until something holds; False if it does not within the time."""
        until = self.now + seconds
        while self.now < until:
            self.pump()
            if condition():
                return True
        return False

    def listen(self, seconds: float) -> None:
        """Listen for some time."""
        self.wait(lambda: False, seconds)

    def rate(self, kind: str, since: float) -> float:
        """Mean rate of a message after a time, Hz."""
        times = [t for t in self.arrivals.get(kind, []) if t >= since]
        return (len(times) - 1) / (times[-1] - times[0]) if len(times) > 1 and times[-1] > times[0] else 0.0

    # ---- what is said
    def send(self, message: Any, source: tuple[int, int] | None = None) -> None:
        """Send a message, under another identity if told."""
        self.wire.write(message.pack(self.codec if source is None else codec(source)))

    def answers(self, command: int, seconds: float = 3.0) -> list[str]:
        """The acknowledgements of a command in order; none is silence."""
        first = len(self.acks)
        if self.wait(lambda: any(a.command == command for a in self.acks[first:]), seconds):
            self.listen(0.5)
        return [entry("MAV_RESULT", a.result) for a in self.acks[first:] if a.command == command]

    def long(
        self,
        command: int,
        *params: float,
        target: tuple[int, int] | None = None,
        source: tuple[int, int] | None = None,
        seconds: float = 3.0,
    ) -> list[str]:
        """COMMAND_LONG and its acknowledgements."""
        padded = [*params, *[0.0] * (7 - len(params))]
        to = target or (self.system, 1)
        self.send(mav.MAVLink_command_long_message(*to, command, 0, *padded), source)
        return self.answers(command, seconds)

    def whole(
        self, command: int, frame: int, params: tuple[float, ...], x: int, y: int, z: float
    ) -> list[str]:
        """COMMAND_INT and its acknowledgements."""
        self.send(mav.MAVLink_command_int_message(self.system, 1, frame, command, 0, 0, *params, x, y, z))
        return self.answers(command)

    def select(self, mode: str) -> list[str]:
        """DO_SET_MODE by name."""
        if not self.px4:
            number = next(k for k, v in _COPTER.items() if v == mode)
            return self.long(mav.MAV_CMD_DO_SET_MODE, 1, number)
        main, _, sub = mode.partition("_")
        return self.long(mav.MAV_CMD_DO_SET_MODE, 1, _PX4_MAIN.index(main), _PX4_SUB.index(sub) if sub else 0)

    def guided(self) -> list[str]:
        """Select the mode that takes repositions."""
        return self.select(GUIDED[self.flavor])

    def point(self, north: float, east: float) -> tuple[int, int]:
        """Integer latitude and longitude of a place."""
        scale = 1e7 / METRES_PER_DEGREE
        shrink = math.cos(math.radians(self.origin[0] * 1e-7))
        return round(self.origin[0] + north * scale), round(self.origin[1] + east * scale / shrink)

    def reposition(
        self,
        x: int,
        y: int,
        z: float,
        *,
        frame: int = 0,
        speed: float = -1.0,
        flags: float = 1.0,
        yaw: float = NAN,
    ) -> list[str]:
        """DO_REPOSITION as COMMAND_INT with everything given."""
        return self.whole(mav.MAV_CMD_DO_REPOSITION, frame, (speed, flags, 0.0, yaw), x, y, z)

    def amsl(self, height: float) -> float:
        """Altitude above sea level of a height over the origin."""
        return height + self.origin[2] / 1e3

    def go(
        self,
        north: float,
        east: float,
        *,
        height: float = HEIGHT,
        frame: int = 0,
        speed: float = -1.0,
        flags: float = 1.0,
        wait: float = 60.0,
    ) -> Leg:
        """Send it to a place over the origin and wait until it is there (`wait` 0: do not)."""
        leg = Leg(self, north, east)
        z = self.amsl(height) if frame in (mav.MAV_FRAME_GLOBAL, mav.MAV_FRAME_GLOBAL_INT) else height
        leg.acks = self.reposition(*self.point(north, east), z, frame=frame, speed=speed, flags=flags)
        if wait:
            self.wait(lambda: leg.settled, wait)
        return leg

    # ---- where an exchange starts
    def stream(self) -> None:
        """Ask for the streams the exchanges read, once."""
        if not self._streaming:
            self.wait(lambda: self.system, 60)
            for kind, rate in _WANTED_HZ.items():
                number = getattr(mav, f"MAVLINK_MSG_ID_{kind}")
                self.send(
                    mav.MAVLink_command_long_message(
                        self.system, 1, mav.MAV_CMD_SET_MESSAGE_INTERVAL, 0, number, 1e6 / rate, *(0.0,) * 5
                    )
                )
                self.listen(0.1)
            self._streaming = True
        self.wait(lambda: {"GLOBAL_POSITION_INT", "SYS_STATUS", "EXTENDED_SYS_STATE"} <= set(self.latest), 20)

    def on_ground(self) -> None:
        """Disarmed, ready, in the guided mode."""
        self.stream()
        if self.sticks:  # a centred throttle stick forbids arming in ArduCopter
            self.sticks = False
            self.listen(4)
        if self.armed:
            self.long(mav.MAV_CMD_NAV_RETURN_TO_LAUNCH)
            self.wait(lambda: not self.armed, 180)
        self.wait(lambda: self.surely_ready, 120)
        if self.mode != GUIDED[self.flavor]:
            self.guided()

    def take_off(self) -> dict[str, list[str]]:
        """The flavour's proper take-off to the hover; the acknowledgements of its steps."""
        acks = {} if self.px4 else {"guided_ack": self.guided()}
        self.wait(lambda: self.surely_ready, 120)
        acks["arm_ack"] = self.long(mav.MAV_CMD_COMPONENT_ARM_DISARM, 1)
        if self.px4:
            z = HEIGHT + self.latest["GLOBAL_POSITION_INT"].alt / 1e3
            acks["takeoff_ack"] = self.long(mav.MAV_CMD_NAV_TAKEOFF, NAN, 0, 0, NAN, NAN, NAN, z)
        else:
            acks["takeoff_ack"] = self.long(mav.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, NAN, 0, 0, HEIGHT)
        return acks

    def in_air(self) -> None:
        """Hovering over home in the guided mode."""
        self.stream()
        if not self.armed:
            self.on_ground()
            self.take_off()
            self.wait(lambda: self.here.up > 19.0 and abs(self.here.climb) < 0.2, 90)
            self.wait(lambda: self.mode == GUIDED[self.flavor], 10)
        home = self.latest["HOME_POSITION"]
        self.origin = (home.latitude, home.longitude, home.altitude)
        self.listen(0.2)
        here = self.here
        off = math.hypot(here.north, here.east) > 3 or abs(here.up - HEIGHT) > 1.5
        if off or self.mode != GUIDED[self.flavor]:
            self.go(0, 0, wait=90)
            self.wait(lambda: abs(self.here.up - HEIGHT) < 1 and self.here.speed < 0.5, 40)
        self.listen(1.0)


def _append_new(values: list[str], value: str) -> None:
    if not values or values[-1] != value:
        values.append(value)
