"""A run as the door and the display see it: its state, its map, and the way in for reports and orders."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from typing import Any

import numpy as np
from prometheus_client import CollectorRegistry, Gauge, Histogram

from service.area import SearchArea
from service.clock import Clock
from service.config import Settings
from service.evidence import Pose, finite_or_level
from service.intake import Intake
from service.mission import Mission
from service.reports import Receipt, Report
from service.search import Search
from service.sensors import Profile
from service.states import FINAL, State


class RunView:
    """What can be seen of a run; `mission` and `intake` are there once the link is open."""

    def __init__(
        self, area: SearchArea, search: Search, sensor: Profile, settings: Settings, clock: Clock
    ) -> None:
        self.area, self.search, self.sensor, self.settings, self.clock = area, search, sensor, settings, clock
        self.mission: Mission | None = None
        self.intake: Intake | None = None
        self.registry = CollectorRegistry()
        self.latency = Histogram(
            "roisearch_hit_to_waypoint_seconds",
            "From a report with a hit to the waypoint on the wire",
            registry=self.registry,
            buckets=(0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0),
        )
        for name, about, value in (
            ("roisearch_pos", "Probability of success so far", lambda: search.record.pos),
            ("roisearch_belief_entropy_bits", "Entropy of the belief", search.belief.entropy),
            ("roisearch_reports_accepted", "Detector reports taken in", lambda: self._reports()["accepted"]),
            ("roisearch_reports_refused", "Detector reports refused", lambda: self._reports()["refused"]),
            ("roisearch_tasks", "Tasks of the event loop", lambda: len(asyncio.all_tasks())),
        ):
            Gauge(name, about, registry=self.registry).set_function(value)

    async def submit_all(self, reports: Sequence[Report]) -> list[Receipt]:
        """Detector reports from a door."""
        if self.intake is None:
            why = "the service is still starting"
            return [Receipt(id=report.id, status="refused", reason=why) for report in reports]
        return await self.intake.submit_all(reports)

    async def order(self, command: str, place: tuple[float, float] | None = None) -> str:
        """An operator's order from the door."""
        return State.WAITING.value if self.mission is None else await self.mission.order(command, place)

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
                finite_or_level(telemetry.pitch_deg),
                finite_or_level(telemetry.roll_deg),
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
            "suspects": self.search.sightings.suspects(self.search.belief.probability()),
            "found": vars(mission.found) if mission and mission.found else None,
            "outside": self.search.belief.outside,
            "steps": mission.flight.steps if mission else 0,
            "flight_time_s": flown,
            "flight_left_s": self._flight_left(flown),
            "battery_percent": telemetry.battery_percent if telemetry else None,
            "mode": telemetry.mode if telemetry else None,
            "reason": mission.reason.text if mission else "starting",
            "options": [
                {"action": action, "visits": visits, "value": value}
                for action, visits, value in (mission.reason.options if mission else ())
            ],
            "pose": vars(pose) if pose else None,
            "footprint": self._footprint(pose),
            "reports": self._reports(),
        }

    def _reports(self) -> dict[str, int]:
        intake = self.intake
        return {"accepted": intake.accepted if intake else 0, "refused": intake.refused if intake else 0}

    def _footprint(self, pose: Pose | None) -> dict[str, Any]:
        """The cells that a frame taken now shows, with their corners (north-west first, clockwise), how much of each is
        covered, and what a look is worth there; p_tp and p_tn of the footprint are the settings'."""
        nominal = {"p_tp": self.settings.sensor.p_tp, "p_tn": self.settings.sensor.p_tn}
        if pose is None:
            return {"counts": False, "covered": 0.0, **nominal, "cells": []}
        footprint, frame = self.sensor.footprint(pose), self.search.grid.frame
        corners = np.array([[-0.5, -0.5], [-0.5, 0.5], [0.5, 0.5], [0.5, -0.5]])
        cells = []
        worth = (footprint.counts, footprint.covered, footprint.p_tp, footprint.p_tn)
        columns = [column.tolist() for column in (footprint.cells, *worth)]
        for (row, col), counts, covered, p_tp, p_tn in zip(*columns, strict=True):
            points = frame.to_latlon(np.vstack([[[row, col]], np.array([row, col]) + corners])).tolist()
            centre, around = points[0], points[1:]
            where = {"row": row, "col": col, "lat": centre[0], "lon": centre[1], "corners": around}
            cells.append({**where, "counts": counts, "covered": covered, "p_tp": p_tp, "p_tn": p_tn})
        best = float(footprint.covered.max(initial=0.0))
        return {"counts": bool(footprint.counts.any()), "covered": best, **nominal, "cells": cells}

    def _flight_left(self, flown: float) -> float | None:
        """Seconds until the way home must begin, for the battery or the time; None while unknown."""
        left = self.mission.homeward.energy.seconds_left(self.settings.flight) if self.mission else None
        return None if left is None else min(left, max(0.0, self.settings.flight.max_flight_s - flown))

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
