"""What the phases of a mission have in common: they look, and say what they want; the core does the rest.

A phase begins with its state and ends with it. It keeps its own progress (which point of a way comes next, what is
being thought about) and touches nothing else: what it gives back are wishes, which are effects to pass on, or one of
the words below for what only the core may change.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from service.evidence.found import Found
from service.geometry import Cell, LatLon
from service.mission.effects import Action, Effect, Note, SendWaypoint, Tell
from service.mission.heights import CLIMBED_M
from service.mission.limits import Objection
from service.mission.news import News, NotSent
from service.mission.standing import Look
from service.mission.states import Event

RETRY_S = 1.0  # after what something is tried again


@dataclass(frozen=True, slots=True)
class Happen:
    """Let an event of the table happen. `stopped`: why the search ends with it; `searched`: with nothing to gain;
    `direct`: the way home is to be the autopilot's own; `told`: what the pilot hears of it, if not the reason."""

    event: Event
    reason: str
    stopped: str = ""
    searched: bool = False
    direct: bool = False
    told: str = ""


@dataclass(frozen=True, slots=True)
class Hold:
    """Hover until a cause is gone; several causes can hold at once."""

    cause: str
    reason: str


@dataclass(frozen=True, slots=True)
class Release:
    """A cause does not hold any more. `instead`: another one does; `home`: then fly home."""

    cause: str
    reason: str
    instead: str = ""
    home: bool = False


@dataclass(frozen=True, slots=True)
class Find:
    """What counts as found now."""

    found: Found | None


@dataclass(frozen=True, slots=True)
class Enter:
    """The aircraft is over this cell of the search now."""

    cell: Cell


@dataclass(frozen=True, slots=True)
class Listen:
    """From now on a silence of the detector counts."""


@dataclass(frozen=True, slots=True)
class Begin:
    """The flight begins."""


@dataclass(frozen=True, slots=True)
class Replace:
    """Another aircraft flies the next sortie: the next that is heard, or the one with this MAVLink system id."""

    system_id: int | None


@dataclass(frozen=True, slots=True)
class GiveUp:
    """The run cannot go on."""

    reason: str


@dataclass(frozen=True, slots=True)
class Lost:
    """The last waypoint or stop may not have arrived."""


@dataclass(frozen=True, slots=True)
class Stand:
    """The aircraft stands on the ground, before a flight."""


@dataclass(frozen=True, slots=True)
class Late:
    """The aircraft is heard only now, when nobody reckons with it any more: no flag of before takes it up."""


@dataclass(frozen=True, slots=True)
class GoOn:
    """The aircraft is in the air still, as an earlier process left it."""


@dataclass(frozen=True, slots=True)
class Settle:
    """No sortie follows the one under way; `why` the search is finished, if it is, and not only this run of it."""

    why: str


@dataclass(frozen=True, slots=True)
class Unsettle:
    """A sortie may follow the one under way all the same, for this reason."""

    why: str


@dataclass(frozen=True, slots=True)
class Stay:
    """The state stays, for one more reason."""

    why: str


@dataclass(frozen=True, slots=True)
class ComeUp:
    """What is ordered (`event`) of an aircraft that is not heard yet: it comes up so once it is. Answered by `ticket`;
    0: nobody asked."""

    event: Event
    why: str
    ticket: int = 0


@dataclass(frozen=True, slots=True)
class Overtaken:
    """A person has stopped the aircraft or taken it: what was ordered before, and is not carried out yet, is void."""

    why: str


@dataclass(frozen=True, slots=True)
class Pending:
    """An order that needs an action first: `then` is wished once that is done."""

    command: str
    action: Action
    then: tuple[Happen | Hold | Settle, ...]
    ticket: int


Wish = (
    Effect
    | Happen
    | Hold
    | Release
    | Find
    | Enter
    | Listen
    | Begin
    | Replace
    | GiveUp
    | Lost
    | Stand
    | Late
    | GoOn
    | Settle
    | Unsettle
    | Stay
    | ComeUp
    | Overtaken
    | Pending
)


def touchdown(look: Look, reason: str, stopped: str = "") -> Happen:
    """The aircraft is on the ground, and what that means: the run is over, or waits for another sortie."""
    another = look.settings.run.next_sortie_within_s > 0.0 and not look.standing.settled
    return Happen(Event.DOWN if another else Event.LANDED, reason, stopped=stopped)


