"""Where a search stands, as `/api/state` and the page are told: one type for a live run and for a replay.

The two differ in nothing but what a journal does not keep, which is null in a replay. These are typed dictionaries, so
that they are JSON as they are; the OpenAPI document has their schema, and mypy holds both views to it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NotRequired

from typing_extensions import TypedDict  # what pydantic can read on Python 3.11

from service.evidence.counts import Counts
from service.evidence.found import Found, Suspect
from service.evidence.observe import FramePose
from service.geometry import LatLon
from service.mission.states import State
from service.places import Coordinates, written
from service.reasons import Option
from service.view.next import ChoiceState, NextState


class PlaceState(TypedDict):
    """A place in degrees, the probability that the target is there, and the place as the team writes places."""

    lat: float
    lon: float
    probability: float
    written: str


class EllipseState(TypedDict):
    """What holds the target with 95 %: semi-axes in metres, the bearing of the long one from true north."""

    semi_major_m: float
    semi_minor_m: float
    bearing_deg: float


class FoundState(PlaceState):
    """The place that counts as found, with its largest standard deviation in metres; `confirmed`: a person said so."""

    sigma_m: float
    ellipse: EllipseState
    thumbnail: str | None
    confirmed: bool


class SuspectState(Suspect):
    """A suspect, and its place as the team writes places."""

    written: str


class PoseState(TypedDict):
    """Where the aircraft is: degrees, metres above launch, seconds; its nose from true north (null: not known), up,
    right wing down."""

    lat: float
    lon: float
    written: str
    height_m: float
    heading_deg: float | None
    time: float
    pitch_deg: float
    roll_deg: float


class FootprintCell(TypedDict):
    """A cell that a frame shows: its middle, its corners (north-west first, clockwise), whether a frame counts as a
    look at it, the part of it that is in view, and what a look is worth."""

    row: int
    col: int
    lat: float
    lon: float
    corners: list[list[float]]
    counts: bool
    covered: float
    p_tp: float
    p_tn: float


class FootprintState(TypedDict):
    """What a frame that is taken now shows; p_tp and p_tn are the settings'."""

    counts: bool
    covered: float
    p_tp: float
    p_tn: float
    cells: list[FootprintCell]


class OptionState(TypedDict):
    """One way on that the planner weighed."""

    action: str
    region: int | None
    visits: int
    value: float | None
    mass: float | None
    distance_m: float | None
    chosen: bool
    words: str


class ReportsState(TypedDict):
    """Detector reports: how many were taken in; of those that were not, a journal tells nothing. `doubt`: why what they
    found waits for a person; `clock`: how the computer's clock was set last while the search went on."""

    accepted: int
    refused: int
    refused_in_a_row: int
    last_refusal: str | None
    without_look: str | None
    doubt: str | None
    clock: str | None


class WindState(TypedDict):
    """The wind as told or reckoned: metres a second, and where it comes from in degrees from true north."""

    speed_mps: float
    from_deg: float


class LinkState(TypedDict):
    """Whether the autopilot is heard, the seconds since it was, the part of its last messages that arrived, and what a
    question takes there and its answer back (null: it does not answer, or has yet to)."""

    up: bool
    silent_s: float | None
    received: float | None
    round_trip_s: float | None


class DetectorState(TypedDict):
    """The seconds since the detector reported; `silent` when that is long enough to hover."""

    silent_s: float | None
    silent: bool


class GoalState(TypedDict):
    """A POS, whether it is reached, and the seconds until it is; null where it is not in reach."""

    pos: float
    reached: bool
    seconds: float | None


class EstimateState(TypedDict):
    """When how much POS is to be expected, and on what that rests."""

    goals: list[GoalState]
    reachable: float
    basis: str


class SortieState(TypedDict):
    """A flight that is over: its number from 1, when it landed (seconds since the epoch), its seconds in the air and
    cells of the search, POS after it, why it ended, the name of the aircraft that flew it (each counts its own), and
    its MAVLink system id and autopilot, which null does not know."""

    number: int
    aircraft: str
    landed: float
    flight_time_s: float
    steps: int
    pos: float
    why: str
    system_id: int | None
    autopilot: str | None


class GeometryState(TypedDict):
    """A GeoJSON geometry (RFC 7946), longitude first."""

    type: str
    coordinates: list[Any]


class NewsState(TypedDict):
    """A piece of news that stands: its id, role ("clue", "searched", "exclude" or "refute"), words, the middle of its
    place, how many cells it is about (an exclusion says nothing of any), and its shape for maps, of fewer corners where
    it has many; null where there is none, and in a run of an early version."""

    id: str
    role: str
    words: str
    lat: float
    lon: float
    cells: int
    geometry: GeometryState | None


class HeardState(TypedDict):
    """What became of a piece of news: "accepted", "duplicate" of an id that was known, or "withdrawn"; about how
    many cells it is; and what a person has to know of what follows."""

    id: str
    status: str
    cells: int
    notes: list[str]


class BatteryState(TypedDict):
    """What else the autopilot tells of the battery that is worst off: volts, amperes, milliampere hours used."""

    voltage_v: float | None
    current_a: float | None
    consumed_mah: float | None


class DrawnState(TypedDict):
    """How often the regions of interest were drawn again, and what was new the last time."""

    number: int
    words: str | None


