"""Bytes to MAVLink messages and back, on pymavlink's generated dialect.

pymavlink's own stream parser believes the length byte of anything that begins with a start byte: one stray
0xFD in front of a good frame costs that frame too. This one takes a start byte as a guess. If the checksum of
the frame that would begin there is wrong, it goes on with the very next byte, so noise never costs a good
frame, and a guess that stays incomplete for too long is given up as well.

With a `Signer`, `Codec` signs every frame that goes out and trusts no frame that is not signed, but RADIO_STATUS:
it comes from the telemetry radio itself, which has no key, and the specification always lets it pass. The core
takes no word of it for the vehicle's.
"""

from __future__ import annotations

import struct
from collections import OrderedDict
from collections.abc import Hashable
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.mavlink.signing import Signer

Message = Any
"""A message object of pymavlink's dialect (generated code, not typed)."""

_V1, _V2 = 0xFE, 0xFD
_V1_OVERHEAD, _V2_OVERHEAD, _SIGNATURE = 8, 12, 13
_PATIENCE_S = 0.5
_MOST_SOURCES = 8


class Codec:
    """Checks and decodes single frames, and encodes our own messages with our identity and sequence."""

    def __init__(self, system_id: int, component_id: int, signer: Signer | None = None) -> None:
        self._mav = mavlink.MAVLink(None, srcSystem=system_id, srcComponent=component_id)
        self.signer = signer
        """Its timestamp is for the owner of the link to keep."""
        self.speaks_v1 = False
        """Send MAVLink 1: the vehicle understands nothing else. Never with a signer."""
        self.refused = 0
        """Good frames that were not signed as they should be."""

    @property
    def system_id(self) -> int:
        """The MAVLink system we speak as."""
        return int(self._mav.srcSystem)

    @system_id.setter
    def system_id(self, value: int) -> None:
        self._mav.srcSystem = value

    def forget_vehicle(self, system_id: int) -> None:
        """Another vehicle is waited for: speak as this system, in MAVLink 2, and take signed streams as new ones."""
        self.system_id, self.speaks_v1, self.refused = system_id, False, 0
        if self.signer is not None:
            self.signer.forget_streams()

    @property
    def component_id(self) -> int:
        """The MAVLink component we speak as."""
        return int(self._mav.srcComponent)

    def encode(self, message: Message) -> bytes:
        """One MAVLink 2 frame, signed if there is a signer; or a MAVLink 1 frame, where the vehicle knows no other."""
        v1 = self.speaks_v1 and self.signer is None and 0 <= message.get_msgId() < 256
        frame = bytes(message.pack(self._mav, force_mavlink1=v1))
        self._mav.seq = (self._mav.seq + 1) % 256
        return frame if self.signer is None else self.signer.sign(frame, message.crc_extra)

    def decode(self, frame: bytearray) -> Message | None:
        """The message in a whole frame, or None if its checksum, length or content is wrong."""
        try:
            return self._mav.decode(frame)
        except (mavlink.MAVError, struct.error):
            return None

    def trusts(self, frame: bytearray, message: Message) -> bool:
        """Whether a decoded frame may be believed; to be asked once for each."""
        if self.signer is None or self.signer.verify(frame):
            return True
        if message.get_msgId() == mavlink.MAVLINK_MSG_ID_RADIO_STATUS:
            return True
        self.refused += 1
        return False


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
                length = 0
            frame = buffer[at : at + length]
            message = self._codec.decode(frame) if frame else None
            trusted = message is not None and self._codec.trusts(frame, message)
            if message is None or not self._plausible(message, at, at + length, trusted):
                at += 1
                self.skipped += 1
                continue
            at += length
            if trusted:
                messages.append(message)
        del buffer[:at]
        return messages

    def _plausible(self, message: Message, start: int, end: int, trusted: bool) -> bool:
        """The checksum of an unknown message cannot be checked: its signature is, or that another follows and none is
        in it."""
        if message.get_msgId() >= 0:
            return True
        if self._codec.signer is not None:
            return trusted
        ends = end == len(self._buffer) or self._buffer[end] in (_V1, _V2)
        return ends and not any(self._begins(at) for at in range(start + 1, end))

    def _begins(self, at: int) -> bool:
        """Whether a whole frame of a known message begins here."""
        if self._buffer[at] not in (_V1, _V2):
            return False
        length = _frame_length(self._buffer, at) or 0
        message = self._codec.decode(self._buffer[at : at + length]) if length else None
        return message is not None and message.get_msgId() >= 0


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
