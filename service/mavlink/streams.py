"""Which messages are asked for, and asked for again when they do not come.

PX4 streams most of this unasked, ArduCopter nothing but a heartbeat. Both obey MAV_CMD_SET_MESSAGE_INTERVAL
and forget it when they reboot, so a stream is judged by its arrival.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.mavlink.autopilots.base import Stream
from service.mavlink.settings import LinkSettings

_FIRST_PATIENCE_S = 3.0
_LONGEST_PATIENCE_S = 30.0


def common_streams(settings: LinkSettings) -> tuple[Stream, ...]:
    """What the service reads from every autopilot, the most needed first."""
    return (
        Stream(mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT, settings.position_hz),
        Stream(mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE, 2.0),
        Stream(mavlink.MAVLINK_MSG_ID_POSITION_TARGET_GLOBAL_INT, 2.0),
        Stream(mavlink.MAVLINK_MSG_ID_ATTITUDE, settings.attitude_hz),
        Stream(mavlink.MAVLINK_MSG_ID_SYS_STATUS, 1.0),
        Stream(mavlink.MAVLINK_MSG_ID_BATTERY_STATUS, 1.0),
        Stream(mavlink.MAVLINK_MSG_ID_GPS_RAW_INT, 1.0),
        Stream(mavlink.MAVLINK_MSG_ID_HOME_POSITION, 0.5),
        Stream(mavlink.MAVLINK_MSG_ID_VFR_HUD, 2.0),
    )


@dataclass(slots=True)
class _Wanted:
    stream: Stream
    seen: float = -math.inf
    asked: float = -math.inf
    patience_s: float = _FIRST_PATIENCE_S
    given_up: bool = False

    def late(self, now: float) -> bool:
        silence = max(3.0 / self.stream.hz, 2.0)
        return now - self.seen > silence and now - self.asked > self.patience_s


class Streams:
    """The state of every stream asked for."""

    def __init__(self, streams: Iterable[Stream]) -> None:
        self._wanted = {stream.message_id: _Wanted(stream) for stream in streams}
        self._tickets: dict[int, int] = {}

    def on_message(self, message_id: int, now: float) -> None:
        """A message has arrived."""
        wanted = self._wanted.get(message_id)
        if wanted is not None:
            wanted.seen = now
            if wanted.asked > -math.inf:
                wanted.patience_s = _FIRST_PATIENCE_S

    def due(self, now: float) -> list[Stream]:
        """The streams to ask for now: new, or silent for too long (then more and more rarely)."""
        due = []
        unanswered = set(self._tickets.values())
        for message_id, wanted in self._wanted.items():
            if wanted.given_up or message_id in unanswered:
                continue
            first = wanted.asked == -math.inf
            if first or wanted.late(now):
                if not first:
                    wanted.patience_s = min(2.0 * wanted.patience_s, _LONGEST_PATIENCE_S)
                wanted.asked = now
                due.append(wanted.stream)
        return due

    def asked(self, ticket: int, stream: Stream) -> None:
        """Remember under which ticket a stream was asked for."""
        self._tickets[ticket] = stream.message_id

    def on_answer(self, ticket: int, *, refused: bool) -> bool:
        """A command has ended; returns whether it was for a stream. An optional one may be refused."""
        message_id = self._tickets.pop(ticket, None)
        wanted = None if message_id is None else self._wanted.get(message_id)
        if wanted is not None and refused and wanted.stream.optional:
            wanted.given_up = True
        return message_id is not None

    def start_over(self) -> None:
        """Ask for everything again, as after a reboot."""
        self._wanted = {key: _Wanted(wanted.stream) for key, wanted in self._wanted.items()}
        self._tickets.clear()
