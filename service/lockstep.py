"""Flying with a simulator in lockstep: its time is ours, and it waits for us when the machine is busy.

The simulator keeps its time in a file that both map into their memory (see `sim/autopilot/lockstep.py` for what stands
in it). Who follows says there up to which time it need not be waited for. When the simulator has ended, or that time
stands still for longer than it ever waits, it is gone, and time runs on by the wall: a time-out still comes.
"""

from __future__ import annotations

import asyncio
import fcntl
import mmap
import os
import threading
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from service.errors import BadInput

PLACES = 32
GONE_S = 15.0
"""Wall time after which a simulator whose time stands still is not followed any more."""
LOOK_S = 0.2
"""Wall time after which one whose time stands still is looked after: it may have ended."""
SLOW_DISK_S = 1.0
"""Wall time for which simulated time waits for what is being written."""
_EVERY_S = 0.002


class Lockstep:
    """The time of a simulator that runs `speedup` times as fast as the wall, unless it has to wait.

    Raises BadInput when there is no such file, or no place left in it.
    """

    def __init__(self, file: Path, speedup: float = 1.0, *, to_pass: tuple[int, ...] = ()) -> None:
        self.file, self._speedup = file, speedup
        self.to_pass = to_pass
        """What a process has to inherit that follows as well; nothing where the file has a name."""
        try:
            self._opened = file.open("r+b")
            memory = mmap.mmap(self._opened.fileno(), PLACES * 8)
        except (OSError, ValueError) as error:
            raise BadInput(f"{file}: no simulator keeps its time there ({error})") from error
        self._places = np.frombuffer(memory, dtype=np.float64)
        self._own = self._take()
        self._seen = float(self._places[0])
        self._since = self._asked = time.monotonic()
        self._extra_s = 0.0  # wall time in which the simulator was gone
        self._one_at_a_time = threading.Lock()

    @classmethod
    def create(cls, speedup: float) -> Lockstep:
        """A new one, in memory without a name that goes with us; processes that inherit `to_pass` find it at `file`."""
        descriptor = os.memfd_create("roisearch-lockstep", os.MFD_CLOEXEC)
        os.ftruncate(descriptor, PLACES * 8)
        return cls(Path(f"/proc/self/fd/{descriptor}"), speedup, to_pass=(descriptor,))

    def ticks(self) -> float:
        """Seconds that the wall would have taken to get to where the simulator is; never goes back."""
        with self._one_at_a_time:
            simulated, now = float(self._places[0]), time.monotonic()
            if simulated != self._seen:
                self._seen, self._since = simulated, now
            elif self._gone(now - self._since):
                self._extra_s += now - self._asked
            self._asked = now
            return simulated / self._speedup + self._extra_s

    def content_for(self, seconds: float) -> None:
        """So much simulated time from now on need not wait for us."""
        self._places[self._own] = max(float(self._places[0]) + seconds, np.finfo(np.float64).tiny)

    def leave(self) -> None:
        """Nobody waits for us any more."""
        self._places[self._own] = 0.0

    async def keep_up(self, waits_s: Callable[[], float] = lambda: 0.0) -> None:
        """Say again and again, from the event loop that does the work, that it is not behind.

        `waits_s` is for how long the work has waited for the disk, in wall time: simulated time waits along, at twenty
        times the pace half a second would be ten; but not for a disk that would be slow for a real aircraft, too.
        """
        while True:
            if not 0.0 < waits_s() < SLOW_DISK_S:
                self.content_for(0.0)
            await asyncio.sleep(_EVERY_S)

    def _gone(self, still_s: float) -> bool:
        """Whether the simulator, whose time has not moved for so long, has ended, or will not go on."""
        if LOOK_S < still_s < GONE_S and self._lock(0):
            fcntl.lockf(self._opened, fcntl.LOCK_UN, 8, 0)
            return True
        return still_s >= GONE_S

    def _lock(self, place: int) -> bool:
        """Make a place our own, if it is nobody's."""
        try:
            fcntl.lockf(self._opened, fcntl.LOCK_EX | fcntl.LOCK_NB, 8, 8 * place)
        except OSError:
            return False
        return True

    def _take(self) -> int:
        for place in range(1, PLACES):
            if self._lock(place):
                return place
        raise BadInput(f"{self.file}: {PLACES - 1} processes follow this simulator already")
