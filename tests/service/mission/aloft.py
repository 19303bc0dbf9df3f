"""A mission whole, in one process: shell and core, a search, a journal on disk, a link, and a mock autopilot."""

from __future__ import annotations

import asyncio
import itertools
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path

from service.clock import Clock
from service.config import Settings
from service.evidence.intake import Intake
from service.evidence.moments import Moments
from service.evidence.observe import FramePose, Observation
from service.evidence.reports import Report
from service.evidence.sensors import make_sensor
from service.journal import Journal
from service.mavlink import MavlinkSettings, Vehicle
from service.mission.core import MissionCore
from service.mission.formation import Formation
from service.mission.mission import Mission
from service.mission.standing import Terms
from service.mission.states import State
from service.search import Search
from sim.autopilot import settings as mock
from sim.autopilot.embedded import running
from sim.soak import ground
from tests.service.mission.flown import CELL_M, GRID

SPEEDUP = 10.0
PATIENCE_S = 60.0


@asynccontextmanager
async def aloft(
    folder: Path, flavor: str = "px4", formation: Formation | None = None
) -> AsyncIterator[Mission]:
    """A search under way over the soak's field, with a detector that sees nothing."""
    settings = Settings.model_validate(
        {
            "flight": {"altitude_m": 15.0, "takeoff": True},
            "sensor": {"cell_m": CELL_M, "silent_after_s": 1e6},
            "search": {"planner": "index"},
        }
    )
    clock, search, journal = Clock(SPEEDUP), Search(GRID, settings), Journal(folder / "journal.sqlite")
    home = (*ground.launch(), 400.0)
    try:
        async with running(
            mock.Settings(flavor=flavor, home=home, speedup=SPEEDUP, ready_after_s=1.0)
        ) as box:
            url = str(box.addresses[0]).replace("udpin", "udpout")
            async with Vehicle.open(url, clock=clock, settings=MavlinkSettings(allow_arming=True)) as vehicle:
                fresh = vehicle.settings.position_fresh_s, vehicle.settings.heartbeat_fresh_s
                core = MissionCore(settings, GRID, Terms(SPEEDUP, *fresh, may_take_off=True))

                def make_intake(
                    pose_at: Callable[[float], FramePose | None], told: Callable[[Observation, float], None]
                ) -> Intake:
                    return Intake(search, make_sensor(settings, GRID), journal, Moments(clock), pose_at, told)

                mission = Mission(
                    core,
                    clock=clock,
                    search=search,
                    vehicle=vehicle,
                    journal=journal,
                    make_intake=make_intake,
                    formation=formation,
                )
                tasks = [asyncio.create_task(mission.run()), asyncio.create_task(_look(mission))]
                try:
                    await until(mission, lambda: mission.state == State.SEARCHING)
                    await until(mission, lambda: mission.flight.waypoints >= 2)
                    yield mission
                finally:
                    for task in tasks:
                        task.cancel()
                    await asyncio.wait(tasks)
    finally:
        journal.close()


async def until(mission: Mission, condition: Callable[[], bool]) -> None:
    """Wait until something is so."""
    async with asyncio.timeout(PATIENCE_S):
        while not condition():
            await mission.clock.sleep(0.1)


async def _look(mission: Mission) -> None:
    """A detector that reports twice a second that there is nothing."""
    for number in itertools.count():
        report = Report(id=f"r{number}", captured_at=mission.clock.now(), detections=())
        await mission.intake.submit(report)
        await mission.clock.sleep(0.5)
