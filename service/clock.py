"""The service's clock: the epoch's seconds, which may run faster than the wall when the vehicle is simulated.

Every time-out, time stamp and pause of the service is in this clock's time, so a flight at `--speedup 20`
takes the same decisions at the same (service) times as one at 1. The clock is anchored once and then follows
the monotonic clock: it never goes back, whatever happens to the host's date.
"""

from __future__ import annotations

import asyncio
import math
import time
from collections.abc import Awaitable
from typing import TypeVar

from service.errors import BadInput

_T = TypeVar("_T")


class Clock:
    """Seconds since the epoch, running `speedup` times faster than the wall since the clock's creation.

    Args:
        speedup: service seconds per wall second, finite and above zero; 1.0 on anything that really flies.

    Raises:
        BadInput: the speedup is not a positive number.
    """

    def __init__(self, speedup: float = 1.0) -> None:
        if not math.isfinite(speedup) or speedup <= 0:
            raise BadInput(f"the speedup must be a number above 0, not {speedup}")
        self.speedup = float(speedup)
        self._epoch = time.time()
        self._start = time.monotonic()

    def monotonic(self) -> float:
        """Service seconds since the clock was created; never goes back."""
        return (time.monotonic() - self._start) * self.speedup

    def now(self) -> float:
        """Service time in seconds since the epoch; never goes back."""
        return self._epoch + self.monotonic()

    def wall_seconds(self, seconds: float) -> float:
        """How many wall seconds `seconds` of service time last."""
        return seconds / self.speedup

    async def sleep(self, seconds: float) -> None:
        """Pause this task for `seconds` of service time (at once when zero or less)."""
        await asyncio.sleep(max(0.0, self.wall_seconds(seconds)))

    def timeout(self, seconds: float | None) -> asyncio.Timeout:
        """`asyncio.timeout` in service seconds: `async with clock.timeout(5.0): ...` raises TimeoutError."""
        return asyncio.timeout(None if seconds is None else max(0.0, self.wall_seconds(seconds)))

    async def wait_for(self, awaitable: Awaitable[_T], seconds: float | None) -> _T:
        """Await for so many service seconds at most; then cancels the awaitable and raises TimeoutError."""
        async with self.timeout(seconds):
            return await awaitable
