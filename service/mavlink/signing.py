"""MAVLink 2 message signing: who sent a frame, and that it was not sent before.

A signed frame ends in 13 more bytes: the link's id (1), a timestamp (6, little-endian, in 10 µs since the
beginning of 2015) and the first 6 bytes of SHA-256 over the secret key and all of the frame before them. Each
stream of frames, named by the sender's system, component and link id, must carry timestamps that only grow, so
a recorded frame cannot be sent again (MAVLink guide, "Message Signing").

pymavlink's own check notes a frame's timestamp before it has looked at its signature, so that one forged frame
from the far future silences a stream for good. Here nothing is noted before the signature is right.

No clock here: the owner calls `advance`.
"""

from __future__ import annotations

import hashlib
import hmac
import string

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.errors import BadInput
from service.secret_file import read_secret

KEY_BYTES = 32
EPOCH_S = 1_420_070_400
"""The beginning of 2015, UTC, in seconds since the epoch."""
PER_S = 100_000

_V2, _SIGNED = 0xFD, mavlink.MAVLINK_IFLAG_SIGNED
_BLOCK, _SIGNATURE = 13, 6
_CHECKSUM = 2
_NEW_STREAM_LAG = 60 * PER_S
_LATEST = (1 << 48) - 365 * 86400 * PER_S
"""The counter ends in 2104; a frame from its last year is a mistake, which following would make ours as well."""


class Signer:
    """Signs what we send and checks what we receive, with one key.

    Args:
        key: the shared secret, 32 bytes.
        link_id: the number of our end of the link in our signatures.

    Raises:
        ValueError: the key has another length.
    """

    def __init__(self, key: bytes, link_id: int = 0) -> None:
        if len(key) != KEY_BYTES:
            raise ValueError(f"a signing key has {KEY_BYTES} bytes")
        self._key = key
        self._link_id = link_id
        self._timestamp = 0
        self._streams: dict[tuple[int, int, int], int] = {}
        self.behind_s = 0.0
        """So many seconds behind our time the last frame was that was signed with our key, and refused for that."""

    @property
    def timestamp(self) -> int:
        """The last timestamp used or believed, in 10 µs since the beginning of 2015."""
        return self._timestamp

    def advance(self, timestamp: int) -> None:
        """Sign with timestamps after this one from now on; one that lies behind changes nothing."""
        self._timestamp = max(self._timestamp, min(timestamp, _LATEST))

    def sign(self, frame: bytes, crc_extra: int) -> bytes:
        """An unsigned MAVLink 2 frame with its signature. `crc_extra` is the seed of its message's checksum."""
        signed = bytearray(frame[:-_CHECKSUM])
        signed[2] |= _SIGNED
        checksum = mavlink.x25crc(signed[1:] + bytes([crc_extra])).crc
        signed += checksum.to_bytes(_CHECKSUM, "little")
        self._timestamp += 1
        signed.append(self._link_id)
        signed += self._timestamp.to_bytes(6, "little")
        return bytes(signed) + self._signature(signed)

    def verify(self, frame: bytes | bytearray) -> bool:
        """Whether a whole frame was signed with our key and is newer than all before it in its stream.

        A stream that is heard for the first time may lag a minute behind us.
        """
        if frame[0] != _V2 or not frame[2] & _SIGNED:
            return False
        if not hmac.compare_digest(self._signature(frame[:-_SIGNATURE]), bytes(frame[-_SIGNATURE:])):
            return False
        block = frame[-_BLOCK:]
        stream, timestamp = (frame[5], frame[6], block[0]), int.from_bytes(block[1:7], "little")
        last = self._streams.get(stream, self._timestamp - _NEW_STREAM_LAG - 1)
        if not last < timestamp <= _LATEST:
            self.behind_s = max(0.0, (self._timestamp - timestamp) / PER_S)
            return False
        self._streams[stream] = timestamp
        self.advance(timestamp)
        return True

    def forget_streams(self) -> None:
        """Whoever signed before is not there any more: every stream is heard for the first time again."""
        self._streams.clear()

    def _signature(self, frame: bytes | bytearray) -> bytes:
        return hashlib.sha256(self._key + frame).digest()[:_SIGNATURE]


def timestamp_at(time_s: float) -> int:
    """The timestamp of a time in seconds since the epoch."""
    return max(0, int((time_s - EPOCH_S) * PER_S))


def read_signing_key(path: str) -> bytes:
    """The key in a file: 64 hexadecimal digits; or 32 bytes as they are; or anything else that is text, taken as
    a passphrase, whose SHA-256 is the key, as ground stations do it.

    32 bytes that are all printable are a passphrase. White space around a text does not count.

    Raises:
        BadInput: the file cannot be read, or is none of these.
    """
    content = read_secret(path, "signing key")
    printable = {ord(character) for character in string.printable}
    if len(content) == KEY_BYTES and not set(content) <= printable:
        return content
    try:
        text = content.decode("utf-8").strip()
    except UnicodeDecodeError:
        raise BadInput(
            f"{path}: this is no signing key; give 32 bytes, 64 hexadecimal digits or a passphrase"
        ) from None
    if len(text) == 2 * KEY_BYTES and set(text) <= set(string.hexdigits):
        return bytes.fromhex(text)
    if len(text) < 8:
        raise BadInput(f"{path}: a passphrase has at least 8 characters")
    return hashlib.sha256(text.encode()).digest()
