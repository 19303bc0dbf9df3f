"""A tap on the wire between the service and a mock autopilot: carries every datagram, notes what the service says."""

from __future__ import annotations

import select
import socket
import threading
import time
from types import TracebackType
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

HARMLESS = {
    mavlink.MAV_CMD_SET_MESSAGE_INTERVAL,
    mavlink.MAV_CMD_REQUEST_MESSAGE,
}


class Tap:
    """A relay on the loopback interface; `url` is for the service. Use as a context manager."""

    def __init__(self, autopilot_port: int) -> None:
        self._to = ("127.0.0.1", autopilot_port)
        self._front, self._back = self._socket(), self._socket()
        self.url = f"udpout://127.0.0.1:{self._front.getsockname()[1]}"
        self.motions: list[tuple[float, str]] = []
        self.texts: list[str] = []
        self._parser = mavlink.MAVLink(None)
        self._parser.robust_parsing = True
        self._writer = mavlink.MAVLink(None, srcSystem=1, srcComponent=1)
        self._service: Any = None
        self._open = True
        self._thread = threading.Thread(target=self._carry, daemon=True)

    @staticmethod
    def _socket() -> socket.socket:
        sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        sock.bind(("127.0.0.1", 0))
        return sock

    def __enter__(self) -> Tap:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._open = False
        self._thread.join()
        self._front.close()
        self._back.close()

    def say(self, message: Any) -> None:
        """Say something to the service in the autopilot's name."""
        self._front.sendto(message.pack(self._writer), self._service)

    def _carry(self) -> None:
        while self._open:
            ready, _, _ = select.select([self._front, self._back], [], [], 0.05)
            if self._front in ready:
                data, self._service = self._front.recvfrom(4096)
                self._note(data)
                self._back.sendto(data, self._to)
            if self._back in ready:
                try:
                    data = self._back.recv(4096)
                except ConnectionError:  # the mock is gone
                    continue
                if self._service is not None:
                    self._front.sendto(data, self._service)

    def _note(self, data: bytes) -> None:
        for message in self._parser.parse_buffer(data) or []:
            name = message.get_type()
            if name == "STATUSTEXT":
                self.texts.append(message.text)
            elif name.startswith("SET_") or (
                name in ("COMMAND_INT", "COMMAND_LONG") and message.command not in HARMLESS
            ):
                command = getattr(message, "command", None)
                entry = mavlink.enums["MAV_CMD"].get(command)
                self.motions.append((time.monotonic(), entry.name if entry else f"{name} {command}"))
