"""What the journal of a run tells, as values: one class for each kind of row, with its JSON body and back.

Whoever writes a row makes one of these and hands it to the journal; whoever reads a journal gets them back, each where
it stands (`service.entries`). A body keeps the form that it has on disk: journals of every earlier version are read,
and what they did not tell yet is None, or what it was then.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, ClassVar, Self, cast, get_args

import numpy as np
import shapely
from shapely.geometry import shape

from service.drawing import RegionsRow
from service.errors import shown
from service.evidence.found import IN_95_PERCENT, Found
from service.evidence.observe import FramePose, Observation
from service.evidence.reports import ANY_SOURCE, name_of_frame
from service.geometry import Cell, LatLon
from service.mission.states import Event, State
from service.news.bearing import FieldNews, NewsRole
from service.reasons import Option
from service.rowbody import Body
from service.timebase import ROW as TIE
from service.timebase import Tie

TrackPoint = tuple[float, float, float, float]
LONGEST_PATH = 16  # cells of a decision that the journal keeps


@dataclass(frozen=True)
class TransitionRow:
    """The mission's state changed."""

    kind: ClassVar[str] = "transition"
    before: State
    event: Event
    after: State
    reason: str

    def body(self) -> dict[str, Any]:
        return {"from": self.before, "event": self.event, "to": self.after, "reason": self.reason}

    @classmethod
    def read(cls, body: Body, time: float) -> Self:
        before, event, after = State(body.text("from")), Event(body.text("event")), State(body.text("to"))
        return cls(before, event, after, body.text("reason"))


@dataclass(frozen=True)
class OrderRow:
    """An operator's order, the state in which it came, and the place that it is about, if any."""

    kind: ClassVar[str] = "order"
    command: str
    state: str
    place: LatLon | None = None

    def body(self) -> dict[str, Any]:
        return {"command": self.command, "state": self.state, "place": self.place}

    @classmethod
    def read(cls, body: Body, time: float) -> Self:
        return cls(body.text("command"), body.text("state"), body.place_or_none("place"))


@dataclass(frozen=True)
class CommandRow:
    """What the vehicle was about to be told: "reposition" with its target, "take off" with its height above launch,
    and others that have neither, such as "hold"."""

    kind: ClassVar[str] = "command"
    command: str
    lat: float | None = None
    lon: float | None = None
    alt_amsl_m: float | None = None
    height_m: float | None = None

    def body(self) -> dict[str, Any]:
        return {name: value for name, value in asdict(self).items() if value is not None}

    @classmethod
    def read(cls, body: Body, time: float) -> Self:
        numbers = (body.number_or_none(name) for name in ("lat", "lon", "alt_amsl_m", "height_m"))
        return cls(body.text("command"), *numbers)


@dataclass(frozen=True)
class ModeRow:
    """The autopilot's mode changed; `commanded`: we had asked for it."""

    kind: ClassVar[str] = "mode"
    mode: str
    commanded: bool

    def body(self) -> dict[str, Any]:
        return asdict(self)

    @classmethod
    def read(cls, body: Body, time: float) -> Self:
        return cls(body.text("mode"), body.flag("commanded"))


@dataclass(frozen=True)
class NotTakenRow:
    """A waypoint that the autopilot did not take."""

    kind: ClassVar[str] = "not taken"
    lat: float
    lon: float

    def body(self) -> dict[str, Any]:
        return asdict(self)

    @classmethod
    def read(cls, body: Body, time: float) -> Self:
        return cls(body.number("lat"), body.number("lon"))


@dataclass(frozen=True)
class YieldedRow:
    """The vehicle was given to its pilot."""

    kind: ClassVar[str] = "yielded"
    reason: str

    def body(self) -> dict[str, Any]:
        return asdict(self)

    @classmethod
    def read(cls, body: Body, time: float) -> Self:
        return cls(body.text("reason"))


