"""The process that draws maps: `python -m service.border.drawer CHANNEL`, a file descriptor that it inherits.

It imports no more than it needs: who asks for the first map waits for that.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import signal
import sys
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing.connection import Connection

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