class Phase:
    """One phase; this one waits for what happens."""

    waypoint: Cell | None = None
    """The last cell that the aircraft has been sent to, in a phase that sends it to cells."""

    def tick(self, look: Look) -> Iterator[Wish]:
        """What is wanted now, several times a second."""
        yield from ()

    def on(self, news: News, look: Look) -> Iterator[Wish]:
        """What is wanted at the news of an action's end, a decision or a hit."""
        yield from ()

    def lost(self, look: Look) -> None:
        """The last waypoint or stop may not have arrived."""

    def refused(self, objection: Objection, look: Look) -> None:
        """A waypoint was not sent; the phase goes on."""
        self.lost(look)

    def elsewhere(self, look: Look) -> bool:
        """Whether it goes another way than the one whose next waypoint may not be flown to from here."""
        return False


def say(said: str, look: Look) -> Iterator[Wish]:
    """For whoever reads the console, and for the pilot."""
    yield Note(said)
    yield Tell(f"search {look.standing.state}: {said}", 5)


def warn(said: str, look: Look) -> Iterator[Wish]:
    """The same of what was not done, which is a reason more for the state to stay."""
    yield Note(said, logging.WARNING)
    yield Tell(f"search {look.standing.state}: {said}", 4)
    yield Stay(said)


class Turn:
    """An aircraft's turn to do what the other aircraft must leave room for; a person is told once that it waits."""

    def __init__(self) -> None:
        self._told = False

    def wait(self, why: str, to: str, look: Look) -> Iterator[Wish]:
        """What is to be said of why it waits, if it does."""
        if why and not self._told:
            yield Note(f"waits {to}: {why}")
            yield Tell(f"search {look.standing.state}: waits {to}")
        self._told = bool(why)


_PASSED_M = 20.0  # so near to a point on a straight way it goes on
BEND_M = 5.0  # a bend around an exclusion is cut no more than that
LOW_M = 2.0  # so far below its height an aircraft climbs first


class Way:
    """Points to fly straight to, one after the other; an aircraft that is lower than it is to fly climbs first, and
    straight up: between it and its first point may stand what is not higher than it is to fly."""

    def __init__(self, points: Sequence[LatLon], *, climb: bool) -> None:
        self._points = list(points)
        self._sent = False
        self._not_before = 0.0
        self._climbing, self._may_climb = False, climb
        self._climb_m, self._passing = 0.0, False  # above home; through a point between

    @property
    def flown(self) -> bool:
        """The last point is reached."""
        return not self._points and not self._may_climb

    def tick(self, look: Look) -> Iterator[Wish]:
        """Send the next point when it is time."""
        t = look.seen.telemetry
        if self._may_climb:
            self._may_climb = False
            least = look.helm.heights.over_m((t.lat, t.lon))
            if t.alt_home_m < least - LOW_M:
                self._climbing, self._climb_m = True, least - LOW_M
                self._points.insert(0, (t.lat, t.lon))
        if self._sent and self._reached(look):
            del self._points[0]
            self._sent = self._climbing = self._passing = False
        if self._points and not self._sent and not look.busy and look.now >= self._not_before:
            self._sent = True
            yield self._next(look)

    def _next(self, look: Look) -> SendWaypoint:
        """The next point; over ground with heights it may be one on the way to it, or a climb before."""
        t, helm = look.seen.telemetry, look.helm
        if self._climbing:
            altitude = t.home_alt_amsl_m + self._climb_m + LOW_M
            return SendWaypoint(self._points[0], altitude, on_way=True)
        point = helm.heights.piece(self._points[0], t)
        leg = helm.leg(point, t)
        if leg.climbs:
            self._climbing, self._climb_m = True, leg.altitude_m - t.home_alt_amsl_m - CLIMBED_M
            self._points.insert(0, helm.stands(t))
            return SendWaypoint(self._points[0], leg.altitude_m, on_way=True)
        if point != self._points[0]:
            self._passing = True
            self._points.insert(0, point)
        return SendWaypoint(point, leg.altitude_m, on_way=True)

    def _reached(self, look: Look) -> bool:
        t, flight = look.seen.telemetry, look.settings.flight
        if self._climbing:
            return t.alt_home_m >= self._climb_m
        near = _PASSED_M if self._passing else min(flight.corner_m, BEND_M)
        return look.chart.distance((t.lat, t.lon), self._points[0]) <= near

    def on(self, news: News, look: Look) -> None:
        """A point that was not sent is tried again."""
        if isinstance(news, NotSent):
            self.lost(look)

    def lost(self, look: Look) -> None:
        """The last point may not have arrived."""
        self._sent, self._not_before = False, look.now + RETRY_S
