"""A run that is over, at any of its times: the same page and the same answers, from its journal."""

from __future__ import annotations

import copy
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from prometheus_client import CollectorRegistry

from roisearch import Belief
from roisearch.detection import DetectionRecord
from service.evidence.observe import Observation, Pose
from service.evidence.reports import Receipt, Report
from service.evidence.sensors import make_sensor
from service.evidence.suspects import Sightings
from service.journal import Row
from service.mission.flight import LatLon
from service.mission.states import FINAL, FLYING, State
from service.resume import retrace, stored_run
from service.search import Search
from service.view.base import BaseView
from service.view.curve import PosCurve
from service.view.feed import Moment

KEPT = 32  # copies of the belief along the run, to go back to
TRACK_EVERY_S = 1.0
AFTER_RESTART_S = 0.1


@dataclass
class _Told:
    """What the journal has told up to a row; the lists only grow, so a time is a length of each."""

    state: str = State.WAITING.value
    why: str = ""
    mode: str | None = None
    reason: str = "starting"
    options: list[dict[str, Any]] = field(default_factory=list)
    path: list[list[int]] = field(default_factory=list)
    found: dict[str, Any] | None = None
    pose: Pose | None = None
    reports: int = 0
    decisions: int = 0
    began: float | None = None
    ended: float | None = None
    track: int = 0
    hits: int = 0
    curve: int = 1


@dataclass(frozen=True)
class _Kept:
    """The search before a row."""

    row: int
    belief: Belief
    record: DetectionRecord
    sightings: Sightings


