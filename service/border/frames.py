"""The frames of the border, without a socket: four bytes of length, then a JSON object in UTF-8.

Only JSON passes from the doors to the flight: bytes that strangers may have had a hand in never become anything but
texts, numbers, lists and tables there. A frame is at most `MOST_BYTES` long, which is said before the frame is
gathered, so nothing can fill the other side's memory.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Iterator
from typing import Any

MOST_BYTES = 4 << 20
"""Of a frame: the longest report that a door lets in, several times over."""
_HEAD = struct.Struct(">I")


class Broken(ConnectionError):
    """What came is no frame: the two sides do not speak the same language, and nothing after it can be trusted."""


def frame(message: dict[str, Any]) -> bytes:
    """A message as bytes. Raises ValueError when it is longer than a frame may be."""
    body = json.dumps(message, allow_nan=True).encode()
    if len(body) > MOST_BYTES:
        raise ValueError(f"a frame of {len(body)} bytes is more than the border takes, {MOST_BYTES}")
    return _HEAD.pack(len(body)) + body


class Frames:
    """Bytes in, in pieces as they come; whole messages out."""

    def __init__(self) -> None:
        self._gathered = bytearray()

    def feed(self, data: bytes) -> Iterator[dict[str, Any]]:
        """The messages that are whole with `data`, in order. Raises Broken."""
        self._gathered += data
        while len(self._gathered) >= _HEAD.size:
            (length,) = _HEAD.unpack_from(self._gathered)
            if length > MOST_BYTES:
                raise Broken(f"a frame of {length} bytes is announced; {MOST_BYTES} are the most")
            end = _HEAD.size + length
            if len(self._gathered) < end:
                return
            body = bytes(self._gathered[_HEAD.size : end])
            del self._gathered[:end]
            yield _message(body)


def _message(body: bytes) -> dict[str, Any]:
    try:
        message = json.loads(body)
    except (ValueError, RecursionError) as error:
        raise Broken(f"a frame is not JSON ({error})") from error
    if not isinstance(message, dict):
        raise Broken("a frame is not a table")
    return message
