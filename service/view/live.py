"""A run as the door and the display see it: its state, its map, and the way in for reports and orders."""

from __future__ import annotations

import asyncio
import itertools
import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial

from prometheus_client import CollectorRegistry, Gauge, Histogram

from service.area import SearchArea
from service.clock import Clock
from service.config import ONLY, Settings
from service.errors import BadInput, shown
from service.evidence.counts import Counts
from service.evidence.observe import FramePose, finite_or_level
from service.evidence.reports import OrderReceipt, Receipt, Report
from service.evidence.sensors import Profile
from service.geometry import LatLon
from service.known import Withdrawn
from service.mavlink.modes import mode_title
from service.mavlink.telemetry import Telemetry
from service.mission.mission import Mission
from service.mission.situation import on_ground
from service.mission.states import State
from service.news.bearing import FieldNews
from service.news.request import NewsRequest, refuse_other
from service.search import Search
from service.squad import Squad
from service.view.base import BaseView, news_states, sortie_states
from service.view.curve import PosCurve
from service.view.estimate import Estimator, SearchingAircraft
from service.view.feed import Moment
from service.view.next import STATE_WORDS, NextState
from service.view.state import (
    AircraftState,
    BatteryState,
    DetectorState,
    EstimateState,
    HeardState,
    LinkState,
    ReportsState,
    RunState,
    WindState,
    known_deg,
    option_states,
    pose_state,
    reports_state,
    wind_state,
)

UNDER_WAY = (State.SEARCHING, State.CONFIRMING, State.HOLDING)
OF_EACH_AIRCRAFT: tuple[tuple[str, str, Callable[[Mission], float]], ...] = (
    (
        "roisearch_link_silent_seconds",
        "Time since the autopilot's last heartbeat",
        lambda mission: mission.clock.now() - mission.vehicle.telemetry.heartbeat_time,
    ),
    (
        "roisearch_link_up",
        "1 while the autopilot is heard",
        lambda mission: float(link_state(mission)["up"]),
    ),
    (
        "roisearch_link_quality",
        "Part of the autopilot's last messages that arrived",
        lambda mission: known_or_nan(mission.vehicle.received),
    ),
    (
        "roisearch_battery_percent",
        "State of charge as the autopilot tells it",
        lambda mission: known_or_nan(mission.vehicle.telemetry.battery_percent),
    ),
    ("roisearch_steps", "Cells flown", lambda mission: mission.flight.steps),
)
"""What is measured of each aircraft, under the label of its name."""
QUICK = (0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0)


