"""`roisearch-sim bench autopilot`: many mocks in one process, and whether they keep up with real time."""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import time
from dataclasses import dataclass

from sim.autopilot.address import Address
from sim.autopilot.core import Autopilot
from sim.autopilot.settings import Settings
from sim.autopilot.transport import Driver, Mock


@dataclass(frozen=True)
class Pace:
    """How fast vehicle time passed: the slowest mock's share of the time asked for, and of a core what it took."""

    share: float
    core: float


async def pace(count: int, seconds: float, speedup: float = 1.0) -> Pace:
    """Run `count` mocks, PX4 and ArduPilot in turn, each with a TCP client that reads all, for some wall seconds."""
    async with contextlib.AsyncExitStack() as stack:
        mocks = []
        for k in range(count):
            mock = Mock(Autopilot(Settings(flavor=("px4", "ardupilot")[k % 2], sysid=k % 250 + 1, seed=k)))
            stack.callback(mock.close)
            await mock.listen(Address("tcpin", "127.0.0.1", 0))
            reader, writer = await asyncio.open_connection("127.0.0.1", mock.addresses[0].port)
            stack.callback(writer.close)
            stack.callback(asyncio.create_task(_read_all(reader)).cancel)
            mocks.append(mock)
        driver = asyncio.create_task(Driver(mocks, speedup).run())
        stack.callback(driver.cancel)
        await asyncio.sleep(0.5)
        wall, used, began = time.monotonic(), time.process_time(), [mock.autopilot.clock for mock in mocks]
        await asyncio.sleep(seconds)
        took = time.monotonic() - wall
        gone = min(mock.autopilot.clock - start for mock, start in zip(mocks, began, strict=True))
        return Pace(gone / (took * speedup), (time.process_time() - used) / took)


async def _read_all(reader: asyncio.StreamReader) -> None:
    while await reader.read(1 << 16):
        pass


def main(arguments: list[str]) -> int:
    """The command line; exits 0 when real time (times --speedup) is kept, else 1."""
    parser = argparse.ArgumentParser(prog="roisearch-sim bench autopilot", description=__doc__)
    parser.add_argument("--mocks", type=int, default=60, help="how many in the process (default 60)")
    parser.add_argument("--seconds", type=float, default=10.0, help="wall seconds to measure (default 10)")
    parser.add_argument("--speedup", type=float, default=1.0, help="times faster than the wall clock")
    options = parser.parse_args(arguments)
    if options.mocks < 1 or options.seconds <= 0.0 or not 0.0 < options.speedup <= 100.0:
        parser.error("--mocks must be at least 1, --seconds above 0, --speedup above 0 and at most 100")
    kept = asyncio.run(pace(options.mocks, options.seconds, options.speedup))
    factor = kept.share * options.speedup
    print(
        f"{options.mocks} mocks in one process: the slowest ran at {factor:.3f} times real time "
        f"({kept.share:.1%} of what was asked for), with {kept.core:.0%} of a core"
    )
    return 0 if kept.share > 0.9 else 1
