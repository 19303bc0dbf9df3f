"""One run of the service, put together: area, grid, search, link, door, mission, and what is left behind."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import os
import re
import shutil
import signal
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

from rich.console import Console

from service.area import Grid, SearchArea
from service.assembly import Onboard, assemble_all
from service.border.keeper import NOBODY, serving
from service.config import Settings, about, each_aircraft
from service.demo import DemoWorld
from service.doors import Doors, open_doors
from service.errors import BadInput
from service.evidence.cover import sensors_over
from service.evidence.sensors import Profile
from service.ground.words import of_the_ground
from service.http import Door, open_door
from service.journal import Journal
from service.lockstep import Lockstep
from service.mavlink import LinkError, MavlinkSettings, Vehicle, check_links, read_signing_key
from service.mavlink.url import LinkUrl, parse_url
from service.mission.mission import Mission
from service.mission.states import FINAL, State
from service.outlet import whatever_the_terminal_does
from service.progress import set_up_logging, show
from service.provenance import note_beginning, note_resumption
from service.report import REPORT, found_after_s, run_report, simulated, write_results
from service.resume import Whose, interrupted_run, left_system_id, stored_settings, why_over
from service.search import Search, begin
from service.squad import Squad
from service.survey import AREA, JOURNAL, PRIOR, keep_area, survey
from service.telling import TellingPlan, read_plan
from service.timebase import clock_for
from service.view.live import RunView

log = logging.getLogger("roisearch")
MOST_OF_A_NAME = 100
"""Characters of an area's name in that of its run's folder, which a file system bounds."""
TOLD_POS = (0.5, 0.75, 0.9)
"""The report tells how long it took to these."""
BEGUN_AGAIN = 1
"""Exit code, that of a crash, which lets a service manager start it again: a flight was left to its autopilot."""
EXIT_CODES = {"found": 0, "probable": 3, "not_found": 3, "aborted": 4}


@dataclass(frozen=True)
class Prepared:
    """All that has to be right before anything starts: the ground, the sensor, the addresses, the key.

    `restarted`: it may be that no person started this, so that only an order takes off. `patient`: nor that there is
    one to start it again, and an aircraft may be in the air, so that its link is waited for. `shut`: the aircraft whose
    links cannot be opened yet, while others go on.
    """

    area: SearchArea
    grid: Grid
    sensors: Mapping[str, Profile]
    settings: Settings
    restarted: bool
    patient: bool
    door: Door
    doors: Doors
    signing_key: bytes | None
    console: Console
    telling: TellingPlan = NOBODY
    shut: frozenset[str] = frozenset()


def run(area_file: Path, prior_file: Path | None, settings: Settings, *, restarted: bool = False) -> int:
    """Run a search from its area file to the ground; returns the exit code. Raises BadInput before it starts."""
    with _prepared(area_file, prior_file, settings, restarted=restarted, resumed=False) as prepared:
        folder = _new_folder(Path(settings.run.folder), prepared.area.name)
        keep_area(area_file, folder, settings)
        if prior_file is not None:
            shutil.copyfile(prior_file, folder / PRIOR)
        with contextlib.closing(Journal(folder / JOURNAL)) as journal:
            journal.set_meta("grid", prepared.grid.frame.to_dict())
            journal.set_meta("settings", settings.model_dump())
            note_beginning(journal, folder, settings)
            try:
                searches = _ready(prepared)
            except BadInput:
                shutil.rmtree(folder)  # a run that has not begun is none to go on with
                raise
            return _fly(prepared, searches, folder, journal)


def resume(folder: Path, changed: dict[str, Any], *, restarted: bool = False) -> int:
    """Go on with the search of a run's folder, with its settings but for those `changed` ('section.key').

    Raises BadInput before it starts, also when that run is over.
    """
    settings = stored_settings(folder / JOURNAL, changed)
    if why := why_over(folder / JOURNAL):
        raise BadInput(
            f"{folder}: this run is over ({why}) and is not gone on with; begin a new one with --area"
        )
    prior_file = folder / PRIOR
    prior = prior_file if prior_file.exists() else None
    with (
        _prepared(folder / AREA, prior, settings, restarted=restarted, resumed=True) as prepared,
        contextlib.closing(Journal(folder / JOURNAL)) as journal,
    ):
        if journal.meta("grid") != prepared.grid.frame.to_dict():
            raise BadInput(
                f"{folder}: its journal is of another grid than its area file makes; resume it unchanged"
            )
        note_resumption(journal, folder, settings)
        return _fly(prepared, _ready(prepared), folder, journal)


@contextlib.contextmanager
def _prepared(
    area_file: Path, prior_file: Path | None, settings: Settings, *, restarted: bool, resumed: bool
) -> Iterator[Prepared]:
    """Read everything and take every address before anything starts, and give these up at the end; raises BadInput."""
    console = Console()
    set_up_logging(console)
    area, grid = survey(area_file, prior_file, settings)
    _tell(area, grid, settings)
    shut = frozenset[str]()
    if not settings.mock:
        shut = check_links(_links(settings), resumed=resumed, patient=resumed and restarted)
    sensors, signing_key = sensors_over(grid, settings), _signing_key(settings)
    telling = read_plan(settings.telling)
    with (
        contextlib.closing(open_door(settings.http, os.environ, settings.page)) as door,
        contextlib.closing(open_doors(settings.doors)) as doors,
    ):
        patient = resumed and restarted
        yield Prepared(
            area,
            grid,
            sensors,
            settings,
            restarted,
            patient,
            door,
            doors,
            signing_key,
            console,
            telling,
            shut,
        )


def _links(settings: Settings) -> dict[str, LinkUrl]:
    """The address of each aircraft by its name. Raises BadInput when one is none, or two are the same."""
    links: dict[LinkUrl, str] = {}
    for name, alone in each_aircraft(settings).items():
        with about(name):
            link = parse_url(alone.link.connect)
        if links.setdefault(link, name) != name:
            raise BadInput(
                f"aircraft '{links[link]}' and '{name}' both have the link {link}; each needs its own"
            )
        _check_ground(alone)
    return {name: link for link, name in links.items()}


def _ready(prepared: Prepared) -> list[Search]:
    """The searches, with what their planners need compiled. Raises BadInput when one from outside cannot plan."""
    searches = searches_of(prepared)
    search = searches[0]
    log.info("regions of interest: %d", search.regions.count)
    log.info("%s plans %s", search.settings.search.planner, search.currency())
    _compile(prepared.console, search)
    for each in searches[1:]:
        each.plan_anew()
    return searches


def _fly(prepared: Prepared, searches: list[Search], folder: Path, journal: Journal) -> int:
    with whatever_the_terminal_does():
        return asyncio.run(Service(prepared, searches, folder).fly(journal))


def searches_of(prepared: Prepared) -> list[Search]:
    """The search as each of the aircraft has it, with one belief."""
    first, *others = each_aircraft(prepared.settings).items()
    with about(first[0]):
        common = begin(prepared.grid, prepared.settings)
        search = Search(prepared.grid, first[1], aircraft=first[0], common=common)
    return [search, *(_beside(search, name, settings) for name, settings in others)]


def _beside(search: Search, name: str, settings: Settings) -> Search:
    with about(name):
        return search.beside(name, settings)


def interrupted(area_file: Path, settings: Settings) -> Path | None:
    """The folder of the run over an area that was begun last and is not over, if there is one; says so."""
    folder, said = interrupted_run(Path(settings.run.folder), area_file, settings)
    if folder is not None:
        print(f"{folder} was interrupted: going on with it", flush=True)
    if said:
        print(said, flush=True)
    return folder


def _check_ground(settings: Settings) -> None:
    """A real aircraft should fly over ground that somebody has thought about."""
    if settings.real and not settings.ground_files and not settings.ground.flat:
        log.warning(
            "%s may be a real aircraft, and nothing says how high the ground is: give --ground FILE, or --flat to say "
            "that a constant height above the launch point clears everything",
            settings.link.connect,
        )


def _tell(area: SearchArea, grid: Grid, settings: Settings) -> None:
    """What a person should know about the area and its grid."""
    rows, cols = grid.frame.shape
    log.info("area: %s, %d cells of %g m to search", area.name, grid.searchable.sum(), grid.frame.cell_m)
    log.info("grid: %d x %d, turned to %.0f° true", rows, cols, grid.frame.bearing_deg)
    log.info("ground: %s", of_the_ground(grid, settings))
    if settings.sensor.terrain_file:
        log.warning("sensor.terrain_file is the old name of ground.file, and sets the heights of flight too")
    for note in (*area.notes, *grid.notes):
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


def _new_folder(parent: Path, name: str) -> Path:
    slug = re.sub(r"[^a-z0-9]+", "-", name.lower()).strip("-")[:MOST_OF_A_NAME] or "area"
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


def _lockstep(settings: Settings) -> Lockstep | None:
    """The time of the simulator that waits for us: the built-in one, or one that the settings name. Raises BadInput.

    In real time the built-in one waits for nobody: detectors of other people tell the wall's time.
    """
    if settings.link.lockstep:
        return Lockstep(Path(settings.link.lockstep), settings.speedup)
    return Lockstep.create(settings.speedup) if settings.mock and settings.speedup > 1.0 else None


async def _end(mission: Mission, order: str) -> None:
    """Give the order that ends a mission; one that cannot be brought home is left to who has it."""
    receipt = await mission.order(order)
    if receipt.refused and order != "leave":
        log.warning("%s%s: leave", mission.called, receipt.refused)
        await mission.order("leave")


class Service:
    """A search from its first process to the last file it leaves."""

    def __init__(self, prepared: Prepared, searches: Sequence[Search], folder: Path) -> None:
        self.prepared, self.searches, self.folder = prepared, searches, folder
        self.search = searches[0]
        self.area, self.settings = prepared.area, prepared.settings
        self.lockstep = _lockstep(prepared.settings)
        pace = self.lockstep.ticks if self.lockstep else None
        self.clock = clock_for(folder / JOURNAL, prepared.settings.speedup, pace)
        self.world: DemoWorld | None = None
        self.view = RunView(prepared.area, self.search, prepared.sensors, prepared.settings, self.clock)

    async def fly(self, journal: Journal) -> int:
        """Start everything, fly, and write the results; returns the exit code."""
        door, doors = self.prepared.door, self.prepared.doors
        began = time.time()
        door, guest_token = door.with_guest()
        try:  # a door that cannot be opened is said now, not after the flight
            telling = self.prepared.telling
            async with serving(door, doors, self.view, self.view.ground, journal.path, telling):
                connects = await self._start_world()
                async with contextlib.AsyncExitStack() as links:
                    vehicles = [
                        await links.enter_async_context(self._open(search, connect))
                        for search, connect in zip(self.searches, connects, strict=True)
                    ]
                    onboard = Onboard(self.prepared.sensors, self.prepared.restarted)
                    squad = assemble_all(self.searches, vehicles, onboard, journal, self.view)
                    self.view.begin(squad)
                    log.info("listening on %s", door.address)
                    if self.world is not None:
                        await self.world.start_detectors(door.url, list(squad.missions), guest_token)
                    await self._run_squad(squad, journal)
                await asyncio.sleep(0.3 if self.world is not None else 0.0)  # let the detector read the end
        except LinkError as error:
            log.error("%s", error)
        finally:
            if self.world is not None:
                await self.world.stop()
        if self.view.squad is None:
            return BEGUN_AGAIN if self.prepared.patient else EXIT_CODES["aborted"]
        return self._leave_results(self.view.squad, began)

    def _leave_results(self, squad: Squad, began: float) -> int:
        """Write what the run leaves behind; returns the exit code."""
        report = run_report(squad, self.area.name, self.settings, began)
        report["pos_after_s"] = {f"{pos:g}": self.view.curve.when(pos) for pos in TOLD_POS}
        if self.world is not None:
            target = self.world.target_at(found_after_s(squad.leading))
            report["simulated"] = simulated(target, squad, self.settings)
        flown = any(each.flight.began for each in squad.missions.values())
        if not flown and (self.folder / REPORT).exists():
            log.info("nothing was flown: %s is left as it was", self.folder / REPORT)
            return EXIT_CODES[report["outcome"]]
        try:
            write_results(self.folder, squad, report, self.view.picture()())
        except OSError as error:
            log.error("%s: the results cannot be written (%s)", self.folder, error.strerror)
        return EXIT_CODES[report["outcome"]]

    def _open(self, search: Search, connect: str) -> contextlib.AbstractAsyncContextManager[Vehicle]:
        """The link to one aircraft."""
        return Vehicle.open(connect, clock=self.clock, settings=self._link_settings(search))

    def _link_settings(self, search: Search) -> MavlinkSettings:
        link, name = search.settings.link, f"-{search.aircraft}" if search.aircraft else ""
        whose = Whose(search.aircraft, search is self.search)
        return MavlinkSettings(
            system_id=left_system_id(self.folder / JOURNAL, whose, link.system_id or None),
            allow_arming=self.settings.mock or self.settings.flight.takeoff,
            link_lost_s=link.silent_after_s,
            arming_patience_s=link.connect_timeout_s,
            wait_for_ever=self.prepared.patient or search.aircraft in self.prepared.shut,
            read_return_height=self.search.grid.relief is not None,
            read_motion=True,
            signing_key=self.prepared.signing_key,
            signing_timestamp_file=Path(self.settings.run.folder) / f"signing-timestamp{name}",
        )

    async def _start_world(self) -> list[str]:
        """The links to the aircraft; without any given, to those of the built-in world, which is begun."""
        alone = each_aircraft(self.settings)
        if not self.settings.mock:
            links = [settings.link.connect for settings in alone.values()]
            log.info("link: %s", ", ".join(links))
            return links
        what = "the built-in mock autopilot" if len(alone) == 1 else f"{len(alone)} built-in mock autopilots"
        log.info(
            "no --connect: flying %s (%s, %gx real time) with a simulated detector "
            "and a simulated target; nothing real moves",
            what,
            ", ".join(settings.demo.flavor for settings in alone.values()),
            self.settings.speedup,
        )
        self.world = await DemoWorld.start(self.search.grid, self.settings, self.lockstep)
        return self.world.urls

    async def _run_squad(self, squad: Squad, journal: Journal) -> None:
        """Run the missions beside the display; a signal asks them to return, a second one ends them at once."""
        loop = asyncio.get_running_loop()
        orders: set[asyncio.Task[None]] = set()

        def stop(name: str) -> None:
            if orders:
                log.warning("%s again: leaving the aircraft to its autopilot", name)
                squad.cancel()
                return
            for mission in squad.missions.values():
                stays = mission.state in (State.YIELDED, State.GROUNDED)  # it is not taken from the pilot
                order = "home" if mission.flight.began and not stays else "leave"
                said = "%s%s: %s (once more to leave the aircraft to its autopilot)"
                log.warning(said, mission.called, name, order)
                orders.add(asyncio.create_task(_end(mission, order)))

        for number in (signal.SIGINT, signal.SIGTERM):
            loop.add_signal_handler(number, stop, number.name)
        beside = [
            asyncio.create_task(show(self.prepared.console, self.view.state)),
            asyncio.create_task(self._watch_world(squad)),
            *([asyncio.create_task(self.lockstep.keep_up(journal.behind_s))] if self.lockstep else []),
        ]
        try:
            await squad.run()
        finally:
            for each in beside:
                each.cancel()
            if self.lockstep is not None:
                self.lockstep.leave()
            for number in (signal.SIGINT, signal.SIGTERM):
                loop.remove_signal_handler(number)

    async def _watch_world(self, squad: Squad) -> None:
        """When a process of the built-in world is gone, its aircraft has nothing left to fly for."""
        while self.world is not None and not squad.ended:
            gone, number = await self.world.ended()
            mission = list(squad.missions.values())[number]
            if mission.state not in FINAL:
                log.error("%s has ended", gone)
                await mission.order("abort")
