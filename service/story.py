"""What a run has been so far, told by its journal alone: over all of its processes, those that were killed among them.

A search goes on after its process has ended, so how long it has flown, what it has decided and where it was is asked
of the rows, not of a process. Seconds count while rows come; what happened while no service was there, nobody knows.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Iterable
from dataclasses import dataclass, field

from service.area.frame import GridFrame
from service.entries import Entry, of_whom
from service.evidence.found import Found
from service.evidence.observe import FramePose
from service.geometry import Cell, LatLon
from service.mission.orders import FINISHED
from service.mission.states import FINAL, FLYING, Event, State
from service.rows import (
    ClockRow,
    CommandRow,
    DecisionRow,
    FlightRow,
    FoundRow,
    ModeRow,
    OrderRow,
    ReportRow,
    ResumedRow,
    SortieRow,
    TrackPoint,
    TransitionRow,
    VerdictRow,
)

TRACK_EVERY_S = 1.0
AWAY_S = 60.0  # a gap between rows that is longer is a service that was away
OF_ALL = (VerdictRow, ResumedRow, ClockRow)
"""Rows that are of no aircraft."""
IN_THE_AIR = frozenset(State) - {State.WAITING, State.READY, State.GROUNDED} - FINAL


@dataclass
class FlightSoFar:
    """What a run has been up to a row; its lists only grow, so a time is a length of each.

    Attributes:
        state, why, event: of the last transition; WAITING before the first.
        steps: cells of the search flown: as the rows tell it, and as the poses of reports show it beyond that.
        flown_s: seconds in the air, of all processes together.
        began: when it was in the air first; None before.
        waypoints, decisions, reports: how many.
        decision: the last one.
        mode: the autopilot's, as it was told last.
        pose: of the last report.
        track: (time, latitude, longitude, metres above launch), one a second.
        hits: where a detector saw the target: the centres of the cells.
        found: the place that counts as found, unless an operator has rejected it since.
        sorties: the flights that are over.
        stopped_by: the event that ended the searching, with its reason; None while it goes on.
    """

    state: State = State.WAITING
    why: str = ""
    event: Event | None = None
    steps: int = 0
    flown_s: float = 0.0
    began: float | None = None
    waypoints: int = 0
    decisions: int = 0
    reports: int = 0
    resumed: int = 0
    decision: DecisionRow | None = None
    mode: str | None = None
    pose: FramePose | None = None
    track: list[TrackPoint] = field(default_factory=list)
    hits: list[LatLon] = field(default_factory=list)
    found: Found | None = None
    sorties: tuple[SortieRow, ...] = ()
    stopped_by: tuple[Event, str] | None = None
    last_time: float | None = None
    """When the last row was written."""
    _in_the_air: bool = False
    _cell: Cell | None = None

    @property
    def over(self) -> bool:
        """Whether the run has ended, as far as its journal knows; a killed one has not."""
        return self.state in FINAL

    @property
    def searched(self) -> bool:
        """It ended because there was nothing more to gain, not by an order."""
        return self.stopped_by is not None and self.stopped_by[0] in (
            Event.SEARCHED,
            Event.ENERGY_LOW,
            Event.FINISH,
        )

    def take(self, entry: Entry, frame: GridFrame) -> None:
        """Go on by a row."""
        self._pass_time(entry.time)
        match entry.said:
            case TransitionRow() as said:
                self._change(said, entry.time)
            case ReportRow() as said:
                self._report(said, entry.time, frame)
            case DecisionRow() as said:
                self.decisions += 1
                self.decision = said
            case FlightRow() as said:
                self.flown_s, self.steps = said.seconds, said.steps
                for point in said.track:
                    self._track(point)
            case CommandRow(command="reposition"):
                self.waypoints += 1
            case ModeRow(mode=mode):
                self.mode = mode
            case SortieRow() as said:
                self.sorties = (*self.sorties, said)
            case FoundRow(found=found):
                self.found = found
            case VerdictRow(confirmed=False, cell=cell) if self.found is not None:
                where = frame.to_cells([(self.found.lat, self.found.lon)])[0]
                if max(abs(int(where[0]) - cell[0]), abs(int(where[1]) - cell[1])) <= 1:
                    self.found = None
            case OrderRow(command="return"):
                self._stop(Event.RETURN, "the operator asked to return")
            case OrderRow(command="finish"):
                self._stop(Event.FINISH, FINISHED)
            case OrderRow(command="abort"):
                self._stop(Event.ABORT, "the operator aborted the run")
            case ResumedRow():
                self.resumed += 1
                self._in_the_air, self._cell = False, None

    def _pass_time(self, now: float) -> None:
        if self._in_the_air and self.last_time is not None and 0.0 < now - self.last_time <= AWAY_S:
            self.flown_s += now - self.last_time
        self.last_time = now

    def _change(self, said: TransitionRow, now: float) -> None:
        self.state, self.why, self.event = said.after, said.reason, said.event
        self._in_the_air = said.after in IN_THE_AIR
        if self._in_the_air and self.began is None:
            self.began = now
        if said.after in FLYING or said.event == Event.RESUME:
            self.stopped_by = None
        elif said.after == State.RETURNING or said.after in FINAL:
            self._stop(said.event, said.reason)

    def _stop(self, event: Event, why: str) -> None:
        self.stopped_by = self.stopped_by or (event, why)

    def _report(self, said: ReportRow, now: float, frame: GridFrame) -> None:
        pose = said.pose
        self.reports += 1
        self.pose = pose
        if said.observation is not None and (seen := said.observation.speaking):
            self.hits += [(float(lat), float(lon)) for lat, lon in frame.to_latlon(seen)]
        if not math.isfinite(pose.lat + pose.lon + pose.height_m):
            return
        self._track((now, pose.lat, pose.lon, pose.height_m))
        self._step(pose, frame)

    def _track(self, point: TrackPoint) -> None:
        if not self.track or not -AWAY_S <= point[0] - self.track[-1][0] < TRACK_EVERY_S:
            self.track.append(point)

    def _step(self, pose: FramePose, frame: GridFrame) -> None:
        if self.state in FLYING:
            cells, inside = frame.locate([(pose.lat, pose.lon)])
            cell = (int(cells[0][0]), int(cells[0][1]))
            if inside[0] and cell != self._cell:
                self.steps += self._cell is not None
                self._cell = cell


def story(entries: Iterable[Entry], frame: GridFrame) -> FlightSoFar:
    """What the rows of a journal tell of its run, in their order."""
    so_far = FlightSoFar()
    for entry in entries:
        so_far.take(entry, frame)
    return so_far


class StoriesSoFar:
    """What the flights of all aircraft of a run have been up to a row, one story an aircraft.

    Args:
        names: of the aircraft, the first one first; a name that a row brings is added. Rows of a time when the first
            flew alone have no name.
    """

    def __init__(self, names: Iterable[str]) -> None:
        self.flights = {name: FlightSoFar() for name in names}
        self._first = next(iter(self.flights))
        self.hits: list[LatLon] = []
        """Where detectors saw the target, of all aircraft in their order; it only grows."""

    def take(self, entry: Entry, frame: GridFrame) -> None:
        """Go on by a row; what is of no aircraft is a part of every story."""
        if isinstance(entry.said, OF_ALL):
            for name in self.flights:
                self._go_on(name, entry, frame)
            return
        self._go_on(of_whom(entry.aircraft, self._first), entry, frame)

    def _go_on(self, name: str, entry: Entry, frame: GridFrame) -> None:
        """By a row that is a part of this story."""
        flight = self.flights[name] = copy.copy(self.flights.get(name) or FlightSoFar())
        before = len(flight.hits)
        flight.take(entry, frame)
        self.hits += flight.hits[before:]

    @property
    def leading(self) -> FlightSoFar:
        """That of the first that has been heard and has not ended, else of the first that has not; when all have, of
        the first that came home, or else of the first."""
        every = list(self.flights.values())
        left = [each for each in every if not each.over]
        heard = [each for each in left if each.state != State.WAITING]
        return next(iter([*heard, *left, *(each for each in every if each.state == State.DONE), *every]))

    @property
    def found(self) -> Found | None:
        """The place that counts as found."""
        return next((each.found for each in self.flights.values() if each.found is not None), None)
