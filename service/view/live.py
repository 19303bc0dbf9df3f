"""A run as the door and the display see it: its state, its map, and the way in for reports and orders."""

from __future__ import annotations

import asyncio
import math
import time
from collections.abc import Sequence
from typing import Any

from prometheus_client import CollectorRegistry, Gauge, Histogram

from service.area import SearchArea
from service.clock import Clock
from service.config import Settings
from service.evidence.intake import Intake
from service.evidence.observe import Pose, finite_or_level
from service.evidence.reports import Receipt, Report
from service.evidence.sensors import Profile
from service.journal import read_last
from service.mission.flight import LatLon
from service.mission.mission import Mission
from service.mission.states import FINAL, State
from service.search import Search
from service.view.base import BaseView
from service.view.curve import PosCurve
from service.view.estimate import Estimator
from service.view.feed import Moment

UNDER_WAY = (State.SEARCHING, State.CONFIRMING, State.HOLDING)
LEAST_STEPS = 20  # so many cells have to be flown for their pace to tell something
QUICK = (0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0)


class RunView(BaseView):
    """What can be seen of a run; `mission` and `intake` are there once the link is open."""

    def __init__(
        self, area: SearchArea, search: Search, sensor: Profile, settings: Settings, clock: Clock
    ) -> None:
        super().__init__(area, search, sensor, settings)
        self.clock = clock
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
        self.believed = Histogram(
            "roisearch_report_to_belief_seconds",
            "From the arrival of a report to its evidence in the journal and the belief",
            registry=self.registry,
            buckets=(0.002, 0.005, 0.01, 0.015, 0.02, 0.03, 0.04, 0.05, 0.075, 0.1, 0.2, 0.5, 1.0),
        )
        for name, about, value in (
            ("roisearch_pos", "Probability of success so far", lambda: search.record.pos),
            ("roisearch_belief_entropy_bits", "Entropy of the belief", search.belief.entropy),
            ("roisearch_reports_accepted", "Detector reports taken in", lambda: self._reports()["accepted"]),
            ("roisearch_reports_refused", "Detector reports refused", lambda: self._reports()["refused"]),
            ("roisearch_link_silent_seconds", "Time since the autopilot's last heartbeat", self._link_age),
            ("roisearch_link_up", "1 while the autopilot is heard", lambda: float(self._link()["up"])),
            (
                "roisearch_link_quality",
                "Part of the autopilot's last messages that arrived",
                self._link_quality,
            ),
            ("roisearch_battery_percent", "State of charge as the autopilot tells it", self._battery),
            ("roisearch_steps", "Cells flown", lambda: self.mission.flight.steps if self.mission else 0),
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
        pose = None
        if telemetry is not None:
            pose = Pose(
                telemetry.lat,
                telemetry.lon,
                telemetry.alt_home_m,
                telemetry.heading_deg if math.isfinite(telemetry.heading_deg) else 0.0,
                telemetry.position_time,
                finite_or_level(telemetry.pitch_deg),
                finite_or_level(telemetry.roll_deg),
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
            "place": self.place(),
            "suspects": self.search.sightings.suspects(self.search.belief.probability()),
            "outside": self.search.belief.outside,
            "steps": mission.flight.steps if mission else 0,
            "flight_time_s": flown,
            "flight_left_s": self._flight_left(flown),
            "battery_percent": telemetry.battery_percent if telemetry else None,
            "mode": telemetry.mode if telemetry else None,
            "reason": mission.reason.text if mission else "starting",
            "options": mission.reason.rows() if mission else [],
            "pose": vars(pose) if pose else None,
            "footprint": self.footprint(pose),
            "reports": self._reports(),
            "link": self._link(),
            "detector": self._detector(),
            "ahead": mission.ahead() if mission else [],
            "regions": self.region_masses(),
            "found": vars(found) if found else None,
        }

    def track(self) -> list[LatLon]:
        """Where the aircraft was, one position a second."""
        return [(lat, lon) for _, lat, lon, _ in self.mission.flight.track] if self.mission else []

    def hits(self) -> list[LatLon]:
        """Where the detector reported the target."""
        return self.mission.flight.hits if self.mission else []

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

    def _flight_left(self, flown: float) -> float | None:
        """Seconds until the way home must begin, for the battery or the time; None while unknown."""
        left = self.mission.homeward.energy.seconds_left(self.settings.flight) if self.mission else None
        return None if left is None else min(left, max(0.0, self.settings.flight.max_flight_s - flown))

    def decisions(self, count: int) -> list[dict[str, Any]]:
        """The last decisions with their reasons and options, the newest first, from the journal."""
        if self.mission is None:
            return []
        rows = read_last(self.mission.journal.path, "decision", count)
        return [{"time": row.time, **row.body} for row in rows]

    async def moment_at(self, at: float) -> Moment:
        """A live run only knows now."""
        return self.moment()

    def moment(self) -> Moment:
        """What there is to see now, for the page."""
        search, state = self.search, self.state()
        state["estimate"] = self._estimate(state["flight_time_s"])
        return Moment(
            state=state,
            weights=search.belief.weights,
            total=search.belief.total,
            pod=search.record.pod(),
            track=self.track(),
            hits=self.hits(),
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
