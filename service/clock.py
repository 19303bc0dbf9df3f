"""The service's clock: the epoch's seconds, which may run faster than the wall when the vehicle is simulated.

Every time-out, time stamp and pause of the service is in this clock's time, so a flight at `--speedup 20`
takes the same decisions at the same (service) times as one at 1. The clock is anchored once and then follows
the monotonic clock: it never goes back, whatever happens to the host's date. What has happened to that since,
`wall_ahead` tells; `service.timebase` ties the clock to it, and anchors the clock of a run that is gone on with.
"""

from __future__ import annotations

import asyncio
import contextlib
import math
import time
from collections.abc import AsyncIterator, Awaitable, Callable
from typing import TypeVar

from service.errors import BadInput

_T = TypeVar("_T")
_SOONER_S = 1e-3
_AGAIN_WALL_S = 0.001


class Clock:
    """Seconds since the epoch, running `speedup` times faster than the wall since the clock's creation.

    Args:
        speedup: service seconds per wall second, finite and above zero; 1.0 on anything that really flies.
        begin: the service time now; the computer's, unless given.
        wall, ticks: the computer's clock (seconds since the epoch, may step) and its monotonic one.
        pace: seconds that never go back, by which the service's time runs instead of by `ticks`: a simulator's.

    Raises:
        BadInput: the speedup is not a positive number.
    """

    def __init__(
        self,
        speedup: float = 1.0,
        *,
        begin: float | None = None,
        wall: Callable[[], float] | None = None,
        ticks: Callable[[], float] | None = None,
        pace: Callable[[], float] | None = None,
    ) -> None:
        if not math.isfinite(speedup) or speedup <= 0:
            raise BadInput(f"the speedup must be a number above 0, not {speedup}")
        self.speedup = float(speedup)
        self._wall, self._ticks = wall or time.time, ticks or time.monotonic
        self._epoch = self._wall() if begin is None else begin
        self._pace = pace or self._ticks
        self._start, self._set_out = self._ticks(), self._pace()

    def monotonic(self) -> float:
        """Service seconds since the clock was created; never goes back."""
        return (self._pace() - self._set_out) * self.speedup

    def now(self) -> float:
        """Service time in seconds since the epoch; never goes back."""
        return self._epoch + self.monotonic()

    def wall(self) -> float:
        """What the computer's own clock says, in seconds since the epoch; may step."""
        return self._wall()

    def wall_ahead(self) -> float:
        """Seconds by which the computer's clock is ahead of this one, were this one to run as fast: a constant, unless
        somebody sets or slews the former."""
        return self._wall() - self._epoch - (self._ticks() - self._start)

    def wall_seconds(self, seconds: float) -> float:
        """How many wall seconds `seconds` of service time last."""
        return seconds / self.speedup

    async def sleep(self, seconds: float) -> None:
        """Pause this task for `seconds` of service time (at once when zero or less)."""
        until, left = self.monotonic() + seconds, seconds
        await asyncio.sleep(max(0.0, self.wall_seconds(left)))
        while (left := until - self.monotonic()) > _SOONER_S:  # who sets the pace has had to wait
            pause = max(self.wall_seconds(left), _AGAIN_WALL_S)
            await asyncio.sleep(pause)

    @contextlib.asynccontextmanager
    async def timeout(self, seconds: float | None) -> AsyncIterator[None]:
        """`asyncio.timeout` in service seconds: `async with clock.timeout(5.0): ...` raises TimeoutError."""
        async with asyncio.timeout(None) as limit:
            if seconds is None:
                yield
                return
            ending = asyncio.create_task(self._end(limit, seconds))
            try:
                yield
            finally:
                ending.cancel()

    async def _end(self, limit: asyncio.Timeout, seconds: float) -> None:
        await self.sleep(seconds)
        limit.reschedule(asyncio.get_running_loop().time())

    async def wait_for(self, awaitable: Awaitable[_T], seconds: float | None) -> _T:
        """Await for so many service seconds at most; then cancels the awaitable and raises TimeoutError."""
        async with self.timeout(seconds):
            return await awaitable
