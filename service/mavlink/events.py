"""What the link tells its owner: values, each with the service time at which it became known."""

from __future__ import annotations

from dataclasses import dataclass

from service.mavlink.modes import ModeKind


@dataclass(frozen=True, slots=True)
class Home:
    """HOME_POSITION: where the vehicle returns to; metres above mean sea level."""

    lat: float
    lon: float
    alt_amsl_m: float


@dataclass(frozen=True, slots=True)
class Target:
    """A place to fly to: degrees in WGS84, metres above mean sea level."""

    lat: float
    lon: float
    alt_amsl_m: float


@dataclass(frozen=True, slots=True)
class Accepted:
    """The vehicle said yes, or its heartbeat showed that it did it."""


@dataclass(frozen=True, slots=True)
class Refused:
    """The vehicle said no: the MAV_RESULT and its name without the prefix."""

    result: int
    name: str


@dataclass(frozen=True, slots=True)
class Silent:
    """No answer after so many attempts."""

    attempts: int


@dataclass(frozen=True, slots=True)
class Cancelled:
    """Not waited for any longer, and not sent again."""

    reason: str


Outcome = Accepted | Refused | Silent | Cancelled


@dataclass(frozen=True, slots=True)
class Paired:
    """The first heartbeat of an autopilot that we can fly; from here on only this system is believed."""

    time: float
    system_id: int
    autopilot: str
    mode: str
    armed: bool


@dataclass(frozen=True, slots=True)
class ModeChanged:
    """The heartbeat shows another mode; `commanded` is False when no command of ours made it so."""

    time: float
    mode: str
    previous: str
    kind: ModeKind
    guided: bool
    commanded: bool
    failsafe: bool
    """Looks like the autopilot's own failsafe rather than a pilot's hand."""


@dataclass(frozen=True, slots=True)
class ArmedChanged:
    """The heartbeat shows the motors armed or disarmed."""

    time: float
    armed: bool
    commanded: bool


@dataclass(frozen=True, slots=True)
class LandedChanged:
    """EXTENDED_SYS_STATE: "undefined", "on_ground", "in_air", "takeoff" or "landing"."""

    time: float
    state: str
    previous: str


@dataclass(frozen=True, slots=True)
class LinkLost:
    """No heartbeat for too long."""

    time: float
    silent_s: float


@dataclass(frozen=True, slots=True)
class LinkBack:
    """Heartbeats again."""

    time: float
    silent_s: float


@dataclass(frozen=True, slots=True)
class Rebooted:
    """The vehicle's time since boot went back."""

    time: float


@dataclass(frozen=True, slots=True)
class Stalled:
    """Our own process stood still; what it knew before counts as old until a new heartbeat comes."""

    time: float
    paused_s: float


@dataclass(frozen=True, slots=True)
class StatusText:
    """STATUSTEXT of the autopilot, put together again; severity 0 (emergency) to 7 (debug)."""

    time: float
    severity: int
    text: str


@dataclass(frozen=True, slots=True)
class TargetTaken:
    """POSITION_TARGET_GLOBAL_INT names our target."""

    time: float
    target: Target
    after_s: float


@dataclass(frozen=True, slots=True)
class TargetNotTaken:
    """The autopilot does not fly to our target, and we have stopped asking."""

    time: float
    target: Target
    attempts: int
    reason: str


@dataclass(frozen=True, slots=True)
class TargetReplaced:
    """In the guided mode, but somebody else has given another target: the aircraft is theirs now, and not ours."""

    time: float
    target: Target | None
    """The last one of ours, if one was under way."""
    found: Target | None
    """Theirs; None where only the answer to their command was heard."""
    by: str
    """Who it was, as a sentence's subject, as far as that can be told."""


@dataclass(frozen=True, slots=True)
class AnotherService:
    """Something else speaks with our MAVLink system and component: a second service on this aircraft, most likely."""

    time: float
    reason: str


@dataclass(frozen=True, slots=True)
class ReferenceMoved:
    """What heights or places are counted from has moved: "home", "origin" (of the estimator) or "sea level" (the
    altitude of home that the position's two altitudes imply; without a place). `position_too`: the position has jumped
    the same way, so that a place may be another one now than the map says."""

    time: float
    what: str
    before: Home
    after: Home
    position_too: bool = False


@dataclass(frozen=True, slots=True)
class Notice:
    """Something about the aircraft or its link that a person must hear of; it changes nothing by itself."""

    time: float
    text: str


@dataclass(frozen=True, slots=True)
class CommandDone:
    """How a command ended; the ticket is the one given out when it was sent."""

    time: float
    ticket: int
    name: str
    outcome: Outcome


VehicleEvent = (
    Paired
    | ModeChanged
    | ArmedChanged
    | LandedChanged
    | LinkLost
    | LinkBack
    | Rebooted
    | Stalled
    | StatusText
    | TargetTaken
    | TargetNotTaken
    | TargetReplaced
    | AnotherService
    | ReferenceMoved
    | Notice
    | CommandDone
)
