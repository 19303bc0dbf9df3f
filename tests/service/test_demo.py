"""The built-in world of several aircraft: whose process it was that has ended."""

from __future__ import annotations

import asyncio
import sys

from service.config import Settings
from service.demo import DemoWorld


def test_of_which_aircraft_a_process_was_that_has_ended() -> None:
    async def end_some() -> list[tuple[str, int]]:
        world = DemoWorld(None, Settings(), urls=["of the first", "of the second"])
        sleeping = (sys.executable, "-c", "import time; time.sleep(600)")
        world.processes = [await asyncio.create_subprocess_exec(*sleeping) for _ in range(4)]
        said = []
        for number in (1, 2, 3):
            world.processes[number].kill()
            said.append(await world.ended())
        await world.stop()
        return said

    assert asyncio.run(end_some()) == [
        ("the mock autopilot", 1),
        ("the simulated detector", 0),
        ("the simulated detector", 1),
    ]