@dataclass(frozen=True)
class DecisionRow:
    """What the planner decided: its option, the first cells of its path, why, and what else was weighed."""

    kind: ClassVar[str] = "decision"
    action: str
    path: tuple[Cell, ...]
    reason: str
    options: tuple[Option, ...] = ()

    def body(self) -> dict[str, Any]:
        options = [asdict(option) for option in self.options]
        path = self.path[:LONGEST_PATH]
        return {"action": self.action, "path": path, "reason": self.reason, "options": options}

    @classmethod
    def read(cls, body: Body, time: float) -> Self:
        options = tuple(_option(each) for each in body.bodies("options"))
        path = tuple(body.cells("path"))
        return cls(body.text("action"), path, body.text("reason"), options)


@dataclass(frozen=True)
class FlightRow:
    """What has been flown by then: seconds in the air in all flights of the run, those of them before the aircraft last
    stood on the ground, cells of the search, and the places (time, latitude, longitude, metres above launch) since the
    last such row."""

    kind: ClassVar[str] = "flight"
    seconds: float
    earlier_s: float
    steps: int
    track: tuple[TrackPoint, ...] = ()

    def body(self) -> dict[str, Any]:
        return asdict(self)

    @classmethod
    def read(cls, body: Body, time: float) -> Self:
        track = tuple(_track_point(each) for each in body.rows("track"))
        return cls(body.number("seconds"), body.number("earlier_s"), body.count("steps"), track)


@dataclass(frozen=True)
class SortieRow:
    """A flight is over, from take-off to landing: its number from 1, when it landed, its seconds in the air and cells
    of the search, the probability of success after it, why it ended, and the MAVLink system id and the autopilot of the
    aircraft that flew it (None: early journals do not tell)."""

    kind: ClassVar[str] = "sortie"
    number: int
    landed: float
    seconds: float
    steps: int
    pos: float
    why: str
    system_id: int | None = None
    autopilot: str | None = None

    def body(self) -> dict[str, Any]:
        return asdict(self)

    @classmethod
    def read(cls, body: Body, time: float) -> Self:
        numbers = body.number("landed"), body.number("seconds")
        aircraft = body.count_or_none("system_id"), body.text_or_none("autopilot")
        steps, pos, why = body.count("steps"), body.number("pos"), body.text("why")
        return cls(body.count("number"), *numbers, steps, pos, why, *aircraft)


@dataclass(frozen=True)
class FoundRow:
    """The place that counted as found from then on."""

    kind: ClassVar[str] = "found"
    found: Found

    def body(self) -> dict[str, Any]:
        return asdict(self.found)

    @classmethod
    def read(cls, body: Body, time: float) -> Self:
        sigma = body.number("sigma_m")
        around = body.body_or_none("ellipse")  # early journals tell sigma alone: a circle
        ellipse = {
            "semi_major_m": sigma * IN_95_PERCENT if around is None else around.number("semi_major_m"),
            "semi_minor_m": sigma * IN_95_PERCENT if around is None else around.number("semi_minor_m"),
            "bearing_deg": 0.0 if around is None else around.number("bearing_deg"),
        }
        lat, lon, probability = body.number("lat"), body.number("lon"), body.number("probability")
        return cls(Found(lat, lon, probability, sigma, ellipse, body.text_or_none("thumbnail")))


