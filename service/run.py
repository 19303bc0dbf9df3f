"""One run of the service, put together: area, grid, search, link, door, mission, and what is left behind."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import math
import os
import re
import shutil
import signal
import time
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path
from typing import Any

from rich.console import Console

from service.area import Grid, SearchArea
from service.clock import Clock
from service.config import Settings
from service.demo import World
from service.doors import Doors, open_doors
from service.errors import BadInput
from service.evidence.intake import Intake, JournalLost
from service.evidence.observe import Observation, Pose
from service.evidence.passes import Passes
from service.evidence.sensors import Profile, make_sensor
from service.http import Door, open_door
from service.journal import Journal
from service.mavlink import LinkError, LinkSettings, Vehicle, read_signing_key
from service.mission.mission import Mission
from service.mission.states import FINAL, State
from service.progress import set_up_logging, show
from service.report import run_report, simulated, write_results
from service.resume import last_transition, replay, stored_settings
from service.search import Search
from service.survey import AREA, JOURNAL, PRIOR, survey
from service.view.live import RunView

log = logging.getLogger("roisearch")
EXIT_CODES = {"found": 0, "not_found": 3, "aborted": 4}


def run(area_file: Path, prior_file: Path | None, settings: Settings) -> int:
    """Run a search from its area file to the ground; returns the exit code. Raises BadInput before it starts."""
    console = Console()
    set_up_logging(console)
    area, grid = survey(area_file, prior_file, settings)
    _tell(area, grid)
    sensor = make_sensor(settings, grid)
    signing_key = _signing_key(settings)
    with _open(settings) as (door, doors):
        folder = _new_folder(Path(settings.run.folder), area.name)
        shutil.copyfile(area_file, folder / AREA)
        if prior_file is not None:
            shutil.copyfile(prior_file, folder / PRIOR)
        journal = Journal(folder / JOURNAL)
        journal.set_meta("grid", grid.frame.to_dict())
        journal.set_meta("settings", settings.model_dump())
        return _search(area, grid, sensor, settings, folder, journal, door, doors, signing_key, console)


def resume(folder: Path, changed: dict[str, Any]) -> int:
    """Go on with the search of a run's folder, with its settings but for those `changed` ('section.key')."""
    console = Console()
    set_up_logging(console)
    settings = stored_settings(folder / JOURNAL, changed)
    prior_file = folder / PRIOR
    area, grid = survey(folder / AREA, prior_file if prior_file.exists() else None, settings)
    _tell(area, grid)
    sensor = make_sensor(settings, grid)
    signing_key = _signing_key(settings)
    with _open(settings) as (door, doors):
        journal = Journal(folder / JOURNAL)
        if journal.meta("grid") != grid.frame.to_dict():
            raise BadInput(
                f"{folder}: its journal is of another grid than its area file makes; resume it unchanged"
            )
        return _search(area, grid, sensor, settings, folder, journal, door, doors, signing_key, console)


@contextlib.contextmanager
def _open(settings: Settings) -> Iterator[tuple[Door, Doors]]:
    """Take every address before anything starts, and give them up at the end; raises BadInput."""
    with (
        contextlib.closing(open_door(settings.http, os.environ, settings.page)) as door,
        contextlib.closing(open_doors(settings.doors)) as doors,
    ):
        yield door, doors


def _tell(area: SearchArea, grid: Grid) -> None:
    """What a person should know about the area and its grid."""
    rows, cols = grid.frame.shape
    log.info("area: %s, %d cells of %g m to search", area.name, grid.searchable.sum(), grid.frame.cell_m)
    log.info("grid: %d x %d, turned to %.0f° true", rows, cols, grid.frame.bearing_deg)
    for note in grid.notes:
        log.info("note: %s", note)


def _signing_key(settings: Settings) -> bytes | None:
    """The key for MAVLink signing, if there is one; raises BadInput."""
    if not settings.link.signing_key_file:
        return None
    if settings.mock:
        raise BadInput(
            "the built-in mock autopilot does not sign; give --connect, or leave link.signing_key_file out"
        )
    return read_signing_key(settings.link.signing_key_file)


