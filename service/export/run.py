"""A run as plain values, read from its folder: from the journal, which another process may be writing.

The journal alone is enough, so a run that is under way or that was killed is read like one that has ended. Its rows
are read in one go, as they are at that moment, and the belief is replayed from them exactly as a resumed search does.
`track.geojson`, which a run leaves at its end, is not needed: every report was journalled with the aircraft's pose.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from roisearch import Belief
from service.area import Grid, SearchArea
from service.area.frame import GridFrame
from service.config import Settings
from service.errors import BadInput
from service.evidence.observe import Observation
from service.evidence.suspects import IN_95_PERCENT
from service.evidence.verdict import ROW as VERDICT
from service.journal import Row
from service.mission.flight import LatLon
from service.mission.states import FINAL, Event, State
from service.resume import retrace, stored_run
from service.search import Search
from service.survey import JOURNAL
from service.view.curve import PosCurve

BREAK_S = 60.0
"""A track is broken where nothing was heard of the aircraft for so long."""


@dataclass(frozen=True)
class Fix:
    """Where the aircraft was: time, degrees, metres above launch, nose in degrees from true north."""

    time: float
    lat: float
    lon: float
    height_m: float
    heading_deg: float


@dataclass(frozen=True)
class Detection:
    """What a detector reported at a place (degrees); `counted`: the frame put a hit into the map."""

    time: float
    lat: float
    lon: float
    kind: str
    score: float
    source: str
    counted: bool


@dataclass(frozen=True)
class Find:
    """The place at which the search counted its target as found; `sigma_m` metres along the longest axis.

    `ellipse` holds the target with 95 %: semi-axes in metres, and the bearing of the long one in degrees from true
    north; a circle of that size for a journal that tells no more than sigma.
    """

    time: float
    lat: float
    lon: float
    probability: float
    sigma_m: float
    ellipse: tuple[float, float, float]


@dataclass(frozen=True)
class Moment:
    """Something that happened, for the timeline: what kind of thing, and in words."""

    time: float
    kind: str
    text: str


@dataclass(frozen=True, eq=False)
class Run:
    """One run. Arrays are [rows, cols]; times in the service's clock, seconds since the epoch.

    Attributes:
        name: of its folder.
        belief: after all that was reported.
        pod: cumulative probability of detection, cell by cell.
        labels: regions of interest, 0 for none.
        pos: probability of success so far; `curve` is (seconds of searching, pos).
        track: the flight in unbroken pieces.
        hits: centres of the cells that had a hit, in order.
        autopilot: "px4" or "ardupilot", as it said when it was linked; empty before.
        launch_amsl_m: how high the launch point is above sea level; None before the first waypoint.
        state: the mission's last state; `over` is True when it can have no other.
    """

    name: str
    area: SearchArea
    grid: Grid
    settings: Settings
    belief: Belief
    pod: NDArray[np.float64]
    labels: NDArray[np.int32]
    pos: float
    looks: int
    reports: int
    curve: tuple[tuple[float, float], ...]
    track: tuple[tuple[Fix, ...], ...]
    hits: tuple[LatLon, ...]
    detections: tuple[Detection, ...]
    find: Find | None
    timeline: tuple[Moment, ...]
    autopilot: str
    launch_amsl_m: float | None
    state: str

    @property
    def frame(self) -> GridFrame:
        """Cells to positions and back."""
        return self.grid.frame

    @property
    def poa(self) -> NDArray[np.float64]:
        """The probability now that the target is in each cell."""
        return self.belief.probability()

    @property
    def over(self) -> bool:
        """Whether the run has ended, as far as its journal knows: a killed one has not."""
        return self.state in FINAL

    @property
    def began(self) -> float:
        """When the first thing happened."""
        return self.timeline[0].time

    @property
    def last(self) -> float:
        """When the last thing was written down."""
        return max(self.timeline[-1].time, *(piece[-1].time for piece in self.track), self.began)

    @property
    def aircraft(self) -> Fix | None:
        """Where the aircraft was last."""
        return self.track[-1][-1] if self.track else None

    @property
    def flown_m(self) -> float:
        """Metres along the track."""
        total = 0.0
        for piece in self.track:
            metres = self.frame.to_metres([(fix.lat, fix.lon) for fix in piece])
            total += float(np.hypot(*np.diff(metres, axis=0).T).sum())
        return total

    @property
    def summary(self) -> str:
        """How it stands, in one sentence."""
        done = f"probability of success {self.pos:.0%} after {self.looks} looks"
        if self.find is not None:
            place = f"{self.find.lat:.6f}, {self.find.lon:.6f}"
            return f"found at {place} with probability {self.find.probability:.4f}; {done}"
        return f"{self.state.lower()}, not found so far; {done}" if not self.over else f"not found; {done}"


def read_run(folder: Path) -> Run:
    """Read a run from its folder, whether it is under way or over. Raises BadInput."""
    settings, area, grid, rows = stored_run(folder)
    search = Search(grid, settings)
    curve = PosCurve()
    for row in rows:
        try:
            retrace(row, search)
        except (KeyError, TypeError, ValueError, IndexError) as error:
            raise BadInput(
                f"{folder / JOURNAL}: row {row.seq} is no {row.kind} that is known ({error})"
            ) from error
        if row.kind == "report" and row.body["observation"] is not None:
            curve.add(row.time, search.record.pos)
    reports = [row for row in rows if row.kind == "report"]
    return Run(
        name=folder.resolve().name,
        area=area,
        grid=grid,
        settings=settings,
        belief=search.belief,
        pod=search.record.pod(),
        labels=search.regions.labels,
        pos=search.record.pos,
        looks=search.record.looks,
        reports=len(reports),
        curve=tuple(curve.points),
        track=_pieces(fix for row in reports for fix in _fix(row)),
        hits=_hits(grid.frame, reports),
        detections=tuple(each for row in reports for each in _detections(row)),
        find=_find(rows, search),
        timeline=tuple(moment for row in rows for moment in _moment(row)) or (_first(rows[0]),),
        autopilot=_autopilot(rows),
        launch_amsl_m=_launch_amsl_m(rows, settings.flight.altitude_m),
        state=_state(rows),
    )


def _fix(row: Row) -> Iterable[Fix]:
    """The pose of a report, at the time of its frame."""
    lat, lon, height, heading = (float(value) for value in row.body["pose"][:4])
    if all(math.isfinite(value) for value in (lat, lon, height)):
        yield Fix(_captured(row), lat, lon, height, heading)


def _captured(row: Row) -> float:
    """When the frame was taken; of a detector with a clock of its own, when its report was written down."""
    report = row.body["report"]
    return float(report["captured_at"]) if report.get("clock", "unix") == "unix" else row.time


def _pieces(fixes: Iterable[Fix]) -> tuple[tuple[Fix, ...], ...]:
    """The track, broken where time stands still for long or goes back, as it does when a run is resumed.

    Reports may come in another order than their frames were taken: a fix that is a little late is left out.
    """
    pieces: list[list[Fix]] = []
    for fix in fixes:
        since = fix.time - pieces[-1][-1].time if pieces else math.inf
        if abs(since) > BREAK_S:
            pieces.append([fix])
        elif since > 0.0:
            pieces[-1].append(fix)
    return tuple(tuple(piece) for piece in pieces if len(piece) > 1)


def _hits(frame: GridFrame, reports: Sequence[Row]) -> tuple[LatLon, ...]:
    cells = []
    for row in reports:
        if row.body["observation"] is not None:
            cells += Observation.from_dict(row.body["observation"]).speaking
    return tuple((float(lat), float(lon)) for lat, lon in frame.to_latlon(np.array(cells).reshape(-1, 2)))


def _detections(row: Row) -> Iterable[Detection]:
    """What a report has seen; one that is told in pixels stands where the service placed it, if it did."""
    report: dict[str, Any] = row.body["report"]
    observed = row.body["observation"]
    seen = report.get("detections", ())
    placed = (observed or {}).get("sightings", ())
    for number, each in enumerate(seen):
        place = each
        if each.get("lat") is None or each.get("lon") is None:
            if len(placed) != len(seen):
                continue
            place = placed[number]
        yield Detection(
            time=_captured(row),
            lat=float(place["lat"]),
            lon=float(place["lon"]),
            kind=_plain(each.get("class", "target")),
            score=float(each.get("score", 1.0)),
            source=_plain(report.get("source", "detector")),
            counted=observed is not None and any(observed["hits"]),
        )


def _plain(text: object) -> str:
    """Text of a detector that every format can hold: no control characters, no halves of characters."""
    whole = str(text).encode("utf-8", "replace").decode("utf-8")
    return "".join(c if c.isprintable() else "?" for c in whole)


def _find(rows: Sequence[Row], search: Search) -> Find | None:
    """The last place that counted as found, unless an operator has rejected it since and it counts no more."""
    find: Find | None = None
    rejected = False
    for row in rows:
        body = row.body
        if row.kind == "found":
            radius = body["sigma_m"] * IN_95_PERCENT
            known = body.get("ellipse") or {}
            ellipse = (
                float(known.get("semi_major_m", radius)),
                float(known.get("semi_minor_m", radius)),
                float(known.get("bearing_deg", 0.0)),
            )
            find = Find(row.time, body["lat"], body["lon"], body["probability"], body["sigma_m"], ellipse)
            rejected = False
        elif row.kind == VERDICT:
            rejected = not body["confirmed"]
    return None if rejected and search.found() is None else find


def _moment(row: Row) -> Iterable[Moment]:
    """What belongs into the timeline; decisions and waypoints are too many."""
    body = row.body
    if row.kind == "transition":
        yield Moment(row.time, "state", f"{body['from']} → {body['to']}: {body['reason']}")
    elif row.kind == "order":
        yield Moment(row.time, "order", f"operator: {body['command']}")
    elif row.kind == VERDICT:
        yield Moment(row.time, "verdict", f"operator: {'it is' if body['confirmed'] else 'it is not'} here")
    elif row.kind == "mode" and not body["commanded"]:
        yield Moment(row.time, "mode", f"the autopilot changed to {body['mode']}")
    elif row.kind == "found":
        place = f"{body['lat']:.6f}, {body['lon']:.6f}"
        yield Moment(row.time, "found", f"found at {place}, probability {body['probability']:.4f}")


def _first(row: Row) -> Moment:
    return Moment(row.time, "start", "the journal begins")


def _state(rows: Sequence[Row]) -> str:
    for row in reversed(rows):
        if row.kind == "transition":
            return str(row.body["to"])
    return State.WAITING.value


def _autopilot(rows: Sequence[Row]) -> str:
    """From the reason of the first transition, such as "px4 is ready"."""
    for row in rows:
        if row.kind == "transition" and row.body["event"] == Event.LINKED:
            return str(row.body["reason"]).partition(" ")[0]
    return ""


def _launch_amsl_m(rows: Sequence[Row], altitude_m: float) -> float | None:
    """Every waypoint is flown `altitude_m` above the launch point, and says its height above the sea."""
    for row in rows:
        if row.kind == "command" and "alt_amsl_m" in row.body:
            return float(row.body["alt_amsl_m"]) - altitude_m
    return None