@dataclass(frozen=True, eq=False)
class ReportRow:
    """A detector's report as it was sent, where the aircraft was when its frame was taken (in the service's clock),
    and what it was taken to say; None when that was nothing new."""

    kind: ClassVar[str] = "report"
    report: Mapping[str, Any]
    pose: FramePose
    observation: Observation | None

    @property
    def name(self) -> str:
        """What tells the report from all others of its aircraft."""
        return name_of_frame(str(self.report["id"]), str(self.report.get("source", ANY_SOURCE)))

    @property
    def key(self) -> str:
        """What keeps a report from being written twice."""
        return f"report {self.name}"

    @property
    def captured(self) -> float:
        """When the frame was taken, in the service's clock."""
        return self.pose.time

    @property
    def captured_at(self) -> float:
        """When that was, as the report says; not a number where an early journal does not tell."""
        told = self.report.get("captured_at")
        return float(told) if isinstance(told, int | float) else math.nan

    def body(self) -> dict[str, Any]:
        pose, known = self.pose, math.isfinite(self.pose.heading_deg)
        heading = pose.heading_deg if known else 0.0
        return {
            "report": self.report,
            "pose": [pose.lat, pose.lon, pose.height_m, heading, pose.pitch_deg, pose.roll_deg],
            **({} if known else {"heading_known": False}),
            "captured": pose.time,
            "observation": self.observation.to_dict() if self.observation else None,
        }

    @classmethod
    def read(cls, body: Body, time: float) -> Self:
        report = body.body("report")
        report.text("id")
        captured = body.number_or_none("captured")
        if captured is None:  # early journals know it by the detector's clock, where that is the service's
            own = report.number_or_none("captured_at") if report.get("clock", "unix") == "unix" else None
            captured = time if own is None else own
        lat, lon, height_m, heading_deg, *attitude = body.numbers("pose")
        if "heading_known" in body.fields and not body.flag("heading_known"):
            heading_deg = math.nan
        pose = FramePose(lat, lon, height_m, heading_deg, captured, *attitude)
        seen = body.body_or_none("observation")
        return cls(report.fields, pose, None if seen is None else _observation(seen))


@dataclass(frozen=True, eq=False)
class VerdictRow:
    """What an operator said about the place around a cell, and what that was taken to say."""

    kind: ClassVar[str] = "verdict"
    confirmed: bool
    cell: Cell
    observation: Observation

    def body(self) -> dict[str, Any]:
        observation = self.observation.to_dict()
        return {"confirmed": self.confirmed, "cell": list(self.cell), "observation": observation}

    @classmethod
    def read(cls, body: Body, time: float) -> Self:
        return cls(body.flag("confirmed"), body.cell("cell"), _observation(body.body("observation")))


@dataclass(frozen=True, eq=False)
class NewsRow:
    """News from the field, and what they say about which cells: as `News` has it."""

    kind: ClassVar[str] = "news"
    news: FieldNews

    def body(self) -> dict[str, Any]:
        news = self.news
        told: dict[str, Any] = {"cells": news.cells.tolist(), "values": news.values.tolist()}
        if news.shape is not None:
            told["shape"] = json.loads(shapely.to_geojson(news.shape))
        if news.prior:
            told["prior"] = news.prior
        return {"id": news.id, "role": news.role, "words": news.words, "place": news.place, **told}

    @classmethod
    def read(cls, body: Body, time: float) -> Self:
        role, place = body.text("role"), body.place_or_none("place")
        cells, values = body.cells("cells"), body.numbers("values")
        if role not in get_args(NewsRole) or place is None or len(cells) != len(values):
            raise ValueError(
                f"news of the role {shown(role)} for {len(cells)} cells have {len(values)} values"
            )
        at = np.array(cells, dtype=np.int64).reshape(-1, 2)
        drawn, early = body.get("shape"), body.get("ground")
        if early is not None:
            drawn = {"type": "MultiPolygon", "coordinates": early}
        place_of = None if drawn is None else shape(drawn)
        worth = np.array(values, dtype=np.float64)
        refuted = body.text_or_none("prior") or ""
        said = body.text("id"), cast(NewsRole, role), body.text("words")
        return cls(FieldNews(*said, place, at, worth, place_of, refuted))


@dataclass(frozen=True)
class WithdrawnRow:
    """News are taken back."""

    kind: ClassVar[str] = "withdrawn"
    id: str

    def body(self) -> dict[str, Any]:
        return asdict(self)

    @classmethod
    def read(cls, body: Body, time: float) -> Self:
        return cls(body.text("id"))


