"""Maps are drawn, and long texts written, in a process of their own (`drawer`), beside the door process.

A thread would do, but for the interpreter's lock: with it, every byte that the doors read or write waits until the
thread that writes has had its turn, and on a busy core an order took most of a second on its way through them.
"""

from __future__ import annotations

import asyncio
import socket
import subprocess
import sys
from multiprocessing.connection import Connection
from pathlib import Path

from service.border import drawer
from service.border.drawer import Sight
from service.http.run import Unanswered
from service.view.scene import SearchGround


class Drawing:
    """Who asks for them; the process is started by the first, and again when it has ended."""

    def __init__(self) -> None:
        self._turn = asyncio.Lock()
        self._process: subprocess.Popen[bytes] | None = None
        self._channel: Connection | None = None
        self._told: SearchGround | None = None

    async def draw(self, kind: str, ground: SearchGround, sight: Sight) -> bytes:
        """A map of one of `drawer.MAPS`. Raises Unanswered when the process ends over it."""
        return await self._answer(kind, ground, sight)

    async def decisions(self, journal: Path, count: int) -> bytes:
        """The last decisions of a journal as JSON, the newest first. Raises Unanswered likewise."""
        return await self._answer("decisions", None, journal, count)

    async def _answer(self, kind: str, ground: SearchGround | None, *more: object) -> bytes:
        """What the process answers; who asks meanwhile waits."""
        async with self._turn:
            channel = self._channel or self._start()
            news = None if ground is self._told else ground
            self._told = ground or self._told
            try:
                return await asyncio.to_thread(_ask, channel, (kind, news, more))
            except asyncio.CancelledError:  # the answer would be in the channel, and taken for the next one's
                self.end()
                raise
            except (EOFError, OSError):
                self.end()
                raise Unanswered(f"the {kind} could not be drawn: ask again") from None

    def _start(self) -> Connection:
        ours, theirs = socket.socketpair()
        with theirs:
            words = [sys.executable, "-m", drawer.__name__, str(theirs.fileno())]
            self._process = subprocess.Popen(words, pass_fds=[theirs.fileno()], stdin=subprocess.DEVNULL)
        self._channel = Connection(ours.detach())
        return self._channel

    def end(self) -> None:
        """Be rid of the process; whoever waits for a map hears of it."""
        if self._process is not None and self._channel is not None:
            self._process.kill()
            self._process.wait()
            self._channel.close()
        self._process = self._channel = self._told = None


def _ask(channel: Connection, message: object) -> bytes:
    channel.send(message)
    return channel.recv_bytes()
