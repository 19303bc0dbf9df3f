"""Lockstep: a simulated time that does not run ahead of who flies with it, however busy the machine is.

A file of 32 numbers (float64, native order) that all map into their memory. The first is the simulated time in seconds;
each of the others belongs to one follower and says up to which time it need not be waited for. One mock leads: it alone
moves time on, and never further than `AHEAD_WALL_S` beyond the slowest follower. A process shows that a place is its
own by a lock on its bytes (fcntl), which the system lifts when it ends, whatever ended it: nobody waits for the dead.
One that stands still is waited for `GONE_S`, no longer: it may have been stopped on purpose.
"""

from __future__ import annotations

import fcntl
import mmap
import time
from pathlib import Path

import numpy as np

from sim.autopilot.settings import STEP_S

PLACES = 32
AHEAD_WALL_S = 0.025
"""So much wall time, at full speed, time may be ahead of the slowest follower, and never less than a step."""
GONE_S = 10.0
"""Wall time for which a follower that stands still is waited for."""
LOOK_S = 0.2
"""Wall time after which one that stands still is looked after: it may have ended."""


class Lockstep:
    """The time in a file, as a mock that leads it or, beside another one that does, follows it. Raises OSError."""

    def __init__(self, file: Path) -> None:
        if not file.exists():
            file.write_bytes(bytes(PLACES * 8))
        self._file = file.open("r+b")
        self._places = np.frombuffer(mmap.mmap(self._file.fileno(), PLACES * 8), dtype=np.float64)
        self._seen = np.zeros(PLACES)  # what stood in each place, and since when
        self._since = np.full(PLACES, time.monotonic())
        self._leads = self._take(0)
        self._own = 0 if self._leads else next(place for place in range(1, PLACES) if self._take(place))
        self._time = float(self._places[0])
        self.waits = True
        """Whether this one waits for its followers where it leads; otherwise time runs on as for a real aircraft."""

    def steps(self, wanted: int, speedup: float) -> int:
        """How many steps of `STEP_S` the vehicles move now, of those that wall time asks for; time moves on by as much
        where this one leads, and as others lead where it does not."""
        if not self._leads:
            return self._followed()
        room = self._slowest() + max(AHEAD_WALL_S * speedup, STEP_S) - self._time
        count = max(0, int(min(wanted, room / STEP_S)))
        self._time += count * STEP_S
        self._places[0] = self._time
        return count

    def _followed(self) -> int:
        count = max(0, int((float(self._places[0]) - self._time) / STEP_S))
        self._time += count * STEP_S
        self._places[self._own] = self._time
        if count == 0 and self._stands_for(0) > LOOK_S:
            self._leads = self._take(0)  # who led is gone
            if self._leads:
                self._places[self._own] = 0.0
        return count

    def _slowest(self) -> float:
        """The time of the slowest follower that is waited for."""
        if not self.waits:
            return np.inf
        times = [float(self._places[each]) for each in range(1, PLACES) if self._waited_for(each)]
        return min(times, default=np.inf)

    def _waited_for(self, place: int) -> bool:
        if self._places[place] == 0.0:
            return False
        if self._places[place] >= self._time:
            return True
        still_s = self._stands_for(place)
        if still_s > LOOK_S and self._take(place):  # its process is gone
            self._places[place] = 0.0
            fcntl.lockf(self._file, fcntl.LOCK_UN, 8, 8 * place)
            return False
        return still_s < GONE_S

    def _stands_for(self, place: int) -> float:
        now = time.monotonic()
        if self._places[place] != self._seen[place]:
            self._seen[place], self._since[place] = self._places[place], now
        return float(now - self._since[place])

    def _take(self, place: int) -> bool:
        """Make a place our own, if it is nobody's."""
        try:
            fcntl.lockf(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB, 8, 8 * place)
        except OSError:
            return False
        return True
