"""Maps are drawn in a process of their own, beside the door process: `python -m service.border.drawing CHANNEL`.

A thread would do, but for the interpreter's lock: with it, every byte that the doors read or write waits until the
thread that draws has had its turn, and on a busy core an order took most of a second on its way through them.
"""

from __future__ import annotations

import asyncio
import contextlib
import ctypes
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing.connection import Connection

from service.http.run import Unanswered
from service.view.feed import Moment
from service.view.maps import draw_map, geojson_text, map_text
from service.view.scene import SearchGround

_PR_SET_PDEATHSIG = 1
_NICENESS = 10


@dataclass(frozen=True)
class Sight:
    """What is to be drawn; the digest is the belief's, where one was asked for."""

    moment: Moment
    digest: str


_Draw = Callable[[SearchGround, Sight], bytes]
KINDS: dict[str, _Draw] = {
    "map": lambda ground, sight: map_text(ground, sight.moment, sight.digest),
    "geojson": lambda ground, sight: geojson_text(ground, sight.moment),
    "picture": lambda ground, sight: draw_map(ground, sight.moment),
}


class Drawing:
    """Who asks for a map; the process that draws is started by the first, and again when it has ended."""

    def __init__(self) -> None:
        self._turn = asyncio.Lock()
        self._process: subprocess.Popen[bytes] | None = None
        self._channel: Connection | None = None
        self._told: SearchGround | None = None

    async def draw(self, kind: str, ground: SearchGround, sight: Sight) -> bytes:
        """A map of one of `KINDS`, one after the other. Raises Unanswered when the process ends over it."""
        async with self._turn:
            if self._channel is None:
                self._start()
            news = None if ground is self._told else ground
            self._told = ground
            # who gives up waiting leaves the answer in the channel, where the next would take it for his own
            asking = asyncio.ensure_future(asyncio.to_thread(self._ask, kind, news, sight))
            try:
                return await asyncio.shield(asking)
            except asyncio.CancelledError:
                self.end()
                raise
            except (EOFError, OSError):
                self.end()
                raise Unanswered("the map could not be drawn: ask again") from None

    def _start(self) -> None:
        ours, theirs = socket.socketpair()
        with theirs:
            words = [sys.executable, "-m", __name__, str(theirs.fileno())]
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


def _draw_for_ever(channel: Connection) -> None:
    """Draw what is asked for, until whoever asks is gone. What comes is of the process that started this one."""
    ground: SearchGround | None = None
    while True:
        kind, news, sight = channel.recv()
        ground = news or ground
        assert ground is not None
        channel.send_bytes(KINDS[kind](ground, sight))


def main() -> None:
    """Draw for the other end of the channel that the first argument names."""
    parent = os.getppid()
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    with contextlib.suppress(OSError):
        os.nice(_NICENESS)
    if os.getppid() == parent:
        with contextlib.suppress(EOFError, ConnectionError):
            _draw_for_ever(Connection(int(sys.argv[1])))


if __name__ == "__main__":
    main()