@dataclass(frozen=True)
class ResumedRow:
    """Another process went on with the run: of which version, and which settings it changed ('section.key')."""

    kind: ClassVar[str] = "resumed"
    version: str
    changed: Mapping[str, Any]

    def body(self) -> dict[str, Any]:
        return {"version": self.version, "changed": dict(self.changed)}

    @classmethod
    def read(cls, body: Body, time: float) -> Self:
        return cls(body.text("version"), body.body("changed").fields)


@dataclass(frozen=True)
class ClockRow:
    """How the service's clock stood to the computer's."""

    kind: ClassVar[str] = TIE
    tie: Tie

    def body(self) -> dict[str, Any]:
        return self.tie.body()

    @classmethod
    def read(cls, body: Body, time: float) -> Self:
        service, wall, monotonic = (body.number(name) for name in ("service", "wall", "monotonic"))
        return cls(Tie(service, wall, monotonic, body.text("boot"), body.number("step_s")))


@dataclass(frozen=True)
class VehicleClockRow:
    """How the vehicle's clock stood to the service's: at `service` its time since boot was `boot_s`; `step_s`: by how
    much it had stepped since the last such row (0: it has not). What the link delays is in it."""

    kind: ClassVar[str] = "vehicle clock"
    service: float
    boot_s: float
    step_s: float = 0.0

    def body(self) -> dict[str, Any]:
        return asdict(self)

    @classmethod
    def read(cls, body: Body, time: float) -> Self:
        return cls(body.number("service"), body.number("boot_s"), body.number("step_s"))


@dataclass(frozen=True)
class VehicleRow:
    """The aircraft is heard for the first time, in this process or since another one was waited for: its MAVLink system
    id and its autopilot."""

    kind: ClassVar[str] = "vehicle"
    system_id: int
    autopilot: str

    def body(self) -> dict[str, Any]:
        return asdict(self)

    @classmethod
    def read(cls, body: Body, time: float) -> Self:
        return cls(body.count("system_id"), body.text("autopilot"))


@dataclass(frozen=True)
class ReplacedRow:
    """An operator let another aircraft take the place of this one: the next that is heard, or the one with a MAVLink
    system id. `was_system_id` and `was_autopilot` are those of the one that is let go."""

    kind: ClassVar[str] = "replaced"
    system_id: int | None
    was_system_id: int
    was_autopilot: str

    def body(self) -> dict[str, Any]:
        return asdict(self)

    @classmethod
    def read(cls, body: Body, time: float) -> Self:
        was = body.count("was_system_id"), body.text("was_autopilot")
        return cls(body.count_or_none("system_id"), *was)


KnownRow = (
    TransitionRow
    | OrderRow
    | CommandRow
    | ModeRow
    | NotTakenRow
    | YieldedRow
    | DecisionRow
    | FlightRow
    | SortieRow
    | FoundRow
    | ReportRow
    | VerdictRow
    | NewsRow
    | WithdrawnRow
    | RegionsRow
    | ResumedRow
    | ClockRow
    | VehicleClockRow
    | VehicleRow
    | ReplacedRow
)


def _track_point(numbers: tuple[float, ...]) -> TrackPoint:
    time, lat, lon, height_m = numbers
    return time, lat, lon, height_m


def _option(body: Body) -> Option:
    return Option(
        action=body.text("action"),
        region=body.count_or_none("region"),
        visits=body.count_or_none("visits") or 0,
        value=body.number_or_none("value"),
        mass=body.number_or_none("mass"),
        distance_m=body.number_or_none("distance_m"),
        chosen=body.flag("chosen"),
        words=body.text("words"),
    )


def _observation(body: Body) -> Observation:
    """Refused when its lists are not of one length: they would be taken for what was not seen."""
    seen = Observation.from_dict(dict(body.fields))
    lengths = {len(seen.cells), len(seen.hits), len(seen.p_tp), len(seen.p_tn), len(seen.first)}
    if len(lengths) > 1:
        raise ValueError(f"its observation has lists of {shown(sorted(lengths))} cells")
    return seen
