"""The process that draws maps, and writes out what is long: `python -m service.border.drawer CHANNEL`, the number of a
file descriptor that it inherits.

It imports no more than it needs: who asks for the first map waits for that.
"""

from __future__ import annotations

import contextlib
import ctypes
import json
import os
import signal
import sys
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path

from service.entries import read_last_entries
from service.rows import DecisionRow
from service.view.feed import Moment
from service.view.maps import draw_map, geojson_text, map_text
from service.view.scene import SearchGround

_PR_SET_PDEATHSIG = 1
_NICENESS = 5


@dataclass(frozen=True)
class Sight:
    """What is to be drawn; the digest is the belief's, where one was asked for."""

    moment: Moment
    digest: str


def decisions_text(journal: Path, count: int) -> bytes:
    """The last decisions of a journal with their reasons and options, the newest first, as JSON."""
    made = read_last_entries(journal, DecisionRow, count)
    return json.dumps([{"time": entry.time, **entry.said.body()} for entry in made]).encode()


TEXTS: dict[str, Callable[..., bytes]] = {"decisions": decisions_text}
MAPS: dict[str, Callable[[SearchGround, Sight], bytes]] = {
    "map": lambda ground, sight: map_text(ground, sight.moment, sight.digest),
    "geojson": lambda ground, sight: geojson_text(ground, sight.moment),
    "picture": lambda ground, sight: draw_map(ground, sight.moment),
}


def _draw_for_ever(channel: Connection) -> None:
    """Draw what is asked for, until whoever asks is gone. What comes is of the process that started this one: the kind,
    the ground where it is another one, and what else that kind needs."""
    ground: SearchGround | None = None
    while True:
        kind, news, more = channel.recv()
        ground = news or ground
        if kind in TEXTS:
            channel.send_bytes(TEXTS[kind](*more))
        else:
            assert ground is not None
            channel.send_bytes(MAPS[kind](ground, *more))


def main() -> None:
    """Draw for the other end of the channel that the first argument names."""
    parent = os.getppid()
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    with contextlib.suppress(OSError):
        os.nice(_NICENESS)
    if os.getppid() == parent:
        with contextlib.suppress(EOFError, OSError):
            _draw_for_ever(Connection(int(sys.argv[1])))


if __name__ == "__main__":
    main()
