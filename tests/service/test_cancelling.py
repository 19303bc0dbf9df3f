"""A cancellation that a library has swallowed still ends the task."""

from __future__ import annotations

import asyncio

from service.cancelling import end_if_cancelled


def test_a_loop_that_asks_ends_though_its_call_has_swallowed_the_cancellation() -> None:
    async def swallows() -> None:
        try:
            await asyncio.sleep(60.0)
        except asyncio.CancelledError:
            return  # as `asyncio.wait_for` does when what it waits for is done in the same moment

    async def loop() -> None:
        while True:
            end_if_cancelled()
            await swallows()

    async def talk() -> bool:
        task = asyncio.create_task(loop())
        await asyncio.sleep(0.0)
        task.cancel()
        done, _ = await asyncio.wait([task], timeout=10.0)
        return task in done and task.cancelled()

    assert asyncio.run(talk())


def test_whoever_is_not_cancelled_goes_on() -> None:
    async def talk() -> None:
        end_if_cancelled()

    asyncio.run(talk())
