"""What the mission's core is told, beside what the vehicle does (`service.mavlink.events`)."""

from __future__ import annotations

from dataclasses import dataclass

from roisearch import Decision
from service.area import Grid
from service.evidence.found import Found
from service.geometry import Cell, LatLon
from service.mavlink.events import VehicleEvent
from service.mission.effects import Action, SendWaypoint
from service.mission.limits import Objection
from service.reasons import Reason


@dataclass(frozen=True, slots=True)
class Order:
    """An operator's order: hold, resume, return, launch, replace, finish or abort; or "home" or "leave", by whoever
    ends the process.

    `Answer` with its ticket says that it is done with. `system_id`: of the aircraft that replaces this one; None: any.
    """

    command: str
    ticket: int = 0
    system_id: int | None = None


@dataclass(frozen=True, slots=True)
class Judged:
    """An operator confirmed or rejected a place, which the belief knows by now; `found` is what counts as found now.
    `moves`: that may move the aircraft, which nobody has stopped or taken since."""

    confirmed: bool
    found: Found | None
    ticket: int = 0
    moves: bool = True


@dataclass(frozen=True, slots=True)
class Hit:
    """A report with the target in it, at these places; `arrived` is a time of perf_counter."""

    places: tuple[LatLon, ...]
    arrived: float


@dataclass(frozen=True, slots=True)
class MapChanged:
    """What is known of the ground was reckoned anew, for news or without some; `grid` is the ground now."""

    grid: Grid


@dataclass(frozen=True, slots=True)
class Unwritten:
    """The journal cannot be written any more, and there are other aircraft that the way home has to keep clear of."""

    reason: str


@dataclass(frozen=True, slots=True)
class Thought:
    """A decision is made; `reason` says it in words, `worth` which cells of its path have to be seen from the height of
    the search: over hills, those that are not less likely than others."""

    decision: Decision
    reason: Reason
    worth: frozenset[Cell] = frozenset()


@dataclass(frozen=True, slots=True)
class NotThought:
    """No decision is made: the planner has failed, for this reason."""

    reason: str


@dataclass(frozen=True, slots=True)
class Done:
    """An action has been carried out; `latency_s` is that of a waypoint that a hit asked for."""

    action: Action
    latency_s: float | None = None


@dataclass(frozen=True, slots=True)
class Failed:
    """An action could not be carried out, or the vehicle did not do it, `answered` or without a word."""

    action: Action
    reason: str
    answered: bool = True


@dataclass(frozen=True, slots=True)
class NotSent:
    """A waypoint was not sent, for what was objected to it right before."""

    action: SendWaypoint
    objection: Objection


@dataclass(frozen=True, slots=True)
class NotStopped:
    """A stop could not be sent."""

    reason: str


News = (
    VehicleEvent
    | Order
    | Judged
    | Hit
    | MapChanged
    | Unwritten
    | Thought
    | NotThought
    | Done
    | Failed
    | NotSent
    | NotStopped
)
