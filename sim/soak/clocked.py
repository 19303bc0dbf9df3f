"""`python -m sim.soak.clocked WORDS`: the service with a computer's clock that can be stepped.

`time.time` of the process, and of every one that it spawns, is off by the seconds that stand as a double in the file
that CLOCK_FILE names; whoever started it writes them there. The monotonic clock is never touched.
"""

from __future__ import annotations

import mmap
import os
import struct
import sys
import time
from pathlib import Path

CLOCK_FILE = "ROISEARCH_SOAK_CLOCK"
_SIZE = 8


class SteppedClock:
    """The file of one stepped clock, for whoever steps it."""

    def __init__(self, path: Path) -> None:
        self.path = path
        path.write_bytes(struct.pack("<d", 0.0))

    def step(self, by_s: float) -> None:
        """Step the clock by so many seconds."""
        with self.path.open("r+b") as file:
            (now,) = struct.unpack("<d", file.read(_SIZE))
            file.seek(0)
            file.write(struct.pack("<d", now + by_s))


def follow(path: Path) -> None:
    """Let `time.time` of this process follow the file."""
    true = time.time
    with path.open("rb") as file:
        page = mmap.mmap(file.fileno(), _SIZE, access=mmap.ACCESS_READ)

    def stepped() -> float:
        (by_s,) = struct.unpack("<d", page[:_SIZE])
        return true() + float(by_s)

    time.time = stepped


if __name__ in ("__main__", "__mp_main__") and CLOCK_FILE in os.environ:
    follow(Path(os.environ[CLOCK_FILE]))

if __name__ == "__main__":
    from service.cli import main

    sys.exit(main())
