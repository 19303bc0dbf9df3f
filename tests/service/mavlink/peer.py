"""A hand-made autopilot for tests: scripted bytes over pymavlink's own codec, no time of its own."""

from __future__ import annotations

import math
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.mavlink.autopilots.base import Autopilot
from service.mavlink.core import LinkCore
from service.mavlink.events import VehicleEvent
from service.mavlink.settings import MavlinkSettings

START = 1_700_000_000.0
LAT, LON, GROUND = 47.0, 8.0, 489.0
MODES = {
    "px4": {
        "AUTO_LOITER": 0x03040000,
        "AUTO_TAKEOFF": 0x02040000,
        "AUTO_RTL": 0x05040000,
        "POSCTL": 0x00030000,
    },
    "ardupilot": {"GUIDED": 4, "RTL": 6, "LOITER": 5, "STABILIZE": 0},
}
GUIDED = {"px4": "AUTO_LOITER", "ardupilot": "GUIDED"}
PILOT = {"px4": "POSCTL", "ardupilot": "LOITER"}
RETURN = {"px4": "AUTO_RTL", "ardupilot": "RTL"}
_AUTOPILOT = {"px4": mavlink.MAV_AUTOPILOT_PX4, "ardupilot": mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA}


class Peer:
    """Says what a test tells it to say."""

    def __init__(self, flavor: str = "px4", system: int = 7, component: int = 1) -> None:
        self.flavor = flavor
        self.mav = mavlink.MAVLink(None, srcSystem=system, srcComponent=component)
        self.mode, self.armed, self.landed, self.prearm = GUIDED[flavor], True, 2, True
        self.lat, self.lon, self.height = LAT, LON, 20.0
        self.velocity = (0.0, 0.0, 0.0)
        self.status = mavlink.MAV_STATE_ACTIVE
        self.booted_at = START - 100.0
        self.home = True
        self.heading: int | None = 9000
        self.silent: set[str] = set()
        self.fix = 3
        self.target: tuple[float, float, float] | None = None

    def pack(self, message: Any) -> bytes:
        frame = bytes(message.pack(self.mav))
        self.mav.seq = (self.mav.seq + 1) % 256
        return frame

    def heartbeat(self, kind: int = mavlink.MAV_TYPE_QUADROTOR, autopilot: int | None = None) -> bytes:
        base = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
        base |= mavlink.MAV_MODE_FLAG_SAFETY_ARMED if self.armed else 0
        autopilot = _AUTOPILOT[self.flavor] if autopilot is None else autopilot
        number = MODES[self.flavor][self.mode]
        return self.pack(mavlink.MAVLink_heartbeat_message(kind, autopilot, base, number, self.status, 3))

    def boot_ms(self, now: float) -> int:
        return round((now - self.booted_at) * 1000)

    def position(self, now: float) -> bytes:
        north, east, down = (round(v * 100) for v in self.velocity)
        return self.pack(
            mavlink.MAVLink_global_position_int_message(
                self.boot_ms(now),
                round(self.lat * 1e7),
                round(self.lon * 1e7),
                round((GROUND + self.height) * 1000),
                round(self.height * 1000),
                north,
                east,
                down,
                65535 if self.heading is None else self.heading,
            )
        )

    def attitude(self, now: float) -> bytes:
        return self.pack(
            mavlink.MAVLink_attitude_message(self.boot_ms(now), 0.1, -0.05, math.pi / 2, 0.0, 0.0, 0.0)
        )

    def sys_status(self) -> bytes:
        health = mavlink.MAV_SYS_STATUS_PREARM_CHECK if self.prearm else 0
        return self.pack(
            mavlink.MAVLink_sys_status_message(0, 0, health, 100, 15400, 1200, 80, 0, 0, 0, 0, 0, 0)
        )

    def gps(self) -> bytes:
        return self.pack(
            mavlink.MAVLink_gps_raw_int_message(
                0, self.fix, round(self.lat * 1e7), round(self.lon * 1e7), 489000, 70, 110, 0, 0, 12
            )
        )

    def landed_state(self) -> bytes:
        return self.pack(mavlink.MAVLink_extended_sys_state_message(0, self.landed))

    def home_position(self) -> bytes:
        q = [1.0, 0.0, 0.0, 0.0]
        return self.pack(
            mavlink.MAVLink_home_position_message(
                round(LAT * 1e7), round(LON * 1e7), round(GROUND * 1000), 0.0, 0.0, 0.0, q, 0.0, 0.0, 0.0
            )
        )

    def position_target(self, now: float) -> bytes:
        assert self.target is not None
        lat, lon, alt = self.target
        frame, mask = (5, 0) if self.flavor == "px4" else (0, 65016)
        return self.pack(
            mavlink.MAVLink_position_target_global_int_message(
                self.boot_ms(now), frame, mask, round(lat * 1e7), round(lon * 1e7), alt, *[0.0] * 8
            )
        )

    def ack(self, command: int, result: int, target: tuple[int, int] = (7, 191)) -> bytes:
        return self.pack(mavlink.MAVLink_command_ack_message(command, result, 0, 0, *target))

    def text(self, text: str, severity: int = 6, text_id: int = 0, chunk: int = 0) -> bytes:
        return self.pack(mavlink.MAVLink_statustext_message(severity, text.encode(), text_id, chunk))


