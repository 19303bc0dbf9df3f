"""Which messages are asked for, and asked for again when they do not come.

PX4 streams most of this unasked, ArduCopter nothing but a heartbeat. Both obey MAV_CMD_SET_MESSAGE_INTERVAL
and forget it when they reboot, so a stream is judged by its arrival.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from service.mavlink.settings import MavlinkSettings
from service.mavlink.sources import SOURCES, number_of

_FIRST_PATIENCE_S = 3.0
_LONGEST_PATIENCE_S = 30.0


@dataclass(frozen=True, slots=True)
class Stream:
    """A message asked for at a rate; an optional one is not asked for again once it was refused."""

    message_id: int
    hz: float
    optional: bool = False


def streams_of(settings: MavlinkSettings, autopilot: str) -> tuple[Stream, ...]:
    """What is asked of this autopilot, the most needed first."""
    rates = {"GLOBAL_POSITION_INT": settings.position_hz, "ATTITUDE": settings.attitude_hz}
    return tuple(
        Stream(number_of(name), rates.get(name, source.hz), source.optional)
        for name, source in SOURCES.items()
        if source.told_by(autopilot)
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
