"""A run as the door and the display see it: its state, its map, and the way in for reports and orders."""

from __future__ import annotations

import math
import time
from typing import Any

import numpy as np
from numpy.typing import NDArray
from prometheus_client import CollectorRegistry, Gauge, Histogram

from service.area import SearchArea
from service.clock import Clock
from service.config import Settings
from service.curve import PosCurve
from service.estimate import Estimator
from service.evidence import Pose, Sensor
from service.feed import Moment
from service.intake import Intake
from service.journal import read_last
from service.mission import Mission
from service.reports import Receipt, Report
from service.scene import describe
from service.search import Search
from service.shapes import area_features, cell_features, collection, feature, line, point, region_features
from service.states import FINAL, State

UNDER_WAY = (State.SEARCHING, State.CONFIRMING, State.HOLDING)
LEAST_STEPS = 20  # so many cells have to be flown for their pace to tell something
QUICK = (0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0)


class RunView:
    """What can be seen of a run; `mission` and `intake` are there once the link is open."""

    def __init__(
        self, area: SearchArea, search: Search, sensor: Sensor, settings: Settings, clock: Clock
    ) -> None:
        self.area, self.search, self.sensor, self.settings, self.clock = area, search, sensor, settings, clock
        self.mission: Mission | None = None
        self.intake: Intake | None = None
        self.curve = PosCurve()
        self.estimator = Estimator(search, time.monotonic)
        self.registry = CollectorRegistry()
        self.latency = Histogram(
            "roisearch_hit_to_waypoint_seconds",
            "From a report with a hit to the waypoint on the wire",
            registry=self.registry,
            buckets=QUICK,
        )
        self.thinking = Histogram(
            "roisearch_step_seconds", "What a decision took", registry=self.registry, buckets=QUICK
        )
        for name, about, value in (
            ("roisearch_pos", "Probability of success so far", lambda: search.record.pos),
            ("roisearch_belief_entropy_bits", "Entropy of the belief", search.belief.entropy),
            ("roisearch_reports_accepted", "Detector reports taken in", lambda: self._reports()["accepted"]),
            ("roisearch_reports_refused", "Detector reports refused", lambda: self._reports()["refused"]),
            ("roisearch_link_silent_seconds", "Time since the autopilot's last heartbeat", self._link_age),
            ("roisearch_link_up", "1 while the autopilot is heard", lambda: float(self._link()["up"])),
            ("roisearch_link_quality", "Part of the last heartbeats that came in time", self._link_quality),
            ("roisearch_battery_percent", "State of charge as the autopilot tells it", self._battery),
            ("roisearch_steps", "Cells flown", lambda: self.mission.flight.steps if self.mission else 0),
        ):
            Gauge(name, about, registry=self.registry).set_function(value)
        self._outlines = region_features(search.grid, search.regions.labels)

    async def submit(self, report: Report) -> Receipt:
        """A detector report from the door."""
        if self.intake is None:
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
                telemetry.heading_deg if math.isfinite(telemetry.heading_deg) else 0.0,
                telemetry.position_time,
            )
        flown = mission.flight_time() if mission else 0.0
        found = mission.found if mission else None
        return {
            "state": mission.state if mission else State.WAITING,
            "why": mission.why_here if mission else "",
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
            "options": mission.reason.rows() if mission else [],
            "pose": vars(pose) if pose else None,
            "footprint": self._footprint(pose),
            "reports": self._reports(),
            "link": self._link(),
            "detector": self._detector(),
            "ahead": mission.ahead() if mission else [],
            "regions": self._region_masses(),
            "found": vars(found) if found else None,
        }

    def _reports(self) -> dict[str, int]:
        intake = self.intake
        return {"accepted": intake.accepted if intake else 0, "refused": intake.refused if intake else 0}

    def _link(self) -> dict[str, Any]:
        """Whether the autopilot is heard, how long ago, and how much of what it sends arrives."""
        if self.mission is None:
            return {"up": False, "silent_s": None, "received": None}
        silent = self._link_age()
        return {
            "up": self.mission.helm.heard(),
            "silent_s": silent if math.isfinite(silent) else None,
            "received": self.mission.vehicle.received,
        }

    def _detector(self) -> dict[str, Any]:
        """How long ago the detector reported; `silent` when that is long enough to hover."""
        intake = self.intake
        if intake is None or not intake.accepted or not intake.last_at:
            return {"silent_s": None, "silent": False}
        age = max(0.0, self.clock.now() - intake.last_at)
        return {"silent_s": age, "silent": age > self.settings.sensor.silent_after_s}

    def _link_age(self) -> float:
        mission = self.mission
        return self.clock.now() - mission.vehicle.telemetry.heartbeat_time if mission else math.inf

    def _link_quality(self) -> float:
        received = self.mission.vehicle.received if self.mission else None
        return math.nan if received is None else received

    def _battery(self) -> float:
        percent = self.mission.vehicle.telemetry.battery_percent if self.mission else None
        return math.nan if percent is None else percent

    def _region_masses(self) -> list[float]:
        """The probability of each region of interest now, region 1 first."""
        regions = self.search.regions
        weights = self.search.belief.weights / self.search.belief.total
        sums = np.bincount(regions.labels.ravel(), weights, minlength=regions.count + 1)
        return [float(mass) for mass in sums[1:]]

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
            "digest": self.search.belief.digest(),
            "reports": self._reports()["accepted"],
        }

    def geojson(self) -> dict[str, Any]:
        """The map for other programs: area, regions with their mass, cells, track, hits, the place found."""
        grid, state = self.search.grid, self.state()
        features = area_features(self.area, grid)
        for outline in self._outlines:
            number = outline["properties"]["number"]
            mass = state["regions"][number - 1]
            features.append(feature(outline["geometry"], "region", number=number, mass=mass))
        features += cell_features(grid, self.search.belief.probability(), self.search.record.pod())
        track = self.mission.flight.track if self.mission else []
        if len(track) > 1:
            features.append(feature(line([row[1:3] for row in track]), "track"))
        features += [
            feature(point(*hit), "hit") for hit in (self.mission.flight.hits if self.mission else [])
        ]
        if state["found"]:
            found = state["found"]
            features.append(
                feature(point(found["lat"], found["lon"]), "found", probability=found["probability"])
            )
        return collection(features, pos=state["pos"], outside=state["outside"], time=state["time"])

    def decisions(self, count: int) -> list[dict[str, Any]]:
        """The last decisions with their reasons and options, the newest first, from the journal."""
        if self.mission is None:
            return []
        rows = read_last(self.mission.journal.path, "decision", count)
        return [{"time": row.time, **row.body} for row in rows]

    def scene(self) -> dict[str, Any]:
        """What does not change during a run, for the page."""
        return describe(self.area, self.search, self._outlines)

    def searchable(self) -> NDArray[np.bool_]:
        """The cells that are searched, [rows, cols]."""
        return self.search.grid.searchable

    async def moment_at(self, at: float) -> Moment:
        """A live run only knows now."""
        return self.moment()

    def moment(self) -> Moment:
        """What there is to see now, for the page."""
        mission, search = self.mission, self.search
        state = self.state()
        state["estimate"] = self._estimate(state["flight_time_s"])
        return Moment(
            state=state,
            weights=search.belief.weights,
            total=search.belief.total,
            pod=search.record.pod(),
            track=[row[1:3] for row in mission.flight.track] if mission else [],
            hits=mission.flight.hits if mission else [],
            curve=self.curve.points,
        )

    def _estimate(self, flown: float) -> dict[str, Any] | None:
        """When how much POS is to be expected; None while the aircraft is not searching."""
        mission = self.mission
        if mission is None or mission.state not in UNDER_WAY:
            return None
        forecast = self.estimator.latest(mission.helm.cell()[0], mission.helm.heading(), flown)
        if forecast is None:
            return None
        steps, flight = mission.flight.steps, self.settings.flight
        usual = self.search.grid.frame.cell_m / flight.speed_mps
        pace = flown / steps if steps >= LEAST_STEPS else usual
        return forecast.to_goals(self.search.record.pos, flown, pace)

    def picture(self) -> bytes:
        """The map as a PNG."""
        from service.picture import Scene, draw_scene  # matplotlib: not before somebody looks

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
