"""The service's clock."""

from __future__ import annotations

import asyncio
import time

import pytest

from service.clock import Clock
from service.errors import BadInput


def test_now_is_the_epoch_time_at_its_creation() -> None:
    before = time.time()
    clock = Clock()
    assert before - 0.01 <= clock.now() <= time.time() + 0.01


def test_speedup_makes_service_seconds_pass_faster_than_wall_seconds() -> None:
    clock = Clock(50.0)
    wall, service = time.monotonic(), clock.monotonic()
    time.sleep(0.02)
    service, wall = clock.monotonic() - service, time.monotonic() - wall
    assert service == pytest.approx(50.0 * wall, rel=0.2)


def test_now_and_monotonic_advance_together() -> None:
    clock = Clock(20.0)
    offset = clock.now() - clock.monotonic()
    time.sleep(0.01)
    assert clock.now() - clock.monotonic() == pytest.approx(offset, abs=0.05)


def test_sleep_lasts_the_service_time_it_was_given() -> None:
    clock = Clock(100.0)
    start = clock.monotonic()
    asyncio.run(clock.sleep(2.0))
    assert clock.monotonic() - start >= 2.0


def test_timeout_is_in_service_seconds() -> None:
    clock = Clock(1000.0)

    async def wait() -> None:
        async with clock.timeout(5.0):
            await asyncio.sleep(60.0)

    wall = time.monotonic()
    with pytest.raises(TimeoutError):
        asyncio.run(wait())
    assert time.monotonic() - wall < 5.0


def test_wait_for_gives_the_result_and_cancels_what_is_too_slow() -> None:
    clock = Clock(1000.0)
    cancelled = False

    async def quick() -> int:
        return 7

    async def slow() -> None:
        nonlocal cancelled
        try:
            await asyncio.sleep(60.0)
        except asyncio.CancelledError:
            cancelled = True
            raise

    async def main() -> None:
        assert await clock.wait_for(quick(), 5.0) == 7
        with pytest.raises(TimeoutError):
            await clock.wait_for(slow(), 5.0)

    asyncio.run(main())
    assert cancelled


@pytest.mark.parametrize("speedup", [0.0, -1.0, float("nan"), float("inf")])
def test_speedup_that_is_no_positive_number_is_refused(speedup: float) -> None:
    with pytest.raises(BadInput, match="speedup"):
        Clock(speedup)
