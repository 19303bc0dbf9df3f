"""Maps are drawn in a process of their own (`drawer`), beside the door process.

A thread would do, but for the interpreter's lock: with it, every byte that the doors read or write waits until the
thread that draws has had its turn, and on a busy core an order took most of a second on its way through them.
"""

from __future__ import annotations

import asyncio
import socket
import subprocess
import sys
from multiprocessing.connection import Connection

from service.border import drawer
from service.border.drawer import Sight
from service.http.run import Unanswered
from service.view.scene import SearchGround


class Drawing:
    """Who asks for a map; the process that draws is started by the first, and again when it has ended."""

    def __init__(self) -> None:
        self._turn = asyncio.Lock()
        self._process: subprocess.Popen[bytes] | None = None
        self._channel: Connection | None = None
        self._told: SearchGround | None = None

    async def draw(self, kind: str, ground: SearchGround, sight: Sight) -> bytes:
        """A map of one of `drawer.KINDS`, one after the other. Raises Unanswered when the process ends over it."""
        async with self._turn:
            if self._channel is None:
                self._start()
            news = None if ground is self._told else ground
            self._told = ground
            try:
                return await asyncio.to_thread(self._ask, kind, news, sight)
            except asyncio.CancelledError:  # the answer would be in the channel, and taken for the next one's
                self.end()
                raise
            except (EOFError, OSError):
                self.end()
                raise Unanswered("the map could not be drawn: ask again") from None

    def _start(self) -> None:
        ours, theirs = socket.socketpair()
        with theirs:
            words = [sys.executable, "-m", drawer.__name__, str(theirs.fileno())]
            self._process = subprocess.Popen(words, pass_fds=[theirs.fileno()], stdin=subprocess.DEVNULL)
        self._channel = Connection(ours.detach())

    def _ask(self, kind: str, ground: SearchGround | None, sight: Sight) -> bytes:
        channel = self._channel
        assert channel is not None
        channel.send((kind, ground, sight))
        return channel.recv_bytes()

    def end(self) -> None:
        """Be rid of the process; whoever waits for a map hears of it."""
        if self._process is not None and self._channel is not None:
            self._process.kill()
            self._process.wait()
            self._channel.close()
        self._process = self._channel = self._told = None
