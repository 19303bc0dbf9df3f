"""Bytes to MAVLink messages and back, on pymavlink's generated dialect.

pymavlink's own stream parser believes the length byte of anything that begins with a start byte: one stray
0xFD in front of a good frame costs that frame too. This one takes a start byte as a guess. If the checksum of
the frame that would begin there is wrong, it goes on with the very next byte, so noise never costs a good
frame, and a guess that stays incomplete for too long is given up as well.

Signing has its place here: `Codec` owns the one `MAVLink` object that checks and makes signatures.
"""

from __future__ import annotations

import struct
from collections import OrderedDict
from collections.abc import Hashable
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

Message = Any
"""A message object of pymavlink's dialect (generated code, not typed)."""

_V1, _V2 = 0xFE, 0xFD
_V1_OVERHEAD, _V2_OVERHEAD, _SIGNATURE = 8, 12, 13
_PATIENCE_S = 0.5
_MOST_SOURCES = 8


class Codec:
    """Checks and decodes single frames, and encodes our own messages with our identity and sequence."""

    def __init__(self, system_id: int, component_id: int) -> None:
        self._mav = mavlink.MAVLink(None, srcSystem=system_id, srcComponent=component_id)

    @property
    def system_id(self) -> int:
        """The MAVLink system we speak as."""
        return int(self._mav.srcSystem)

    @system_id.setter
    def system_id(self, value: int) -> None:
        self._mav.srcSystem = value

    @property
    def component_id(self) -> int:
        """The MAVLink component we speak as."""
        return int(self._mav.srcComponent)

    def encode(self, message: Message) -> bytes:
        """One MAVLink 2 frame."""
        frame = bytes(message.pack(self._mav))
        self._mav.seq = (self._mav.seq + 1) % 256
        return frame

    def decode(self, frame: bytearray) -> Message | None:
        """The message in a whole frame, or None if its checksum, length or content is wrong."""
        try:
            return self._mav.decode(frame)
        except (mavlink.MAVError, struct.error):
            return None


class Framer:
    """Finds messages in a stream of bytes; one per source, so that streams do not mix."""

    def __init__(self, codec: Codec) -> None:
        self._codec = codec
        self._buffer = bytearray()
        self._fed_at = 0.0
        self.skipped = 0
        """Bytes that belonged to no valid frame."""

    def feed(self, data: bytes, now: float) -> list[Message]:
        """Take bytes as they came; returns the messages completed by them. Never raises on any bytes."""
        self._buffer += data
        self._fed_at = now
        return self._scan(wait=True)

    def expire(self, now: float) -> list[Message]:
        """Give up a frame that has stayed incomplete; returns the messages that it was hiding."""
        if not self._buffer or now - self._fed_at < _PATIENCE_S:
            return []
        return self._scan(wait=False)

    def _scan(self, *, wait: bool) -> list[Message]:
        messages: list[Message] = []
        buffer, at = self._buffer, 0
        while at < len(buffer):
            if buffer[at] not in (_V1, _V2):
                at += 1
                self.skipped += 1
                continue
            length = _frame_length(buffer, at)
            if length is None or at + length > len(buffer):
                if wait:
                    break
                message = None
            else:
                message = self._codec.decode(buffer[at : at + length]) if length else None
            if message is None or length is None or not self._plausible(message, at + length):
                at += 1
                self.skipped += 1
                continue
            at += length
            messages.append(message)
        del buffer[:at]
        return messages

    def _plausible(self, message: Message, end: int) -> bool:
        """The checksum of an unknown message cannot be checked: its length is, by what follows."""
        if message.get_msgId() >= 0:
            return True
        return end == len(self._buffer) or self._buffer[end] in (_V1, _V2)


class Receiver:
    """One framer for each of the last few sources heard."""

    def __init__(self, codec: Codec) -> None:
        self._codec = codec
        self._framers: OrderedDict[Hashable, Framer] = OrderedDict()

    def feed(self, data: bytes, now: float, source: Hashable) -> list[Message]:
        """Take bytes from a source; returns the messages completed by them."""
        framer = self._framers.get(source)
        if framer is None:
            framer = self._framers[source] = Framer(self._codec)
            if len(self._framers) > _MOST_SOURCES:
                self._framers.popitem(last=False)
        self._framers.move_to_end(source)
        return framer.feed(data, now)

    def expire(self, now: float) -> list[tuple[Hashable, Message]]:
        """The messages that were hidden behind frames which never became complete, with their sources."""
        return [(source, m) for source, framer in self._framers.items() for m in framer.expire(now)]


def own_heartbeat() -> Message:
    """HEARTBEAT of an onboard computer."""
    return mavlink.MAVLink_heartbeat_message(
        mavlink.MAV_TYPE_ONBOARD_CONTROLLER, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, mavlink.MAV_STATE_ACTIVE, 3
    )


def _frame_length(buffer: bytearray, at: int) -> int | None:
    """Length of the frame that would begin here; None if that cannot be told yet, 0 if none can."""
    if len(buffer) - at < 3:
        return None
    if buffer[at] == _V1:
        return _V1_OVERHEAD + buffer[at + 1]
    flags = buffer[at + 2]
    if flags & ~mavlink.MAVLINK_IFLAG_SIGNED:
        return 0
    return _V2_OVERHEAD + buffer[at + 1] + (_SIGNATURE if flags else 0)