class ReplayView(BaseView):
    """A run's folder, looked at; it is set to a time by `seek` and stands at the end at first.

    Raises:
        BadInput: the folder holds no run, or its journal is of another grid than its area file makes.
    """

    def __init__(self, folder: Path) -> None:
        settings, area, grid, self.rows = stored_run(folder)
        search = Search(grid, settings)
        super().__init__(area, search, make_sensor(settings, grid), settings)
        self.registry = CollectorRegistry()
        self.times = monotone([row.time for row in self.rows])
        self._track: list[LatLon] = []
        self._hits: list[LatLon] = []
        self._curve = PosCurve()
        self._told: list[_Told] = []
        self._kept: list[_Kept] = []
        self._read()
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
            self.search.go_back(kept.belief.copy(), copy.deepcopy(kept.record), copy.deepcopy(kept.sightings))
            self._at = kept.row
        for row in self.rows[self._at : goal]:
            retrace(row, self.search)
        self._at = goal

    def _read(self) -> None:
        """Go through the journal once: what was told after each row, and copies of the belief now and then."""
        every = max(1, len(self.rows) // KEPT)
        told, tracked = _Told(), -np.inf
        for number, (row, time) in enumerate(zip(self.rows, self.times, strict=True)):
            if number % every == 0:
                belief, record, sightings = self.search.belief, self.search.record, self.search.sightings
                self._kept.append(
                    _Kept(number, belief.copy(), copy.deepcopy(record), copy.deepcopy(sightings))
                )
            retrace(row, self.search)
            told = copy.copy(told)
            if row.kind == "report":
                if time - tracked >= TRACK_EVERY_S:
                    self._track.append((row.body["pose"][0], row.body["pose"][1]))
                    tracked = time
                self._take_report(told, row, time)
            else:
                take(told, row, time)
            told.track, told.hits, told.curve = len(self._track), len(self._hits), len(self._curve.points)
            self._told.append(told)

    def _take_report(self, told: _Told, row: Row, time: float) -> None:
        told.reports += 1
        lat, lon, height_m, heading_deg = row.body["pose"][:4]
        told.pose = Pose(lat, lon, height_m, heading_deg, time)
        if row.body["observation"] is None:
            return
        observation = Observation.from_dict(row.body["observation"])
        places = self.search.grid.frame.to_latlon(observation.cells[observation.hits])
        self._hits += [(float(lat), float(lon)) for lat, lon in places]
        self._curve.add(time, self.search.record.pos)

    # ---- what there is to see

    def state(self) -> dict[str, Any]:
        """Where the search stood; what a journal does not hold is None."""
        told, now, frame = self._told[self._at - 1], self.times[self._at - 1], self.search.grid.frame
        flown = 0.0 if told.began is None else (told.ended or now) - told.began
        ahead: list[LatLon] = []
        if told.state in FLYING and told.path:
            ahead = [(float(lat), float(lon)) for lat, lon in frame.to_latlon(np.array(told.path))]
        return {
            "state": told.state,
            "why": told.why,
            "area": self.area.name,
            "planner": self.settings.search.planner,
            "time": now,
            "speedup": 1.0,
            "pos": self.search.record.pos,
            "place": self.place(),
            "suspects": self.search.sightings.suspects(self.search.belief.probability()),
            "outside": self.search.belief.outside,
            "steps": told.decisions,
            "flight_time_s": flown,
            "flight_left_s": None,
            "battery_percent": None,
            "mode": told.mode,
            "reason": told.reason,
            "options": told.options,
            "pose": vars(told.pose) if told.pose else None,
            "footprint": self.footprint(told.pose if told.state in FLYING else None),
            "reports": {"accepted": told.reports, "refused": 0},
            "link": None,
            "detector": None,
            "ahead": ahead,
            "regions": self.region_masses(),
            "found": told.found,
        }

    def track(self) -> list[LatLon]:
        """Where the aircraft was when it reported, one position a second."""
        return self._track[: self._told[self._at - 1].track]

    def hits(self) -> list[LatLon]:
        """Where the detector reported the target."""
        return self._hits[: self._told[self._at - 1].hits]

    def moment(self) -> Moment:
        """What there was to see at the end."""
        return self._moment(self.times[-1])

    async def moment_at(self, at: float) -> Moment:
        """What there was to see at a time."""
        return self._moment(at)

    def _moment(self, time: float) -> Moment:
        self.seek(time)
        return Moment(
            state=self.state(),
            weights=self.search.belief.weights,
            total=self.search.belief.total,
            pod=self.search.record.pod(),
            track=self.track(),
            hits=self.hits(),
            curve=self._curve.points[: self._told[self._at - 1].curve],
        )

    def decisions(self, count: int) -> list[dict[str, Any]]:
        """The last decisions until the time, the newest first."""
        made = [
            {"time": time, **row.body}
            for row, time in zip(self.rows[: self._at], self.times, strict=False)
            if row.kind == "decision"
        ]
        return made[::-1][:count]

    # ---- what a replay does not do

    def ready(self) -> bool:
        """A replay takes no reports."""
        return False

    async def submit_all(self, reports: Sequence[Report]) -> list[Receipt]:
        """A replay takes no reports."""
        return [Receipt(id=each.id, status="refused", reason="this is a replay") for each in reports]

    async def order(self, command: str, place: LatLon | None = None) -> str:
        """A replay takes no orders."""
        return self._told[-1].state


def take(told: _Told, row: Row, time: float) -> None:
    """Take in a row that is not a report."""
    body = row.body
    if row.kind == "transition":
        told.state, told.why = body["to"], body["reason"]
        if told.began is None and told.state in (State.TAKEOFF, *FLYING):
            told.began = time
        told.ended = time if told.state in FINAL else None
    elif row.kind == "decision":
        told.decisions += 1
        told.reason, told.path = body["reason"], body["path"]
        told.options = body.get("options", [])
    elif row.kind == "mode":
        told.mode = body["mode"]
    elif row.kind == "found":
        told.found = body


def monotone(times: list[float]) -> list[float]:
    """Times that never go back: after a restart whose clock is behind, everything is moved on."""
    shift, shown = 0.0, times[:1]
    for time in times[1:]:
        if time + shift < shown[-1] - 1.0:
            shift = shown[-1] + AFTER_RESTART_S - time
        shown.append(max(shown[-1], time + shift))
    return shown
