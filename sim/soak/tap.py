"""A tap on the wire between a service and a mock autopilot: carries every datagram, and notes what is said."""

from __future__ import annotations

import select
import socket
import threading
import time
from collections.abc import Callable
from types import TracebackType
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.lockstep import Lockstep

HARMLESS = {
    mavlink.MAV_CMD_SET_MESSAGE_INTERVAL,
    mavlink.MAV_CMD_REQUEST_MESSAGE,
}
Listener = Callable[[Any, float], None]


def is_probe(message: Any) -> bool:
    """A reposition to what is no place on earth, which asks whether the command is known."""
    reposition = getattr(message, "command", None) == mavlink.MAV_CMD_DO_REPOSITION
    return reposition and message.get_type() == "COMMAND_INT" and bool(abs(message.x) > 900_000_000)


def motion_name(message: Any) -> str:
    """What a message of the service's asks the aircraft to do; nothing when it asks for no motion."""
    name = str(message.get_type())
    if is_probe(message):
        return ""
    command = getattr(message, "command", None)
    if not (name.startswith("SET_") or (name in ("COMMAND_INT", "COMMAND_LONG") and command not in HARMLESS)):
        return ""
    entry = mavlink.enums["MAV_CMD"].get(command)
    return str(entry.name) if entry else f"{name} {command}"


class Tap:
    """A relay on the loopback interface; `url` is for the service. Use as a context manager.

    Args:
        autopilot_port: the UDP port of the mock autopilot.
        from_service, from_autopilot: told every message with the time (monotonic) before it is carried on.
        lockstep: with a simulated time that waits for what is on the wire, by which times are told then.
    """

    def __init__(
        self,
        autopilot_port: int,
        *,
        from_service: Listener | None = None,
        from_autopilot: Listener | None = None,
        lockstep: Lockstep | None = None,
    ) -> None:
        self._to = ("127.0.0.1", autopilot_port)
        self._front, self._back = self._socket(), self._socket()
        self.url = f"udpout://127.0.0.1:{self._front.getsockname()[1]}"
        self.motions: list[tuple[float, str]] = []
        self.texts: list[str] = []
        self.beats = 0
        self._from_service, self._from_autopilot = from_service, from_autopilot
        self._lockstep = lockstep
        self._now = time.monotonic if lockstep is None else lockstep.ticks
        self._parser, self._back_parser = self._robust(), self._robust()
        self._writer = mavlink.MAVLink(None, srcSystem=1, srcComponent=1)
        self._service: Any = None
        self._open = True
        self._thread = threading.Thread(target=self._carry, daemon=True)

    @staticmethod
    def _socket() -> socket.socket:
        sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        sock.bind(("127.0.0.1", 0))
        return sock

    @staticmethod
    def _robust() -> Any:
        parser = mavlink.MAVLink(None)
        parser.robust_parsing = True
        return parser

    def __enter__(self) -> Tap:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._open = False
        self._thread.join()
        if self._lockstep is not None:
            self._lockstep.leave()
        self._front.close()
        self._back.close()

    def say(self, message: Any) -> None:
        """Say something to the service in the autopilot's name."""
        self.say_bytes(message.pack(self._writer))

    def say_bytes(self, data: bytes) -> None:
        """Send the service any bytes from the autopilot's address."""
        if self._service is not None:
            self._front.sendto(data, self._service)

    def _carry(self) -> None:
        patience_s = 0.05 if self._lockstep is None else 0.002
        while self._open:
            if self._lockstep is not None:
                self._lockstep.content_for(0.0)
            ready, _, _ = select.select([self._front, self._back], [], [], patience_s)
            if self._front in ready:
                try:
                    data, self._service = self._front.recvfrom(4096)
                except ConnectionError:  # the service is gone
                    continue
                self._note(data)
                self._back.sendto(data, self._to)
            if self._back in ready:
                try:
                    data = self._back.recv(4096)
                except ConnectionError:  # the mock is gone
                    continue
                if self._from_autopilot is not None:
                    now = self._now()
                    for message in self._back_parser.parse_buffer(data) or []:
                        self._from_autopilot(message, now)
                if self._service is not None:
                    self._front.sendto(data, self._service)

    def _note(self, data: bytes) -> None:
        now = self._now()
        for message in self._parser.parse_buffer(data) or []:
            if message.get_type() == "HEARTBEAT":
                self.beats += 1
            elif message.get_type() == "STATUSTEXT":
                self.texts.append(message.text)
            elif name := motion_name(message):
                self.motions.append((now, name))
            if self._from_service is not None:
                self._from_service(message, now)