def _search(
    area: SearchArea,
    grid: Grid,
    sensor: Profile,
    settings: Settings,
    folder: Path,
    journal: Journal,
    door: Door,
    doors: Doors,
    signing_key: bytes | None,
    console: Console,
) -> int:
    """Compile the planner and fly."""
    try:
        search = Search(grid, settings)
        log.info("regions of interest: %d", search.regions.count)
        _compile(console, search)
        service = Service(area, search, sensor, settings, folder, console)
        service.view.estimator.warm_up()
        return asyncio.run(service.fly(door, doors, journal, signing_key))
    finally:
        journal.close()


def _new_folder(parent: Path, name: str) -> Path:
    slug = re.sub(r"[^a-z0-9]+", "-", name.lower()).strip("-") or "area"
    stamp = datetime.now().strftime("%Y%m%d-%H%M%S")
    try:
        for number in range(100):
            folder = parent / (f"{stamp}-{slug}" + (f"-{number}" if number else ""))
            with contextlib.suppress(FileExistsError):
                folder.mkdir(parents=True)
                return folder
    except OSError as error:
        raise BadInput(
            f"{parent}: runs cannot be kept here ({error.strerror}); give a writable --runs"
        ) from error
    raise BadInput(f"{parent}: a hundred runs began in this second; try again")


def _compile(console: Console, search: Search) -> None:
    began = time.perf_counter()
    if console.is_terminal:
        with console.status("compiling the planner") as status:
            search.warm_up(lambda name, done, total: status.update(f"compiling {name} ({done}/{total})"))
    else:
        search.warm_up(lambda name, done, total: log.info("compiling %s (%d/%d)", name, done, total))
    log.info("planner %s compiled in %.1f s", search.settings.search.planner, time.perf_counter() - began)