class Rig:
    """A core and its peer, on one time line that only the test moves."""

    def __init__(self, flavor: str = "px4", *, speaks_first: bool = False, **settings: Any) -> None:
        self.peer = Peer(flavor)
        self.core = LinkCore(MavlinkSettings(**settings), speaks_first=speaks_first)
        self.now = START
        self.events: list[VehicleEvent] = []
        self.sent: list[Any] = []
        self.beating = self.positioning = self.acking = True
        self.refused: set[int] = set()
        self.reader = mavlink.MAVLink(None)
        self._steps = 0

    @property
    def autopilot(self) -> Autopilot:
        """What the core takes the peer for."""
        assert self.core.autopilot is not None
        return self.core.autopilot

    def say(self, data: bytes, source: Any = None) -> list[VehicleEvent]:
        """Bytes from the vehicle, now."""
        events = self.core.receive_data(data, self.now, source)
        self.events += events
        return events

    def streamed(self, name: str, data: bytes) -> bytes:
        """The bytes of a stream, unless it has stopped."""
        return b"" if name in self.peer.silent else data

    def collect(self) -> list[Any]:
        """What the core has sent since the last call, read by pymavlink's own parser."""
        new: list[Any] = []
        for frame in self.core.data_to_send():
            new += self.reader.parse_buffer(bytearray(frame)) or []
        self.sent += new
        return new

    def run(self, seconds: float, step: float = 0.1) -> list[VehicleEvent]:
        """Let time pass, the vehicle streaming what it should; returns the events."""
        first = len(self.events)
        for _ in range(round(seconds / step)):
            self.now += step
            self._steps += 1
            if self.beating and self._steps % 10 == 0:
                self.say(self.peer.heartbeat())
                self.say(self.streamed("sys_status", self.peer.sys_status()))
                self.say(self.streamed("gps", self.peer.gps()))
                if self.peer.home:
                    self.say(self.peer.home_position())
            if self.beating and self.positioning:
                position = self.peer.position(self.now)  # signed before what follows it
                self.say(position + self.streamed("attitude", self.peer.attitude(self.now)))
            if self.beating and self._steps % 5 == 0:
                self.say(self.streamed("landed", self.peer.landed_state()))
                if self.peer.target:
                    self.say(self.peer.position_target(self.now))
            self.events += self.core.tick(self.now)
            for message in self.collect():
                if self.acking and message.get_type() == "COMMAND_LONG" and message.command == 511:
                    self.say(self.peer.ack(511, 4 if message.param1 in self.refused else 0))
        return self.events[first:]

    def flying(self) -> Rig:
        """Bring it into the air, guided and in our control."""
        self.say(self.peer.heartbeat())
        self.run(3.0)
        self.core.take_control(self.now)
        self.events.clear()
        self.forget()
        return self

    def forget(self) -> None:
        """Start a new list of what was sent."""
        self.collect()
        self.sent.clear()

    def of(self, kind: type[Any]) -> list[Any]:
        """The events of one kind."""
        return [event for event in self.events if isinstance(event, kind)]

    def messages(self, name: str, command: int | None = None) -> list[Any]:
        """What was sent, of one kind."""
        self.collect()
        found = [m for m in self.sent if m.get_type() == name]
        return [m for m in found if m.command == command] if command is not None else found

    def motion(self) -> list[Any]:
        """Everything sent that could move the aircraft."""
        self.collect()
        quiet = {mavlink.MAV_CMD_SET_MESSAGE_INTERVAL}
        return [
            m
            for m in self.sent
            if m.get_type() not in ("HEARTBEAT", "STATUSTEXT", "TIMESYNC")
            and getattr(m, "command", None) not in quiet
        ]


FLAVORS = pytest.mark.parametrize("flavor", ["px4", "ardupilot"])
REPOSITION = 192
ALT = GROUND + 20.0
NORTH = LAT + 0.0003


def go(rig: Rig, lat: float = NORTH, lon: float = LON, alt: float = ALT) -> None:
    """Order the vehicle of a rig to a place."""
    rig.core.reposition(lat, lon, alt, rig.now)
