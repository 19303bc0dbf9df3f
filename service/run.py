"""One run of the service, put together: area, grid, search, link, door, mission, and what is left behind."""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
import math
import os
import re
import shutil
import signal
import time
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
from prometheus_client import CollectorRegistry, Gauge, Histogram
from rich.console import Console

from service.area import SearchArea, build_grid, read_area, read_geotiff_prior
from service.clock import Clock
from service.config import Settings
from service.demo import World
from service.errors import BadInput
from service.evidence import Observation, Pose, Sensor
from service.http import Door, open_door
from service.intake import Intake, JournalLost
from service.journal import Journal
from service.mavlink import LinkError, LinkSettings, Vehicle, read_signing_key
from service.mission import Mission
from service.picture import Scene, draw_scene
from service.progress import set_up_logging, show
from service.report import latency_summary, track_geojson, write_json
from service.reports import Receipt, Report
from service.search import Search
from service.states import FINAL, State

log = logging.getLogger("roisearch")
EXIT_CODES = {"found": 0, "not_found": 3, "aborted": 4}


def cell_size(settings: Settings) -> float:
    """The cell size in metres: as given, else the footprint's shorter side less the overlap."""
    if settings.sensor.cell_m is not None:
        return settings.sensor.cell_m
    angle = min(settings.sensor.horizontal_fov_deg, settings.sensor.vertical_fov_deg)
    footprint = 2.0 * settings.flight.altitude_m * math.tan(math.radians(angle / 2.0))
    return round(footprint * (1.0 - settings.sensor.overlap), 1)


