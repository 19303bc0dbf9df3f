"""Two ways to talk to a mock: in lockstep inside one process, and over a real socket."""

from __future__ import annotations

import select
import socket
import time
from collections import deque
from typing import Any, Protocol

from pymavlink.dialects.v20 import ardupilotmega

from sim.autopilot.core import Autopilot
from sim.autopilot.settings import Settings

mav: Any = ardupilotmega
GCS = (255, 190)


class Wire(Protocol):
    """Carries frames to a vehicle and its messages back; knows the vehicle's time."""

    now: float  # seconds since boot

    def write(self, frame: bytes) -> None:
        """Send bytes."""

    def read(self) -> Any | None:
        """The next message, or None if there was none for a moment."""

    def second(self, frame: bytes) -> list[Any]:
        """Send bytes on a second link and return what comes back there within a second or so."""

    def close(self) -> None:
        """Hang up."""


def codec(source: tuple[int, int] = GCS) -> Any:
    """A MAVLink 2 codec that sends under an identity."""
    made = mav.MAVLink(None, srcSystem=source[0], srcComponent=source[1])
    made.robust_parsing = True
    return made


class Lockstep:
    """A mock in this process: its time moves on when there is nothing left to read."""

    def __init__(self, settings: Settings) -> None:
        self.autopilot = Autopilot(settings)
        self._link, self._other = self.autopilot.add_link(), self.autopilot.add_link()
        self._codec, self._other_codec = codec(), codec()
        self._inbox: deque[Any] = deque()
        self.now = 0.0

    def write(self, frame: bytes) -> None:
        self.autopilot.receive(self._link, frame)

    def read(self) -> Any | None:
        if not self._inbox:
            if not self._link.outbox:
                self.autopilot.advance()
            self._other.outbox.clear()
            frames, self._link.outbox = self._link.outbox, []
            self._inbox.extend(self._codec.parse_buffer(b"".join(frames)) or [])
        self.now = self.autopilot.clock
        return self._inbox.popleft() if self._inbox else None

    def drain(self) -> None:
        """Forget what has come and was not read."""
        self._link.outbox.clear()
        self._inbox.clear()

    def second(self, frame: bytes) -> list[Any]:
        self.autopilot.receive(self._other, frame)
        frames, self._other.outbox = self._other.outbox, []
        return self._other_codec.parse_buffer(b"".join(frames)) or []

    def close(self) -> None:
        """Nothing to hang up."""


class Socket:
    """A mock process over UDP or TCP, `speedup` times as fast as the wall clock."""

    def __init__(self, url: str, second_url: str, speedup: float) -> None:
        self._socket, self._second_url = _connect(url), second_url
        self._codec, self._speedup = codec(), speedup
        self._inbox: deque[Any] = deque()
        self.now = 0.0
        self._stamped_at = self._looked_at = time.monotonic()
        hello = mav.MAVLink_heartbeat_message(mav.MAV_TYPE_GCS, mav.MAV_AUTOPILOT_INVALID, 0, 0, 4, 3)
        self.write(hello.pack(codec()))

    def write(self, frame: bytes) -> None:
        self._socket.sendall(frame)

    def read(self) -> Any | None:
        if not self._inbox:
            ready, _, _ = select.select([self._socket], [], [], 0.002)
            if ready:
                self._inbox.extend(self._codec.parse_buffer(self._socket.recv(65536)) or [])
        message = self._inbox.popleft() if self._inbox else None
        wall = time.monotonic()
        stamp = getattr(message, "time_boot_ms", 0)
        if stamp:
            self.now, self._stamped_at = max(self.now, stamp / 1000.0), wall
        elif wall - self._stamped_at > 0.3:  # nothing that carries the vehicle's time is streamed
            self.now += (wall - self._looked_at) * self._speedup
        self._looked_at = wall
        return message

    def second(self, frame: bytes) -> list[Any]:
        found: list[Any] = []
        parser = codec()
        with _connect(self._second_url) as other:
            other.settimeout(0.2)
            until = time.monotonic() + 3.0
            other.sendall(frame)
            while time.monotonic() < until and not any(m.get_type() == "COMMAND_ACK" for m in found):
                try:
                    found += parser.parse_buffer(other.recv(65536)) or []
                except TimeoutError:
                    other.sendall(frame)
        return found

    def close(self) -> None:
        self._socket.close()


def _connect(url: str) -> socket.socket:
    kind, _, rest = url.partition("://")
    host, _, port = rest.rpartition(":")
    if kind == "tcpin":
        return socket.create_connection((host, int(port)), timeout=10)
    made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    made.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 22)
    made.connect((host, int(port)))
    return made
