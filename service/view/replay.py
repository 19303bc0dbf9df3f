"""A run that is over, at any of its times: the same page and the same answers, from its journal."""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from prometheus_client import CollectorRegistry

from service.config import ONLY, each_aircraft
from service.drawing import Drawing
from service.entries import understanding
from service.evidence.counts import Counts
from service.evidence.cover import sensors_over
from service.evidence.found import Found
from service.evidence.images import Images
from service.geometry import LatLon
from service.known import Known
from service.mavlink.modes import mode_title
from service.mission.states import FLYING
from service.resume import retrace, stored_run
from service.rows import DecisionRow, ReportRow
from service.search import Search
from service.story import FlightSoFar, StoriesSoFar
from service.survey import JOURNAL
from service.view.base import BaseView, news_states, sortie_states
from service.view.curve import PosCurve
from service.view.feed import Moment
from service.view.next import STATE_WORDS
from service.view.state import AircraftState, RunState, known_deg, option_states, pose_state, reports_state

KEPT = 32  # copies of the belief along the run, to go back to
AFTER_RESTART_S = 0.1


@dataclass(frozen=True)
class _Told:
    """What the journal has told up to a row, by the names of aircraft; lists only grow, so a time is a length of each.
    `tracks` has that of each flight."""

    flights: dict[str, FlightSoFar]
    leading: FlightSoFar
    found: Found | None
    tracks: tuple[int, ...]
    hits: int
    curve: int


@dataclass(frozen=True)
class _Kept:
    """The search before a row."""

    row: int
    known: Known
    drawing: Drawing


