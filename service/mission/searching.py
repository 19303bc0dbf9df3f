"""The search itself: from decision to decision, until something else is to be done.

It begins by flying to the nearest cell that may be flown over. Then each tick notes progress, lets the planner think
when it is time, and sends the next waypoint when it is due. A hit drops what was committed and asks for a new decision
at once; a suspect in view is hovered over where that gives another look.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial

from roisearch import Motion
from roisearch.motion import Leg
from service.chances import share, sure
from service.geometry import Cell, LatLon
from service.mavlink.telemetry import Telemetry
from service.mission.aside import Aside
from service.mission.effects import (
    DropThought,
    Learn,
    Note,
    Passed,
    Reckon,
    SendWaypoint,
    SetSpeed,
    Stop,
    Think,
)
from service.mission.finding import found_now
from service.mission.heights import CLIMBED_M
from service.mission.heights import Leg as Height
from service.mission.lessons import Lessons
from service.mission.navigator import Navigator, straight_cells
from service.mission.news import Done, Failed, Hit, MapChanged, News, NotSent, NotThought, Thought
from service.mission.phase import RETRY_S, Begin, Enter, Happen, Hold, Listen, Phase, Way, Wish
from service.mission.situation import Situation
from service.mission.standing import Look
from service.mission.states import SEARCHED_TO, Event, State
from service.motion import MotionLimits, motion_of

SUSPECT_AT, CLEARED_BELOW = 0.5, 0.35
STANDS_MPS = 1.0
DOUBTED_S = 60.0  # so long may further looks lift what keeps a find waiting for a person


@dataclass(frozen=True, slots=True)
class Levelling:
    """A change of height before a leg.

    The aircraft coasts meanwhile, and what it coasts over may be higher again: one that follows another at once is over
    when the aircraft stands (`stands`), or it would be led on and on.
    """

    height: Height
    stands: bool

    def done(self, t: Telemetry) -> bool:
        """It is at the height, and stands if it has to."""
        off = t.alt_amsl_m - self.height.altitude_m
        there = off >= -CLIMBED_M if self.height.climbs else off <= CLIMBED_M
        return there and not (self.stands and t.ground_speed_mps > STANDS_MPS)


class Searching(Phase):
    """SEARCHING and CONFIRMING."""

    def __init__(self, look: Look) -> None:
        flight = look.settings.flight
        self._navigator = Navigator(motion_of(flight, look.chart.frame.cell_m), flight.speed_mps)
        self._motion: Motion | None = None  # as last learnt
        self._lessons = Lessons()
        self._limits = MotionLimits()  # as last told
        self._ground = look.chart.grid
        self._speed_sent = self._speed_known = False
        self._way: Way | None = None
        self._aside = Aside()
        self._looking = False  # the way to the area is behind us
        self._thinking = False
        self._hovering = False  # over a suspect, for another look
        self._levelling: Levelling | None = None  # before the next leg
        self._levelled = False  # and no leg has been flown since
        self._hit_at: float | None = None
        self._not_before = 0.0
        self._lost = False
        self._doubted_since = math.inf

    @property
    def waypoint(self) -> Cell | None:  # type: ignore[override]
        """The last cell that the aircraft has been sent to."""
        return self._navigator.waypoint if self._looking else None

    def tick(self, look: Look) -> Iterator[Wish]:
        """Get to the search, then look for its end, then steer."""
        t = look.seen.telemetry
        limits = MotionLimits(
            t.most_speed_mps, t.most_acceleration_mps2, t.most_climb_mps, t.most_descent_mps
        )
        if limits != self._limits:
            self._limits = limits
            yield Reckon(limits)
        if look.seen.motion is not None and look.seen.motion is not self._motion:
            self._motion = look.seen.motion
            self._navigator.learn(self._motion)
        if not self._speed_sent and not look.busy:
            self._speed_sent = True
            yield Begin()
            yield SetSpeed(look.settings.flight.speed_mps)
        elif self._speed_known and (place := self._aside.place(look)) is not None:
            yield from self._make_room(place, look)
        elif self._speed_known and not self._looking:
            yield from self._get_there(look)
        elif self._looking:
            yield from self._look_for_the_end(look)
            yield from self._steer(look)

    def on(self, news: News, look: Look) -> Iterator[Wish]:
        """A decision, a hit, or what became of a waypoint."""
        match news:
            case Done(action=SetSpeed()) | Failed(action=SetSpeed()):
                self._speed_known = True
            case Done(latency_s=float()):
                self._hit_at = None
            case NotSent() if self._looking:
                self.lost(look)
            case NotSent() if self._way is not None:
                self._way.on(news, look)
            case Thought(decision=decision, worth=worth) if self._thinking:
                self._thinking = False
                self._navigator.decide(decision.path, worth)
                yield from self._steer(look)
            case NotThought(reason=reason) if self._thinking:
                self._thinking = False
                yield Hold("planner", f"the planner fails ({reason})")
            case Hit(arrived=arrived) if self._looking:
                yield from self._interrupt(look)
                self._hit_at = arrived
                yield from self._steer(look)
            case MapChanged(grid=grid) if grid is not self._ground:
                self._ground = grid
                self._looking, self._way = False, None  # around what is excluded now, to where it may search
                yield from self._forget()
            case MapChanged() if self._looking:
                yield from self._interrupt(look)
                yield from self._steer(look)

    def lost(self, look: Look) -> None:
        """The last waypoint may not have arrived: decide anew where the aircraft is, in a moment."""
        if self._looking:
            self._lost, self._not_before = True, look.now + RETRY_S
        elif self._way is not None:
            self._way.lost(look)

    # ---- getting there

    def _make_room(self, place: LatLon, look: Look) -> Iterator[Wish]:
        """Out of another's way, and decide anew from there."""
        self._looking, self._hovering, self._levelling = False, False, None
        self._way = Way([place], climb=False)
        yield Note(f"makes room for the others at {look.chart.written(place)}")
        yield from self._forget()
        yield from self._way.tick(look)

    def _get_there(self, look: Look) -> Iterator[Wish]:
        t = look.seen.telemetry
        here, inside = look.chart.cell(t)
        start = look.chart.grid.nearest_flyable(here)
        if self._way is None:
            off = not inside or start != here or look.chart.too_near((t.lat, t.lon))
            goal = look.chart.latlon(start)
            self._way = Way(look.chart.route((t.lat, t.lon), goal) if off else [], climb=True)
        yield from self._way.tick(look)
        if self._way.flown:
            self._looking = True
            self._navigator.interrupt(start, look.chart.heading(t))
            yield Listen()

    # ---- looking

    def _look_for_the_end(self, look: Look) -> Iterator[Wish]:
        """Found, searched enough, or nobody looking?"""
        settings, seen = look.settings, look.seen
        yield from found_now(look)
        suspect = seen.place_probability >= SUSPECT_AT and seen.place_in_sight
        if suspect:
            yield Happen(
                Event.SUSPECT, f"something at a place that is {share(seen.place_probability)} probable"
            )
        elif not seen.place_in_sight:
            yield Happen(Event.CLEARED, "the place cannot be looked at from the air: it needs a ground team")
        elif seen.place_probability < CLEARED_BELOW:
            yield Happen(Event.CLEARED, f"the place is no longer likely, {share(seen.place_probability)}")
        if seen.searched >= seen.enough and look.standing.state == State.SEARCHING and not suspect:
            yield _searched(f"{SEARCHED_TO} {sure(seen.searched)}{seen.left_out}")
        elif look.flight.steps >= settings.search.max_steps:
            yield _searched(f"{look.flight.steps} steps flown")
        elif self._waits_for_a_person(look):
            yield Hold("doubt", seen.doubt)
        elif look.detector_silent():
            yield Note(f"no detector report for {settings.sensor.silent_after_s:.0f} s: hovering", 30)
            yield Hold("detector", look.seen.why_no_report)

    def _waits_for_a_person(self, look: Look) -> bool:
        """A place is sure enough, but for a doubt that nothing has lifted for a while: all that may be is there, so the
        search would look there again and again."""
        self._doubted_since = min(self._doubted_since, look.now) if look.seen.doubt else math.inf
        return look.now - self._doubted_since > DOUBTED_S

    # ---- steering

    def _steer(self, look: Look) -> Iterator[Wish]:
        """Note progress, think when it is time, send the next waypoint when it is due."""
        navigator, t = self._navigator, look.seen.telemetry
        here, inside = look.chart.cell(t)
        if inside and here != look.flight.cell:
            yield Enter(here)
            navigator.entered(here)
            if not self._hovering:
                yield Passed(here, look.chart.heading(t))
        if t.boot_time_s is not None:
            self._lessons.at(look.chart.place((t.lat, t.lon)), t.boot_time_s)
            if flights := self._lessons.take():
                yield Learn(flights)
        if _hovers(look.seen, look):
            if not self._hovering:
                self._hovering = True
                yield from self._forget()
                yield Stop()
            return
        if self._hovering:
            self._hovering = False
            yield from self._interrupt(look)
        if self._lost:
            if look.now < self._not_before:
                return
            self._lost = False
            yield from self._interrupt(look)  # a decision under way begins where the aircraft does not go now
        if self._levelling is not None:
            if not self._levelling.done(t):
                return
            yield from self._interrupt(look)
        remaining = look.chart.distance((t.lat, t.lon), look.chart.latlon(navigator.waypoint))
        thinking_s = look.settings.search.deadline_s * look.terms.speedup
        if not self._thinking and navigator.wants_decision(remaining, thinking_s):
            self._thinking = True
            speed = t.ground_speed_mps if navigator.interrupted else navigator.speed_mps
            speed = speed if math.isfinite(speed) else 0.0  # not told: as one that stands
            left = look.battery_left()
            left = None if left is None else left.after(remaining / look.speed_mps)
            yield Think(navigator.waypoint, navigator.heading, navigator.ahead, speed, left)
        if look.busy:
            return
        if navigator.over(remaining, t.ground_speed_mps) and (level := self._level(look)) is not None:
            yield from self._change_height(level)
            yield SendWaypoint(look.chart.latlon(navigator.waypoint), level.altitude_m, hit_at=self._hit_at)
        elif (due := navigator.due(remaining, t.ground_speed_mps, partial(self._shows, look))) is not None:
            point = self._aim(due, look)
            leg = look.helm.leg(point, t, on_way=False)
            if leg.climbs or leg.sinks:
                yield from self._change_height(leg)
                point = look.helm.stop_place(t)
            else:
                self._levelled = False
                self._lessons.commit(straight_cells(due))
            yield SendWaypoint(point, leg.altitude_m, hit_at=self._hit_at)

    def _aim(self, leg: Leg, look: Look) -> LatLon:
        """Where to send the aircraft for a leg."""
        beyond = look.chart.latlon(self._navigator.aim(leg))
        return beyond if look.helm.allows(beyond) else look.chart.latlon(leg.end)

    def _shows(self, look: Look, leg: Leg, cells: Sequence[Cell]) -> bool:
        """Whether these cells are seen where the aircraft flies over them, from where it is to the end of a leg."""
        places = [look.chart.latlon(cell) for cell in cells]
        return not places or look.helm.heights.shows(places, self._aim(leg, look), look.seen.telemetry)

    def _level(self, look: Look) -> Height | None:
        """How to change the height over the waypoint, where its cell would not be seen from the present one."""
        return look.helm.heights.level(look.chart.latlon(self._navigator.waypoint), look.seen.telemetry)

    def _change_height(self, height: Height) -> Iterator[Wish]:
        """Fly on the spot to another height, and then decide anew, from where it is by then."""
        self._levelling = Levelling(height, stands=self._levelled)
        self._levelled = True
        yield from self._forget()

    def _interrupt(self, look: Look) -> Iterator[Wish]:
        """Drop what was committed: the next decision starts where the aircraft is."""
        here, _ = look.chart.cell(look.seen.telemetry)
        self._levelling = None
        yield from self._forget()
        self._lessons.begin()
        self._navigator.interrupt(
            look.chart.grid.nearest_flyable(here), look.chart.heading(look.seen.telemetry)
        )

    def _forget(self) -> Iterator[Wish]:
        self._thinking = False
        yield DropThought()


def _searched(why: str) -> Happen:
    return Happen(Event.SEARCHED, why, stopped=why, searched=True)


def _hovers(seen: Situation, look: Look) -> bool:
    """Whether to stay here for another look at a suspect in view: when hovering gives one."""
    return look.settings.sensor.hover_look_s > 0.0 and seen.suspect_in_view