class RunView(BaseView):
    """What can be seen of a run.

    The doors are open before the link is, so that a person sees what a service waits for: there is a view before there
    is a mission. That is one field, `squad`, None until `begin`, and nothing else changes then. An object that stands
    for 'no mission yet' would have to answer for twenty things of it, each of which is told plainly here beside what is
    told of a mission. Of several aircraft the one that is told is the first that has not ended, beside the list of all.
    """

    def __init__(
        self,
        area: SearchArea,
        search: Search,
        sensors: Mapping[str, Profile],
        settings: Settings,
        clock: Clock,
    ) -> None:
        super().__init__(area, search, sensors, settings)
        self.clock = clock
        self.squad: Squad | None = None
        self._hearing = asyncio.Lock()  # what is told twice in one moment counts once
        self.curve = PosCurve()
        self.estimator = Estimator(time.monotonic)
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
            ("roisearch_belief_entropy_bits", "Entropy of the belief", lambda: search.belief.entropy()),
            ("roisearch_reports_accepted", "Detector reports taken in", lambda: self._reports()["accepted"]),
            ("roisearch_reports_refused", "Detector reports refused", lambda: self._reports()["refused"]),
            ("roisearch_tasks", "Tasks of the event loop", lambda: len(asyncio.all_tasks())),
        ):
            Gauge(name, about, registry=self.registry).set_function(value)
        self._own = [
            (Gauge(name, about, ["aircraft"], registry=self.registry), value)
            for name, about, value in OF_EACH_AIRCRAFT
        ]

    def begin(self, squad: Squad) -> None:
        """The links are open, and there are missions to look at."""
        self.squad = squad
        for gauge, value in self._own:
            for name, mission in squad.missions.items():
                gauge.labels(name).set_function(partial(value, mission))

    @property
    def mission(self) -> Mission | None:
        """That of the only aircraft, or of the first that has not ended; None before there is one."""
        return None if self.squad is None else self.squad.leading

    async def submit_all(self, reports: Sequence[Report]) -> list[Receipt]:
        """Detector reports from a door."""
        if self.squad is None:
            why = "the service is still starting"
            return [Receipt(id=report.id, status="refused", reason=why) for report in reports]
        return await self.squad.submit_all(reports)

    async def order(
        self,
        command: str,
        place: tuple[float, float] | None = None,
        aircraft: str | None = None,
        system_id: int | None = None,
    ) -> OrderReceipt:
        """An operator's order from the door. Raises BadInput when there is no such aircraft."""
        if self.squad is None:
            return OrderReceipt(state=State.WAITING.value, refused="the service is still starting")
        return await self.squad.order(command, place, aircraft, system_id)

    async def hear(self, request: NewsRequest) -> HeardState:
        """News from a door; what comes again under its id changes nothing. Raises BadInput, JournalLost."""
        async with self._hearing:
            known = self.search.known
            own = (f"news-{number}" for number in itertools.count(known.heard + 1))
            name = request.id or next(each for each in own if known.heard_as(each) is None)
            news = await asyncio.to_thread(request.news, self.search.grid, name)
            if (before := known.heard_as(name)) is not None:
                refuse_other(news, before, stands=before in known.news)
                return {"id": name, "status": "duplicate", "cells": 0, "notes": []}
            notes = await self._heard(news)
            return {"id": name, "status": "accepted", "cells": len(news.cells), "notes": notes}

    async def withdraw(self, name: str) -> HeardState:
        """News are taken back. Raises BadInput, JournalLost."""
        async with self._hearing:
            standing = {news.id: len(news.cells) for news in self.search.known.news}
            if name not in standing:
                raise BadInput(
                    f"there is no news {shown(name)} that could be taken back; /api/state tells which stand"
                )
            notes = await self._heard(Withdrawn(name))
            return {"id": name, "status": "withdrawn", "cells": standing[name], "notes": notes}

    async def _heard(self, said: FieldNews | Withdrawn) -> list[str]:
        """Let all of them hear news; what there is to note of the ground that was not so before."""
        known = self.search.grid.layout_notes
        await self._begun().hear(said)
        return [note for note in self.search.grid.layout_notes if note not in known]

    def _begun(self) -> Squad:
        if self.squad is None:
            raise BadInput("the service is still starting; send it again in a moment")
        return self.squad

    def fingerprint(self) -> Callable[[], str]:
        """What works out the digest of the belief as it is now; it may be left to another thread."""
        return self.search.belief.copy().digest

    def ready(self) -> bool:
        """True while a search can take reports."""
        return self.squad is not None and not self.squad.ended

    def state(self) -> RunState:
        """Where the search stands."""
        mission, record = self.mission, self.search.record
        telemetry = (
            mission.vehicle.telemetry if mission and mission.vehicle.telemetry.position_known else None
        )
        pose = pose_of(mission)
        flown = mission.flight_time() if mission else 0.0
        found = self.squad.found if self.squad else None
        state = mission.state if mission else State.WAITING
        options = mission.reason.options if mission else ()
        return {
            "state": state,
            "words": STATE_WORDS[state],
            "why": mission.standing.why if mission else "",
            "orders": mission.orders() if mission else [],
            "next": self.next_of(mission),
            "choices": self.choices(options),
            "area": self.area.name,
            "planner": self.settings.search.planner,
            "time": self.clock.now(),
            "speedup": self.clock.speedup,
            "pos": record.pos,
            "place": self.place(),
            "unseen": self.unseen(),
            "suspects": self.suspects(),
            "outside": self.search.belief.outside,
            "steps": mission.flight.steps if mission else 0,
            "flight_time_s": flown,
            "sorties": sortie_states(mission.flight.sorties, mission.name or ONLY) if mission else [],
            "news": news_states(self.search.known.news),
            "flight_left_s": self._flight_left(),
            "battery_percent": telemetry.battery_percent if telemetry else None,
            "battery_doubt": (mission.core.battery_doubt if mission else "") or None,
            "battery": battery_state(telemetry) if telemetry else None,
            "mode": mode_title(telemetry.mode) if telemetry else None,
            "reason": mission.reason.text if mission else "starting",
            "options": option_states(options),
            "pose": pose_state(pose, self.settings.run.coordinates),
            "height_above_ground_m": self._above_ground(),
            "wind": self._wind(),
            "footprint": self.footprint(pose, mission.name if mission else ""),
            "reports": self._reports(),
            "link": self._link(),
            "detector": self._detector(),
            "ahead": mission.ahead() if mission else [],
            "regions": self.region_masses(),
            "drawn": self.drawn(),
            "found": self.found_state(found),
            "aircraft": [
                self._aircraft(name, number, each)
                for number, (name, each) in enumerate(self.squad.missions.items() if self.squad else ())
            ],
        }

    def next_of(self, mission: Mission | None) -> NextState:
        """What one of the aircraft does next; before there is one, what the search does."""
        if mission is None:
            return self.next(State.WAITING, ())
        down = on_ground(mission.vehicle.telemetry)
        return self.next(mission.state, mission.reason.options, mission.standing.causes, down=down)

    def _aircraft(self, name: str, number: int, mission: Mission) -> AircraftState:
        """One of the aircraft, as it is told."""
        t, pose = mission.vehicle.telemetry, pose_of(mission)
        return {
            "name": name,
            "colour": number,
            "state": mission.state,
            "words": STATE_WORDS[mission.state],
            "why": mission.standing.why,
            "orders": mission.orders(),
            "lat": pose.lat if pose else None,
            "lon": pose.lon if pose else None,
            "height": pose.height_m if pose else None,
            "heading_deg": known_deg(pose.heading_deg) if pose else None,
            "battery": t.battery_percent,
            "link": link_state(mission),
            "mode": mode_title(t.mode) if t.mode else None,
            "next": self.next_of(mission),
            "ahead": mission.ahead(),
            "steps": mission.flight.steps,
            "flight_time_s": mission.flight_time(),
            "sorties": sortie_states(mission.flight.sorties, name),
            "pose": pose_state(pose, self.settings.run.coordinates),
            "footprint": self.footprint(pose, mission.name),
        }

    def _above_ground(self) -> float | None:
        """Its height above the ground below it; None while it is not known."""
        if self.mission is None or not self.mission.vehicle.telemetry.position_known:
            return None
        height = self.mission.core.helm.heights.above_ground(self.mission.vehicle.telemetry)
        return height if math.isfinite(height) else None

    def _wind(self) -> WindState | None:
        """The wind; None while it is not known."""
        wind = self.mission.core.reserve.wind if self.mission else None
        return None if wind is None else wind_state(wind.north_mps, wind.east_mps)

    def tracks(self) -> list[list[LatLon]]:
        """Where each aircraft was, one position a second."""
        missions = self.squad.missions.values() if self.squad else ()
        return [[(lat, lon) for _, lat, lon, _ in each.flight.track] for each in missions]

    def hits(self) -> list[LatLon]:
        """Where the detectors reported the target: such lists only grow."""
        return self.squad.hits if self.squad else []

    def _reports(self) -> ReportsState:
        intake = self.mission.intake if self.mission else None
        counts = self.squad.counts() if self.squad else Counts()
        step = intake.moments.last_step if intake else ""
        return reports_state(counts, self.search.doubt(), step)

    def _link(self) -> LinkState:
        """Whether the autopilot is heard, how long ago, and how much of what it sends arrives."""
        if self.mission is None:
            return {"up": False, "silent_s": None, "received": None, "round_trip_s": None}
        return link_state(self.mission)

    def _detector(self) -> DetectorState:
        """How long ago the detector reported; `silent` when that is long enough to hover."""
        mission = self.mission
        intake = mission.intake if mission else None
        if mission is None or intake is None or not intake.accepted or not intake.last_at:
            return {"silent_s": None, "silent": False}
        age = max(0.0, self.clock.now() - intake.last_at)
        return {"silent_s": age, "silent": age > mission.core.settings.sensor.silent_after_s}

    def _flight_left(self) -> float | None:
        """Seconds until the way home must begin, for the battery or the time; None while unknown."""
        return flight_left_s(self.mission, self.clock.now()) if self.mission else None

    def moment(self) -> Moment:
        """What there is to see now, for the page."""
        seen = self.seen()
        estimate = self._estimate(seen.state["flight_time_s"])
        return replace(seen, state={**seen.state, "estimate": estimate}, curve=self.curve.points)

    def _estimate(self, flown: float) -> EstimateState | None:
        """When how much POS is to be expected; None while no aircraft is searching."""
        mission = self.mission
        if mission is None or self.squad is None:
            return None
        crew = [each for each in self.squad.missions.values() if each.state in UNDER_WAY]
        if not crew:
            return None
        since = self.clock.now() if self.squad.several else flown  # no flight of theirs is that of all
        forecast = self.estimator.latest(
            [SearchingAircraft(each.search, each.cell(), each.heading()) for each in crew], since
        )
        return None if forecast is None else forecast.to_goals(self.search.record.pos, since)