class ReplayView(BaseView):
    """A run's folder, looked at; it is set to a time by `seek` and stands at the end at first.

    Raises:
        BadInput: the folder holds no run, or its journal is of another grid than its area file makes.
    """

    def __init__(self, folder: Path) -> None:
        settings, area, grid, self.rows = stored_run(folder)
        search = Search(grid, settings)
        super().__init__(area, search, sensors_over(grid, settings), settings)
        self.images = Images(folder)
        self.registry = CollectorRegistry()
        self.times = monotone([row.time for row in self.rows])
        self._curve = PosCurve()
        self._told: list[_Told] = []
        self._hits: list[LatLon] = []
        self._kept: list[_Kept] = []
        self._read(folder / JOURNAL)
        self._at = len(self.rows)

    # ---- time

    def span(self) -> tuple[float, float]:
        """Its first and last time, seconds since the epoch."""
        return self.times[0], self.times[-1]

    def at(self, time: float) -> ReplayView:
        """This view, set to a time."""
        self.seek(time)
        return self

    def seek(self, time: float) -> None:
        """Show the run as it was at a time."""
        goal = max(1, bisect_right(self.times, time))
        if goal < self._at:
            kept = self._kept[bisect_right(self._kept, goal, key=lambda each: each.row) - 1]
            self.search.go_back(kept.known.copy())
            self.search.take_drawing(kept.drawing)
            self._at = kept.row
        for entry in self.rows[self._at : goal]:
            retrace(entry, self.search)
        self._at = goal

    def _read(self, journal: Path) -> None:
        """Go through the journal once: what was told after each row, and copies of the belief now and then."""
        every, frame = max(1, len(self.rows) // KEPT), self.search.grid.frame
        stories = StoriesSoFar(each_aircraft(self.settings))
        for number, (entry, time) in enumerate(zip(self.rows, self.times, strict=True)):
            if number % every == 0:
                self._kept.append(_Kept(number, self.search.known.copy(), self.search.drawing))
            with understanding(journal, entry.seq, entry.said.kind):
                retrace(entry, self.search)
                stories.take(replace(entry, time=time), frame)
            if isinstance(entry.said, ReportRow) and entry.said.observation is not None:
                self._curve.add(time, self.search.record.pos)
            tracks = tuple(len(each.track) for each in stories.flights.values())
            lengths = tracks, len(stories.hits), len(self._curve.points)
            self._told.append(_Told(dict(stories.flights), stories.leading, stories.found, *lengths))
        self._hits = stories.hits

    # ---- what there is to see

    def state(self) -> RunState:
        """Where the search stood; what a journal does not hold is None."""
        told, now = self._told[self._at - 1], self.times[self._at - 1]
        flight = told.leading
        flying = next(name for name, each in told.flights.items() if each is flight)
        decision, pose = flight.decision, flight.pose
        return {
            "state": flight.state,
            "words": STATE_WORDS[flight.state],
            "why": flight.why,
            "orders": [],
            "next": self.next(flight.state, () if decision is None else decision.options),
            "choices": self.choices(() if decision is None else decision.options),
            "area": self.area.name,
            "planner": self.settings.search.planner,
            "time": now,
            "speedup": 1.0,
            "pos": self.search.record.pos,
            "place": self.place(),
            "unseen": self.unseen(),
            "suspects": self.suspects(),
            "outside": self.search.belief.outside,
            "steps": flight.steps,
            "flight_time_s": flight.flown_s,
            "sorties": sortie_states(flight.sorties, flying or ONLY),
            "news": news_states(self.search.known.news),
            "flight_left_s": None,
            "battery_percent": None,
            "battery_doubt": None,
            "battery": None,
            "mode": flight.mode and mode_title(flight.mode),
            "reason": "starting" if decision is None else decision.reason,
            "options": option_states(() if decision is None else decision.options),
            "pose": pose_state(pose, self.settings.run.coordinates),
            "height_above_ground_m": self.above_ground(pose),
            "wind": None,
            "footprint": self.footprint(pose, flying),
            "reports": reports_state(Counts(accepted=sum(each.reports for each in told.flights.values()))),
            "link": None,
            "detector": None,
            "ahead": self._ahead(flight),
            "regions": self.region_masses(),
            "drawn": self.drawn(),
            "found": self.found_state(told.found),
            "aircraft": [
                self._aircraft(name, number, each) for number, (name, each) in enumerate(told.flights.items())
            ],
        }

    def _ahead(self, flight: FlightSoFar) -> list[LatLon]:
        """Where an aircraft was going to."""
        decision, pose = flight.decision, flight.pose
        if flight.state not in FLYING or decision is None or not decision.path:
            return []
        cells = self.search.grid.frame.to_latlon(np.array(decision.path))
        ahead = [(float(lat), float(lon)) for lat, lon in cells]
        return ahead if pose is None else [(pose.lat, pose.lon), *ahead]

    def _aircraft(self, name: str, number: int, flight: FlightSoFar) -> AircraftState:
        """One of the aircraft, as it was when it last reported."""
        pose = flight.pose
        return {
            "name": name or ONLY,
            "colour": number,
            "state": flight.state,
            "words": STATE_WORDS[flight.state],
            "why": flight.why,
            "orders": [],
            "lat": pose.lat if pose else None,
            "lon": pose.lon if pose else None,
            "height": pose.height_m if pose else None,
            "heading_deg": known_deg(pose.heading_deg) if pose else None,
            "battery": None,
            "link": None,
            "mode": flight.mode and mode_title(flight.mode),
            "next": self.next(flight.state, () if flight.decision is None else flight.decision.options),
            "ahead": self._ahead(flight),
            "steps": flight.steps,
            "flight_time_s": flight.flown_s,
            "sorties": sortie_states(flight.sorties, name or ONLY),
            "pose": pose_state(pose, self.settings.run.coordinates),
            "footprint": self.footprint(pose, name),
        }

    def tracks(self) -> list[list[LatLon]]:
        """Where each aircraft was when it reported, one position a second."""
        told = self._told[self._at - 1]
        return [
            [(lat, lon) for _, lat, lon, _ in flight.track[:length]]
            for flight, length in zip(told.flights.values(), told.tracks, strict=True)
        ]

    def hits(self) -> list[LatLon]:
        """Where the detector reported the target."""
        return self._hits[: self._told[self._at - 1].hits]

    def moment(self) -> Moment:
        """What there was to see at the time that is set."""
        curve = self._curve.points[: self._told[self._at - 1].curve]
        return replace(self.seen(), curve=curve)

    def decisions(self, count: int) -> list[dict[str, Any]]:
        """The last decisions until the time, the newest first."""
        made = [
            {"time": time, **entry.said.body()}
            for entry, time in zip(self.rows[: self._at], self.times, strict=False)
            if isinstance(entry.said, DecisionRow)
        ]
        return made[::-1][:count]


def monotone(times: list[float]) -> list[float]:
    """Times that never go back: after a restart whose clock is behind, everything is moved on."""
    shift, shown = 0.0, times[:1]
    for time in times[1:]:
        if time + shift < shown[-1] - 1.0:
            shift = shown[-1] + AFTER_RESTART_S - time
        shown.append(max(shown[-1], time + shift))
    return shown