class Service:
    """A search from its first process to the last file it leaves."""

    def __init__(
        self,
        area: SearchArea,
        search: Search,
        sensor: Profile,
        settings: Settings,
        folder: Path,
        console: Console,
    ) -> None:
        self.area, self.search, self.settings = area, search, settings
        self.folder, self.console = folder, console
        self.clock = Clock(settings.speedup)
        self.world: World | None = None
        self.sensor = sensor
        self.view = RunView(area, search, self.sensor, settings, self.clock)

    async def fly(self, door: Door, doors: Doors, journal: Journal, signing_key: bytes | None) -> int:
        """Start everything, fly, and write the results; returns the exit code."""
        began = time.time()
        door, guest_token = door.with_guest()
        server = door.server(self.view)
        serving = asyncio.create_task(server.run_until_told())
        listening = asyncio.create_task(doors.serve(self.view.submit_all))
        try:
            while not server.started:  # a door that cannot be opened is said now, not after the flight
                if serving.done():
                    serving.result()
                    raise RuntimeError("the door has closed before it was open")
                await asyncio.sleep(0.01)
            connect = await self._start_world()
            link = self._link_settings(signing_key)
            async with Vehicle.open(connect, clock=self.clock, settings=link) as vehicle:
                mission = self._assemble(vehicle, journal)
                log.info("listening on %s", door.url)
                if self.world is not None:
                    await self.world.start_detector(door.url, guest_token)
                await self._run_mission(mission)
        except LinkError as error:
            log.error("%s", error)
        finally:
            await asyncio.sleep(0.3 if self.world is not None else 0.0)  # let the detector read the end
            server.should_exit = True
            listening.cancel()
            await asyncio.wait([listening])
            await serving
            if self.world is not None:
                await self.world.stop()
        if self.view.mission is None:
            return EXIT_CODES["aborted"]
        report = run_report(self.view.mission, self.area.name, self.settings, began)
        if self.world is not None:
            report["simulated"] = simulated(self.world.target, self.view.mission, self.settings)
        try:
            write_results(self.folder, self.view.mission, report, self.view.picture()())
        except OSError as error:
            log.error("%s: the results cannot be written (%s)", self.folder, error.strerror)
        return EXIT_CODES[report["outcome"]]

    def _assemble(self, vehicle: Vehicle, journal: Journal) -> Mission:
        """Intake and mission around a vehicle, with what an earlier run of this search has journalled."""

        def pose_at(moment: float) -> Pose | None:
            pose = vehicle.pose_at(moment)
            if pose is None or not mission.helm.trust.trusted_at(moment):
                return None
            attitude = (pose.pitch_deg, pose.roll_deg)
            return Pose(pose.lat, pose.lon, pose.alt_home_m, pose.heading_deg, moment, *attitude)

        def observed(observation: Observation, arrived: float) -> None:
            self.view.curve.add(self.clock.now(), self.search.record.pos)
            mission.observed(observation, arrived)

        intake = Intake(
            self.search, self.sensor, journal, self.clock, pose_at, observed, vehicle.time_of_boot
        )
        intake.believed = self.view.believed.observe
        intake.passes = Passes(again_s=self.settings.sensor.hover_look_s or math.inf)
        mission = Mission(
            settings=self.settings,
            clock=self.clock,
            search=self.search,
            vehicle=vehicle,
            journal=journal,
            intake=intake,
            may_take_off=self.settings.mock or self.settings.flight.takeoff,
            sent=self.view.latency.observe,
            thought=self.view.thinking.observe,
        )
        replayed = replay(journal.path, self.search, intake, self.view.curve.add)
        if replayed:
            log.info(
                "resumed: %d reports of the earlier run, POS %.1f %%", replayed, 100 * self.search.record.pos
            )
        if (last := last_transition(journal.path)) is not None and last["to"] == State.RETURNING:
            mission.departure.was_returning = last
        self.view.mission, self.view.intake = mission, intake
        return mission

    def _link_settings(self, signing_key: bytes | None) -> LinkSettings:
        link = self.settings.link
        return LinkSettings(
            system_id=link.system_id or None,
            allow_arming=self.settings.mock or self.settings.flight.takeoff,
            link_lost_s=link.silent_after_s,
            signing_key=signing_key,
            signing_timestamp_file=Path(self.settings.run.folder) / "signing-timestamp",
        )

    async def _start_world(self) -> str:
        if not self.settings.mock:
            log.info("link: %s", self.settings.link.connect)
            return self.settings.link.connect
        demo = self.settings.demo
        log.info(
            "no --connect: flying the built-in mock autopilot (%s, %gx real time) with a simulated detector "
            "and a simulated target; nothing real moves",
            demo.flavor,
            self.settings.speedup,
        )
        self.world = await World.start(self.search.grid, self.settings)
        return self.world.url

    async def _run_mission(self, mission: Mission) -> None:
        """Run the mission beside the display; a signal asks it to return, a second one ends it at once."""
        loop = asyncio.get_running_loop()
        flying = asyncio.create_task(mission.run())
        orders: set[asyncio.Task[str]] = set()

        def stop(name: str) -> None:
            if orders:
                log.warning("%s again: leaving the aircraft to its autopilot", name)
                flying.cancel()
            else:
                pilots = mission.state == State.YIELDED  # it is not taken from the pilot
                order = "return" if mission.flight.began and not pilots else "abort"
                log.warning("%s: %s (once more to leave the aircraft to its autopilot)", name, order)
                orders.add(asyncio.create_task(mission.order(order)))

        for number in (signal.SIGINT, signal.SIGTERM):
            loop.add_signal_handler(number, stop, number.name)
        display = asyncio.create_task(show(self.console, self.view.state))
        watch = asyncio.create_task(self._watch_world(mission))
        try:
            await flying
        except* (LinkError, JournalLost) as group:
            for error in group.exceptions:
                log.error("%s", error)
            await mission.leave(str(group.exceptions[0]))
        except* asyncio.CancelledError:
            await mission.leave("stopped by a signal", stop=False)
        except* Exception as group:  # a mistake of ours: the aircraft does not fly on into it
            await mission.leave(f"internal error, {group.exceptions[0]!r}")
            raise
        finally:
            display.cancel()
            watch.cancel()
            for number in (signal.SIGINT, signal.SIGTERM):
                loop.remove_signal_handler(number)

    async def _watch_world(self, mission: Mission) -> None:
        """End the run when a process of the built-in world is gone: there is nothing left to fly."""
        if self.world is not None:
            gone = await self.world.ended()
            if mission.state not in FINAL:
                log.error("%s has ended", gone)
                await mission.order("abort")
