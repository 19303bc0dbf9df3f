"""One MAVLink connection of a mock: framing, its own message rates, bytes waiting to be carried."""

from __future__ import annotations

from typing import Any

from sim.autopilot.dialect import M
from sim.autopilot.host import Host
from sim.autopilot.telemetry import BUILDERS
from sim.autopilot.trouble import Radio, is_ack
from sim.autopilot.voice import in_mavlink1

_NEVER = 2**62
_HEARTBEAT = int(M.MAVLINK_MSG_ID_HEARTBEAT)
_BAD = "BAD_DATA"


class _Stream:
    __slots__ = ("builder", "due", "interval_us", "number")

    def __init__(self, number: int, interval_us: int, due: int) -> None:
        self.number, self.interval_us, self.due = number, interval_us, due
        self.builder = BUILDERS[number]


class Link:
    """Bytes in, messages out; messages in, bytes out. `outbox` holds whole frames to be carried."""

    def __init__(self, autopilot: Host) -> None:
        self._autopilot = autopilot
        self.outbox: list[bytes] = []
        self.out = Radio(autopilot.trouble, autopilot.chance, self.outbox_append)
        self.into = Radio(autopilot.trouble, autopilot.chance, lambda data: autopilot.take(self, data))
        self.shaky = autopilot.trouble.any  # goes through the radios
        self._streams: dict[int, _Stream] = {}
        self._due = _NEVER
        self.begin()

    def begin(self) -> None:
        """A vehicle speaks here for the first time, by its own name."""
        self._codec = M.MAVLink(None, srcSystem=self._autopilot.settings.sysid, srcComponent=1)
        self._codec.robust_parsing = True
        self.reset()

    def reset(self) -> None:
        """The rates of a vehicle that has just booted."""
        self._streams.clear()
        self.set_interval(_HEARTBEAT, 1_000_000)
        for number, rate in self._autopilot.firmware.flavor.default_streams_hz.items():
            self.set_interval(number, round(1e6 / rate))

    # ---- sending
    def outbox_append(self, frame: bytes) -> None:
        """Let one frame through."""
        self.outbox.append(frame)

    def send(self, message: Any) -> None:
        """Put one message in the outbox."""
        message = self._autopilot.voice.utter(message)
        if message is None:
            return
        frame = in_mavlink1(message, self._codec) if self._autopilot.old_wire else message.pack(self._codec)
        if frame is not None:
            self._post(frame)
            self._codec.seq = (self._codec.seq + 1) % 256  # so that the other side can tell what was lost

    def send_as(self, message: Any, system: int, component: int) -> None:
        """Put a message of somebody else on the same wire in the outbox."""
        self._post(message.pack(M.MAVLink(None, srcSystem=system, srcComponent=component)))

    def _post(self, frame: bytes) -> None:
        if not self.shaky:
            self.outbox.append(frame)
            return
        trouble = self._autopilot.trouble
        if not trouble.mute and not (trouble.acks_lost and is_ack(frame)):
            self.out.put(frame, self._autopilot.clock)

    def shake(self) -> None:
        """Deliver what the radios have held back, and use them while there is trouble."""
        now = self._autopilot.clock
        self.out.release(now)
        self.into.release(now)
        self.shaky = self._autopilot.trouble.any or self.out.busy or self.into.busy

    def interval_us(self, number: int) -> int:
        """Interval of a message in microseconds, -1 when it is off."""
        stream = self._streams.get(number)
        return -1 if stream is None else stream.interval_us

    def set_interval(self, number: int, interval_us: int) -> None:
        """Send a message at an interval from now on; 0 is the flavour's default, below 0 is off."""
        if interval_us == 0:
            rate = self._autopilot.firmware.flavor.default_streams_hz.get(
                number, 1.0 if number == _HEARTBEAT else 0.0
            )
            interval_us = round(1e6 / rate) if rate else -1
        if interval_us < 0:
            self._streams.pop(number, None)
        else:
            now = self._autopilot.vehicle.steps * 20_000
            self._streams[number] = _Stream(number, max(interval_us, 20_000), now)
            self._due = min(self._due, now)

    def beat(self, now_us: int) -> None:
        """Send the heartbeat when it is due, and nothing else."""
        stream = self._streams.get(_HEARTBEAT)
        if stream is not None and stream.due <= now_us:
            self.send(stream.builder(self._autopilot))
            stream.due = now_us + stream.interval_us

    def stream(self, now_us: int) -> None:
        """Send what is due."""
        if now_us < self._due:
            return
        autopilot, soonest = self._autopilot, _NEVER
        for each in tuple(self._streams.values()):
            if each.due <= now_us:
                message = each.builder(autopilot)
                if message is not None:
                    self.send(message)
                each.due += each.interval_us
                if each.due <= now_us:
                    each.due = now_us + each.interval_us
            if each.due < soonest:
                soonest = each.due
        self._due = soonest

    # ---- receiving
    def parse(self, data: bytes) -> list[Any]:
        """The valid messages in the bytes, in order; noise and bad checksums vanish."""
        found = self._codec.parse_buffer(data) or []
        return [each for each in found if each.get_type() != _BAD]