def known_or_nan(value: float | None) -> float:
    """A number that may be unknown, as a metric has it."""
    return math.nan if value is None else value


def flight_left_s(mission: Mission, now: float) -> float | None:
    """Seconds until an aircraft must begin its way home, for its battery or the time of this sortie; None while
    unknown."""
    flight = mission.core.settings.flight
    left = mission.energy.seconds_left(flight)
    return None if left is None else min(left, max(0.0, flight.max_flight_s - mission.flight.aloft_s(now)))


def pose_of(mission: Mission | None) -> FramePose | None:
    """Where an aircraft is, metres above the launch point of the search; None while that is not known.

    How high home lies over a ground file is not known before home is told: then it is as high as the launch point.
    """
    if mission is None or not mission.vehicle.telemetry.position_known:
        return None
    telemetry, home_m = mission.vehicle.telemetry, mission.core.helm.heights.home_m
    return FramePose(
        telemetry.lat,
        telemetry.lon,
        telemetry.alt_home_m + (home_m if math.isfinite(home_m) else 0.0),
        telemetry.heading_deg,
        telemetry.position_time,
        finite_or_level(telemetry.pitch_deg),
        finite_or_level(telemetry.roll_deg),
    )


def link_state(mission: Mission) -> LinkState:
    """Whether an autopilot is heard, how long ago, and how much of what it sends arrives."""
    telemetry = mission.vehicle.telemetry
    silent, round_trip = mission.clock.now() - telemetry.heartbeat_time, telemetry.round_trip_s
    return {
        "up": mission.heard(),
        "silent_s": silent if math.isfinite(silent) else None,
        "received": mission.vehicle.received,
        "round_trip_s": None if round_trip is None or math.isinf(round_trip) else round_trip,
    }


def battery_state(t: Telemetry) -> BatteryState:
    """What is told of the battery beside its level."""
    return {
        "voltage_v": t.battery_voltage_v,
        "current_a": t.battery_current_a,
        "consumed_mah": t.battery_consumed_mah,
    }