def run(area_file: Path, prior_file: Path | None, settings: Settings) -> int:
    """Run a search from its area file to the ground; returns the exit code. Raises BadInput before it starts."""
    console = Console()
    set_up_logging(console)
    area = read_area(area_file, max_area_km2=settings.search.max_area_km2)
    grid = build_grid(area, cell_size(settings))
    if prior_file is not None:
        grid = grid.with_prior(read_geotiff_prior(prior_file, grid.frame, grid.searchable))
    signing_key = _signing_key(settings)
    door = open_door(settings.http, os.environ)
    try:
        folder = _new_folder(Path(settings.run.folder), area.name)
        shutil.copyfile(area_file, folder / "area.geojson")
        rows, cols = grid.frame.shape
        log.info("area: %s, %d cells of %g m to search", area.name, grid.searchable.sum(), grid.frame.cell_m)
        log.info("grid: %d x %d, turned to %.0f° true", rows, cols, grid.frame.bearing_deg)
        for note in grid.notes:
            log.info("note: %s", note)
        search = Search(grid, settings)
        log.info("regions of interest: %d", search.regions.count)
        _compile(console, search)
        service = Service(area, search, settings, folder, console)
        return asyncio.run(service.fly(door, signing_key))
    finally:
        door.close()


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
    """A running search, as the door and the display see it."""

    def __init__(
        self, area: SearchArea, search: Search, settings: Settings, folder: Path, console: Console
    ) -> None:
        self.area, self.search, self.settings = area, search, settings
        self.folder, self.console = folder, console
        self.clock = Clock(settings.speedup)
        self.world: World | None = None
        self.mission: Mission | None = None
        self.sensor = Sensor(
            frame=search.grid.frame,
            fov=search.fov,
            p_tp=settings.sensor.p_tp,
            p_tn=settings.sensor.p_tn,
            overlap=settings.sensor.overlap,
            min_covered=settings.sensor.min_covered,
            height_m=settings.flight.altitude_m,
        )
        self.registry = CollectorRegistry()
        self._latency = Histogram(
            "roisearch_hit_to_waypoint_seconds",
            "From a report with a hit to the waypoint on the wire",
            registry=self.registry,
            buckets=(0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0),
        )
        gauge = Gauge("roisearch_pos", "Probability of success so far", registry=self.registry)
        gauge.set_function(lambda: search.record.pos)
        entropy = Gauge("roisearch_belief_entropy_bits", "Entropy of the belief", registry=self.registry)
        entropy.set_function(search.belief.entropy)

    # ---- the flight --------------------------------------------------------------------------------------

    async def fly(self, door: Door, signing_key: bytes | None = None) -> int:
        """Start everything, fly, and write the results."""
        self.journal = Journal(self.folder / "journal.sqlite")
        self.journal.set_meta("grid", self.search.grid.frame.to_dict())
        self.journal.set_meta("settings", self.settings.model_dump())
        door, guest_token = door.with_guest()
        server = door.server(self)
        serving = asyncio.create_task(server.run_until_told())
        began = time.time()
        try:
            connect = await self._start_world()
            async with Vehicle.open(
                connect, clock=self.clock, settings=self._link_settings(signing_key)
            ) as vehicle:
                self.intake = Intake(
                    self.search, self.sensor, self.journal, self.clock, self._pose_at(vehicle), self._observed
                )
                self.mission = Mission(
                    settings=self.settings,
                    clock=self.clock,
                    search=self.search,
                    vehicle=vehicle,
                    journal=self.journal,
                    intake=self.intake,
                    may_take_off=self.settings.mock or self.settings.flight.takeoff,
                )
                log.info("listening on %s", door.url)
                if self.world is not None:
                    await self.world.start_detector(door.url, guest_token)
                await self._run_mission(self.mission)
        finally:
            report = self._report(began) if self.mission is not None else None
            await asyncio.sleep(0.3 if self.world is not None else 0.0)  # let the detector read the end
            server.should_exit = True
            await serving
            if self.world is not None:
                await self.world.stop()
            self.journal.close()
        assert report is not None
        self._write_results(report)
        return EXIT_CODES[report["outcome"]]

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
                log.warning("%s: returning (once more to leave the aircraft to its autopilot)", name)
                orders.add(asyncio.create_task(mission.order("return" if mission.flight.began else "abort")))

        for number in (signal.SIGINT, signal.SIGTERM):
            loop.add_signal_handler(number, stop, number.name)
        display = asyncio.create_task(show(self.console, self.state))
        watch = asyncio.create_task(self._watch_world(mission))
        try:
            await flying
        except* (LinkError, JournalLost) as group:
            for error in group.exceptions:
                log.error("%s", error)
            mission.why_stopped = str(group.exceptions[0])
            mission.state = State.ABORTED
        except* asyncio.CancelledError:
            mission.why_stopped = "stopped by a signal"
            mission.state = State.ABORTED
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

    def _pose_at(self, vehicle: Vehicle) -> Any:
        def look_up(moment: float) -> Pose | None:
            pose = vehicle.pose_at(moment)
            if pose is None:
                return None
            return Pose(pose.lat, pose.lon, pose.alt_home_m, pose.heading_deg, moment)

        return look_up

    def _observed(self, observation: Observation, arrived: float) -> None:
        if self.mission is not None:
            self.mission.observed(observation, arrived)

    # ---- what the door shows -----------------------------------------------------------------------------

    async def submit(self, report: Report) -> Receipt:
        """A detector report from the door."""
        if self.mission is None:
            return Receipt(id=report.id, status="refused", reason="the service is still starting")
        return await self.intake.submit(report)

    async def order(self, command: str) -> str:
        """An operator's order from the door."""
        return State.WAITING.value if self.mission is None else await self.mission.order(command)

    def ready(self) -> bool:
        """True while a search can take reports."""
        return self.mission is not None and self.mission.state not in FINAL

    def state(self) -> dict[str, Any]:
        """Where the search stands."""
        mission, record = self.mission, self.search.record
        telemetry = (
            mission.vehicle.telemetry if mission and mission.vehicle.telemetry.position_known else None
        )
        place = self.search.place
        lat, lon = self.search.grid.frame.to_latlon(np.array([place.centroid]))[0]
        pose = None
        if telemetry is not None:
            pose = Pose(
                telemetry.lat,
                telemetry.lon,
                telemetry.alt_home_m,
                telemetry.heading_deg,
                telemetry.position_time,
            )
        flown = mission.flight_time() if mission else 0.0
        return {
            "state": mission.state if mission else State.WAITING,
            "area": self.area.name,
            "planner": self.settings.search.planner,
            "time": self.clock.now(),
            "speedup": self.clock.speedup,
            "pos": record.pos,
            "place": {"lat": float(lat), "lon": float(lon), "probability": place.probability},
            "outside": self.search.belief.outside,
            "steps": mission.flight.steps if mission else 0,
            "flight_time_s": flown,
            "flight_left_s": self._flight_left(flown, telemetry.battery_percent if telemetry else None),
            "battery_percent": telemetry.battery_percent if telemetry else None,
            "mode": telemetry.mode if telemetry else None,
            "reason": mission.reason.text if mission else "starting",
            "options": [
                {"action": action, "visits": visits, "value": value}
                for action, visits, value in (mission.reason.options if mission else ())
            ],
            "pose": vars(pose) if pose else None,
            "footprint": self._footprint(pose),
            "reports": {
                "accepted": self.intake.accepted if mission else 0,
                "refused": self.intake.refused if mission else 0,
            },
        }

    def _footprint(self, pose: Pose | None) -> dict[str, Any]:
        """The cells that a frame taken now shows, with their corners (north-west first, clockwise)."""
        if pose is None:
            return {"counts": False, "covered": 0.0, "cells": []}
        footprint, frame = self.sensor.footprint(pose), self.search.grid.frame
        corners = np.array([[-0.5, -0.5], [-0.5, 0.5], [0.5, 0.5], [0.5, -0.5]])
        cells = []
        for row, col in footprint.cells.tolist():
            points = frame.to_latlon(np.vstack([[[row, col]], np.array([row, col]) + corners])).tolist()
            centre, around = points[0], points[1:]
            cells.append({"row": row, "col": col, "lat": centre[0], "lon": centre[1], "corners": around})
        return {"counts": footprint.counts, "covered": footprint.covered, "cells": cells}

    def _flight_left(self, flown: float, battery: float | None) -> float | None:
        """Seconds until the battery reaches its limit at the consumption so far; None while unknown."""
        if battery is None or flown < 30.0 or battery >= 99.0:
            return None
        spare = battery - self.settings.flight.min_battery_percent
        left = max(0.0, spare * flown / (100.0 - battery))
        return min(left, max(0.0, self.settings.flight.max_flight_s - flown))

    def map(self) -> dict[str, Any]:
        """The belief and the probability of detection, cell by cell (null where nothing is searched)."""
        grid = self.search.grid
        searchable = grid.searchable

        def cells(values: Any) -> list[list[float | None]]:
            return [
                [float(v) if s else None for v, s in zip(row, inside, strict=True)]
                for row, inside in zip(values, searchable, strict=True)
            ]

        return {
            "frame": grid.frame.to_dict(),
            "corners": grid.frame.corners().tolist(),
            "probability": cells(self.search.belief.probability()),
            "pod": cells(self.search.record.pod()),
            "regions": self.search.regions.labels.tolist(),
            "outside": self.search.belief.outside,
        }

    def picture(self) -> bytes:
        """The map as a PNG."""
        state, mission = self.state(), self.mission
        pose = state["pose"]
        found = mission.found if mission else None
        title = f"{self.area.name}: {state['state']}"
        said = f"POS {state['pos']:.0%}, {state['steps']} steps, {state['flight_time_s']:.0f} s in the air"
        if found:
            said += f" · found at {found.lat:.6f}, {found.lon:.6f} with probability {found.probability:.4f}"
        return draw_scene(
            Scene(
                grid=self.search.grid,
                probability=self.search.belief.probability(),
                pod=self.search.record.pod(),
                labels=self.search.regions.labels,
                track=[(lat, lon) for _, lat, lon, _ in mission.flight.track] if mission else [],
                ahead=mission.ahead() if mission else [],
                hits=mission.flight.hits if mission else [],
                aircraft=(pose["lat"], pose["lon"]) if pose else None,
                found=(found.lat, found.lon) if found else None,
                title=title,
                subtitle=said,
            )
        )

    # ---- what is left behind -----------------------------------------------------------------------------

    def _report(self, began: float) -> dict[str, Any]:
        """The content of report.json."""
        mission = self.mission
        assert mission is not None
        found, flight = mission.found, mission.flight
        outcome = "found" if found else "not_found" if mission.state == State.DONE else "aborted"
        if mission.state == State.DONE and not found and not mission.searched:
            outcome = "aborted"
        place = self.search.place
        flown = mission.flight_time()
        report: dict[str, Any] = {
            "outcome": outcome,
            "position": {"lat": found.lat, "lon": found.lon} if found else None,
            "probability": found.probability if found else place.probability,
            "sigma_m": found.sigma_m if found else None,
            "outside": self.search.belief.outside,
            "steps": flight.steps,
            "flight_time_s": round(flown, 1),
            "pos": self.search.record.pos,
            "area": self.area.name,
            "planner": self.settings.search.planner,
            "seed": self.settings.run.seed,
            "stopped_because": mission.why_stopped or ("found" if found else ""),
            "cell_m": self.search.grid.frame.cell_m,
            "cells": int(self.search.grid.searchable.sum()),
            "looks": self.search.record.looks,
            "hits": len(flight.hits),
            "decisions": flight.decisions,
            "waypoints": flight.waypoints,
            "hit_to_waypoint": latency_summary(flight.latencies_s),
            "wall_time_s": round(time.time() - began, 1),
        }
        if self.world is not None:
            target = self.world.target
            error = None
            if target and found:
                metres = self.search.grid.frame.to_metres(np.array([target, (found.lat, found.lon)]))
                error = float(np.hypot(*(metres[1] - metres[0])))
            report["simulated"] = {
                "flavor": self.settings.demo.flavor,
                "speedup": self.clock.speedup,
                "target": {"lat": target[0], "lon": target[1]} if target else None,
                "error_m": error,
                "error_cells": None if error is None else error / self.search.grid.frame.cell_m,
            }
        return report

    def _write_results(self, report: dict[str, Any]) -> None:
        mission = self.mission
        assert mission is not None
        write_json(self.folder / "report.json", report)
        track = track_geojson(mission.flight.track, mission.flight.hits, report)
        (self.folder / "track.geojson").write_text(json.dumps(track), encoding="utf-8")
        (self.folder / "map.png").write_bytes(self.picture())
        if report["outcome"] == "found":
            position = report["position"]
            log.info(
                "FOUND at %.6f, %.6f with probability %.4f",
                position["lat"],
                position["lon"],
                report["probability"],
            )
        elif report["outcome"] == "not_found":
            log.info(
                "NOT FOUND: %s; best place %.1f %%, outside the area %.1f %%",
                report["stopped_because"],
                100 * report["probability"],
                100 * report["outside"],
            )
        else:
            log.info("ABORTED: %s", report["stopped_because"])
        simulated = report.get("simulated")
        if simulated and simulated["error_m"] is not None:
            error, cells = simulated["error_m"], simulated["error_cells"]
            log.info("the simulated target was %.1f m away (%.2f cells)", error, cells)
        log.info("report, track and map are in %s", self.folder)
