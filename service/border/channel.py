"""The thin shell around the frames: one end of the socket between the two processes."""

from __future__ import annotations

import asyncio
import socket
from collections.abc import AsyncIterator
from typing import Any

from service.border.frames import Broken, Frames, frame

_CHUNK = 1 << 18


class Channel:
    """One end of the border. Nothing waits in `send`: what may be under way at a time is bounded by those who ask."""

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._reader, self._writer = reader, writer

    @classmethod
    async def over(cls, end: socket.socket) -> Channel:
        """A channel over a connected socket, which is the channel's from now on."""
        return cls(*await asyncio.open_unix_connection(sock=end, limit=_CHUNK))

    @property
    def waiting(self) -> int:
        """Bytes that the other side has not taken yet."""
        return self._writer.transport.get_write_buffer_size()

    def send(self, message: dict[str, Any]) -> None:
        """Send a message; it is lost where the other side is gone. Raises ValueError when it is too long."""
        if not self._writer.transport.is_closing():
            self._writer.write(frame(message))

    async def messages(self) -> AsyncIterator[dict[str, Any]]:
        """What comes, until the other side is gone or speaks nonsense (Broken)."""
        frames = Frames()
        while True:
            try:
                data = await self._reader.read(_CHUNK)
            except Broken:
                raise
            except ConnectionError:
                return
            if not data:
                return
            for message in frames.feed(data):
                yield message

    def close(self) -> None:
        """End it; the other side sees that."""
        self._writer.close()
