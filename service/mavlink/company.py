"""Who else commands this aircraft: ground stations, and a second service that speaks as we do.

Nobody has to tell us what they command, but answers are often heard by all: a COMMAND_ACK names whom it is for.
A heartbeat with our own system and component that we have not sent comes from a second service, and so does the answer
to a command that we have never sent. One is not enough: our own frames may come back over a network.
"""

from __future__ import annotations

import math
from collections import deque

from service.mavlink.command import command_name
from service.mavlink.framing import Message

TAKES = frozenset({178, 192, 193})
"""MAV_CMD by which whoever sends one flies the aircraft himself, and changes no mode: DO_CHANGE_SPEED, DO_REPOSITION,
DO_PAUSE_CONTINUE."""
_MOTION_COMMANDS = TAKES | {16, 17, 20, 21, 22, 176, 186, 252, 300}
"""The same, NAV_*, DO_SET_MODE, DO_CHANGE_ALTITUDE, OVERRIDE_GOTO, MISSION_START."""
_LATELY_S = 10.0
_TOLD_AGAIN_S = 60.0
_SURE_AFTER = 2


class Company:
    """What gives the others away."""

    def __init__(self) -> None:
        self._frames: deque[bytes] = deque(maxlen=32)
        self._sent: dict[int, float] = {}
        self._other: tuple[float, str] = (-math.inf, "")
        self._signs = 0
        self._sign_at = self._told_at = -math.inf

    def sent(self, frame: bytes, command: int | None, now: float) -> None:
        """We have sent this."""
        self._frames.append(frame)
        if command is not None:
            self._sent[command] = now

    def on_heartbeat(self, message: Message, now: float) -> str:
        """A heartbeat with our identity: why somebody else must speak as we do, or nothing."""
        if bytes(message.get_msgbuf()) in self._frames:
            return ""
        return self._sign("another program sends heartbeats as this service", now)

    def on_ack(self, message: Message, *, ours: bool, now: float) -> str:
        """An answer to a command; `ours`: it names us. Why somebody else must speak as we do, or nothing."""
        number = message.command
        if not ours:
            if number in _MOTION_COMMANDS and message.target_system:
                who = f"system {message.target_system}, component {message.target_component}"
                self._other = now, f"{who} ({command_name(number)})"
            return ""
        if number in self._sent:
            return ""
        return self._sign(f"another program commands as this service ({command_name(number)})", now)

    def not_ours(self, number: int, now: float) -> bool:
        """Whether an answer that names nobody, as all of MAVLink 1 do, is to a command that we have not sent lately."""
        return now - self._sent.get(number, -math.inf) > _LATELY_S

    def commander(self, now: float) -> str:
        """Who has moved the aircraft lately, as a sentence's subject."""
        at, who = self._other
        return who if now - at <= _LATELY_S else "a ground station, another program or the pilot"

    def _sign(self, reason: str, now: float) -> str:
        self._signs = self._signs + 1 if now - self._sign_at <= _LATELY_S else 1
        self._sign_at = now
        if self._signs < _SURE_AFTER or now - self._told_at < _TOLD_AGAIN_S:
            return ""
        self._told_at = now
        return reason