class AircraftState(TypedDict):
    """One of the aircraft that fly a search: its name, the number of its colour (from 0), its state and why, where it
    is (degrees, `height` in metres above launch, its nose from true north), its battery in percent, and what of it
    `RunState` tells of the first that flies. What is not known is null."""

    name: str
    colour: int
    state: State
    words: str
    why: str
    orders: list[str]
    lat: float | None
    lon: float | None
    height: float | None
    heading_deg: float | None
    battery: float | None
    link: LinkState | None
    mode: str | None
    next: NextState
    ahead: list[LatLon]
    steps: int
    flight_time_s: float
    sorties: list[SortieState]
    pose: PoseState | None
    footprint: FootprintState


class RunState(TypedDict):
    """Where a search stands at `time` (seconds since the epoch).

    `pos` is the probability of success so far, `outside` that of a target outside the area, `regions` those of the
    regions of interest, of which `drawn` tells how often they were drawn again. `unseen` are cells that were passed
    again and again without a look that counts, which a journal does not keep: they need a ground team. `steps` are
    cells flown; `reason` and `options` are the last decision's, `ahead` the way from here as decided.
    `battery_doubt` says what is reckoned when the battery's level is not told (any longer). `flight_time_s` goes on
    over all processes and all `sorties` of a run; these are told when they are over. `words` is the state for
    people, `orders` are those that would change something now (none in a replay), `next` is what happens next and
    `choices` what was weighed for it, with the area file's names; `height_above_ground_m` is over the height model, or
    over home where the ground is taken as flat.
    `aircraft` are all that fly; what else is told of an aircraft is of the first that has not ended.
    """

    state: State
    words: str
    why: str
    orders: list[str]
    next: NextState
    choices: list[ChoiceState]
    area: str
    planner: str
    time: float
    speedup: float
    pos: float
    place: PlaceState
    unseen: list[PlaceState]
    suspects: list[SuspectState]
    outside: float
    steps: int
    flight_time_s: float
    sorties: list[SortieState]
    news: list[NewsState]
    flight_left_s: float | None
    battery_percent: float | None
    battery_doubt: str | None
    battery: BatteryState | None
    mode: str | None
    reason: str
    options: list[OptionState]
    pose: PoseState | None
    height_above_ground_m: float | None
    wind: WindState | None
    footprint: FootprintState
    reports: ReportsState
    link: LinkState | None
    detector: DetectorState | None
    ahead: list[LatLon]
    regions: list[float]
    drawn: DrawnState
    found: FoundState | None
    aircraft: list[AircraftState]
    estimate: NotRequired[EstimateState | None]


def suspect_states(suspects: Sequence[Suspect], how: Coordinates) -> list[SuspectState]:
    """Suspects as they are told."""
    return [{**each, "written": written((each["lat"], each["lon"]), how)} for each in suspects]


def known_deg(angle: float) -> float | None:
    """An angle as it is told; None while it is not known."""
    return angle if math.isfinite(angle) else None


def pose_state(pose: FramePose | None, how: Coordinates) -> PoseState | None:
    """A pose as it is told."""
    if pose is None:
        return None
    return {
        "lat": pose.lat,
        "lon": pose.lon,
        "written": written((pose.lat, pose.lon), how),
        "height_m": pose.height_m,
        "heading_deg": known_deg(pose.heading_deg),
        "time": pose.time,
        "pitch_deg": pose.pitch_deg,
        "roll_deg": pose.roll_deg,
    }


def wind_state(north_mps: float, east_mps: float) -> WindState:
    """The wind as it is told, from the air's velocity over ground."""
    from_deg = math.degrees(math.atan2(-east_mps, -north_mps)) % 360.0
    return {"speed_mps": math.hypot(north_mps, east_mps), "from_deg": from_deg}


def found_state(found: Found | None, how: Coordinates, *, confirmed: bool) -> FoundState | None:
    """The place found as it is told."""
    if found is None:
        return None
    return {
        "lat": found.lat,
        "lon": found.lon,
        "probability": found.probability,
        "written": written((found.lat, found.lon), how),
        "sigma_m": found.sigma_m,
        "ellipse": {
            "semi_major_m": found.ellipse["semi_major_m"],
            "semi_minor_m": found.ellipse["semi_minor_m"],
            "bearing_deg": found.ellipse["bearing_deg"],
        },
        "thumbnail": found.thumbnail,
        "confirmed": confirmed,
    }


def option_states(options: Sequence[Option]) -> list[OptionState]:
    """The options of a decision as they are told."""
    return [
        {
            "action": option.action,
            "region": option.region,
            "visits": option.visits,
            "value": option.value,
            "mass": option.mass,
            "distance_m": option.distance_m,
            "chosen": option.chosen,
            "words": option.words,
        }
        for option in options
    ]


def reports_state(counts: Counts, doubt: str = "", clock: str = "") -> ReportsState:
    """The counts of reports as they are told."""
    return {
        "accepted": counts.accepted,
        "refused": counts.refused,
        "refused_in_a_row": counts.refused_in_a_row,
        "last_refusal": counts.last_refusal or None,
        "without_look": counts.without_look or None,
        "doubt": doubt or None,
        "clock": clock or None,
    }
