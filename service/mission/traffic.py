"""One aircraft among several: what the others are told of it, and what they leave it to do (`apart` is the judge).

It remembers what the telemetry does not show: the last points it was sent to, which its autopilot may fly to although
another one or a stop was sent since (that can get lost on the radio), that it takes off, and what it waits for.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from service.config import FlightSettings
from service.geometry import LatLon, moved, offset_m
from service.mavlink.telemetry import Telemetry
from service.mission.apart import (
    SLACK_M,
    Claim,
    Other,
    Spacing,
    awaited,
    called,
    near,
    objection,
    rooms,
    stands_in,
    wait_s,
)
from service.mission.chart import Chart, here
from service.mission.effects import SendWaypoint
from service.mission.flight import Flight
from service.mission.heights import Heights

LOST_STOP_S = 10.0  # after which a stop or another point has arrived, or is known not to have
_NAMED_M, _FLIES_MPS = 2.0, 1.0
KEPT_S = 12.0  # who was left no leg for so long tries it from elsewhere
CLAIM_S = 3.0  # what is waited for is asked for every second
SAME_GROUND_M = 30.0
_CONE = 3.0  # an autopilot's own way home is at most so many times as high as it is long


@dataclass(frozen=True, slots=True)
class Course:
    """What is to be known of a mission beside its telemetry: whether it takes off (`climbs`), the autopilot flies home
    (`returns`), a heartbeat has come lately (`heard`), and it has `ended`."""

    climbs: bool
    returns: bool
    heard: bool
    ended: bool = False


@dataclass(frozen=True, slots=True)
class _Goal:
    """A place, a height above the ground at the launch point, and until when it may be flown to."""

    point: LatLon
    up_m: float
    until: float = math.inf


def aloft(t: Telemetry) -> bool:
    """Whether its autopilot says that it flies, or may at any moment."""
    return t.armed or t.landed_state in ("in_air", "takeoff", "landing")


def brakes_at(start: LatLon, stands: LatLon, goals: Sequence[LatLon]) -> LatLon:
    """Where it comes to a stand if `stands` is where it does when told to now: not beyond the farthest point that it
    flies straight to, for which it brakes by itself."""
    east, north = offset_m(start, stands)
    length = math.hypot(east, north)
    if not length > SLACK_M:
        return stands
    ahead = []
    for goal in goals:
        x, y = offset_m(start, goal)
        along, across = (x * east + y * north) / length, (x * north - y * east) / length
        if along >= SLACK_M and abs(across) <= SLACK_M:
            ahead.append(along)
    share = min(1.0, max(ahead) / length) if ahead else 1.0
    return moved(start, share * east, share * north)


class Traffic:
    """One aircraft among the others.

    Args:
        name: that of the aircraft; empty: it is the only one.
        fresh_s: how old a position may be.
    """

    def __init__(
        self, name: str, chart: Chart, heights: Heights, flight: FlightSettings, fresh_s: float
    ) -> None:
        self.name, self._chart, self._heights, self._flight = name, chart, heights, flight
        self._spacing = Spacing.of(flight, fresh_s)
        self._sent: list[_Goal] = []  # the newest last
        self._rises_to_m: float | None = None
        self._rose_to_m, self._rose_at = (
            math.nan,
            -math.inf,
        )  # the last climb, and when it was not wanted any more
        self._claim: Claim | None = None
        self._claimed_at = -math.inf
        self._refused_since = self._refused_at = -math.inf  # legs in a row

    # ---- what becomes of it

    def sent(self, waypoint: SendWaypoint, now: float) -> None:
        """It has been sent to a point; it may go on to the one before until that is known to have arrived."""
        self.rest(now)
        self._sent.append(_Goal(waypoint.point, self._heights.up_of(waypoint.altitude_m)))
        self._claim, self._refused_at = None, -math.inf

    def rest(self, now: float) -> None:
        """Its point is not wanted any more."""
        still = (each for each in self._sent if now < each.until)
        self._sent = [replace(each, until=min(each.until, now + LOST_STOP_S)) for each in still]

    def forget(self, now: float) -> None:
        """Another state has begun: it neither waits nor takes off, though a climb that was begun may go on."""
        if self._rises_to_m is not None:
            self._rose_to_m, self._rose_at = self._rises_to_m, now
        self._rises_to_m, self._claim = None, None

    # ---- what the others are told

    def told(self, t: Telemetry, now: float, course: Course) -> Other:
        """This aircraft as the others see it."""
        guided = t.guided or course.climbs
        own = self._own(t, now)
        astray = (
            not own.goals and t.ground_speed_mps > _FLIES_MPS
        )  # where to, nobody has told (us, since we started)
        return replace(
            self._lands(own, t) if course.returns else own,
            in_air=(aloft(t) and now - t.heartbeat_time <= self._spacing.battery_s)
            or self._rises_to_m is not None
            or t.heartbeat_time < self._rose_at,
            steered=t.in_control and guided and course.heard and not astray,
            ended=course.ended,
        )

    def unheard(self, t: Telemetry, now: float, flight: Flight, *, climbs: bool) -> Other:
        """This aircraft as the others are to see it when an earlier process left it in the air, and it has not told
        its place since: where its journalled track ends, and on its way to where it was sent last. `climbs`: it was
        taking off, as long as that process lived."""
        at, lat, lon, up = flight.track[-1] if flight.track else (flight.told_at, *self._chart.home(t), 0.0)
        home_m, goals = self._heights.home_m, [] if flight.goal is None else [(flight.goal, up)]
        if climbs:
            at, goals = max(at, flight.told_at), [((lat, lon), self._heights.take_off_m())]
        return Other(
            self.name,
            (lat, lon),
            home_m + up,
            (lat, lon),
            self._chart.home(t),
            home_m + self._return_m(t),
            self._flight.speed_mps,
            tuple(point for point, _ in goals),
            tuple(home_m + height for _, height in goals),
            age_s=now - at,
            steered=False,
            system_id=t.system_id or None,
        )

    def _own(self, t: Telemetry, now: float) -> Other:
        """As it is, flying: where it is, and every point that it may be on its way to."""
        goals = [(each.point, each.up_m) for each in self._may_fly_to(t, now)]
        named = t.target_amsl
        if named is not None:
            goals.append(((named.lat, named.lon), self._heights.up_of(named.alt_amsl_m)))
        may_climb = now < self._rose_at + LOST_STOP_S or t.heartbeat_time < self._rose_at
        rises = self._rose_to_m if self._rises_to_m is None and may_climb else self._rises_to_m
        if rises is not None:
            goals.append((here(t), rises))
        home = self._chart.home(t)
        return Other(
            self.name,
            here(t),
            self._heights.up(t),
            brakes_at(here(t), self._heights.stop_place(t), [point for point, _ in goals]),
            home,
            self._heights.home_m + self._return_m(t),
            self._flight.speed_mps,
            tuple(point for point, _ in goals),
            tuple(up for _, up in goals),
            age_s=now - t.position_time,
            claim=self._claim if now - self._claimed_at <= CLAIM_S else None,
            system_id=t.system_id or None,
            home_amsl_m=t.home_alt_amsl_m,
        )

    def _may_fly_to(self, t: Telemetry, now: float) -> list[_Goal]:
        """Of the points it was sent to, those that it may be on its way to: the last alone once the autopilot names
        that."""
        sent, named = [each for each in self._sent if now < each.until], t.target_amsl
        if sent and named is not None:
            away = math.hypot(*offset_m(sent[-1].point, (named.lat, named.lon)))
            if away < _NAMED_M and abs(self._heights.up_of(named.alt_amsl_m) - sent[-1].up_m) < _NAMED_M:
                return sent[-1:]
        return sent

    def _lands(self, own: Other, t: Telemetry) -> Other:
        """The same aircraft while its autopilot flies it home, which it climbs for the less the nearer that is."""
        away = math.hypot(*offset_m(own.place, own.home))
        top = self._heights.home_m + min(self._return_m(t), _CONE * away)
        return replace(own, returns=True, return_up_m=top)

    def _return_m(self, t: Telemetry) -> float:
        return self._flight.return_height_m if t.return_height_m is None else t.return_height_m

    # ---- what it may do

    def leg(
        self, waypoint: SendWaypoint, t: Telemetry, others: Sequence[Other], now: float, *, urgent: bool
    ) -> str:
        """Why a waypoint must not be sent now, as a sentence's end, or nothing. `urgent`: it flies home."""
        if not others:
            return ""
        own = self._own(t, now)
        wanted = own.sent(waypoint.point, self._heights.up_of(waypoint.altitude_m))
        why = objection(own, wanted, others, self._spacing)
        if not why:
            return ""
        if now - self._refused_at > CLAIM_S:
            self._refused_since = now
        self._refused_at = now
        if urgent:
            self._wait(wanted, "fly home", now, urgent=True)
        elif now - self._refused_since >= CLAIM_S:
            self._wait(wanted, "search on", now, searches=True)
        return why

    def in_the_way(self, t: Telemetry, others: Sequence[Other], now: float) -> bool:
        """Whether it must make room: it stands where one with a better right waits to go, or nothing that it wanted was
        left to it for long."""
        own = self._own(t, now)
        kept = now - self._refused_at <= CLAIM_S and now - self._refused_since >= KEPT_S
        return kept or any(stands_in(own, room, self._spacing) for room in awaited(own, others))

    def makes_room(self, waypoint: SendWaypoint, t: Telemetry, others: Sequence[Other], now: float) -> bool:
        """Whether it may fly to a point now, and stands in nobody's way there."""
        own = self._own(t, now)
        up = self._heights.up_of(waypoint.altitude_m)
        there = replace(own, place=waypoint.point, stands=waypoint.point, up_m=up)
        if any(stands_in(there, room, self._spacing) for room in awaited(own, others)):
            return False
        return not objection(own, own.sent(waypoint.point, up), others, self._spacing)

    def take_off(self, t: Telemetry, height_m: float, others: Sequence[Other], now: float) -> str:
        """Why it must not take off to a height above home now, or nothing: from then on the others keep clear."""
        if not others:
            return ""
        own, up = self._own(t, now), self._heights.home_m + height_m
        wanted = own.sent(here(t), up)
        why = objection(replace(own, in_air=False), wanted, others, self._spacing)
        if why:
            self._wait(wanted, "take off", now, urgent=False)
            return f"the take-off {why}"
        self._rises_to_m, self._claim = up, None
        return ""

    def landing(self, t: Telemetry, others: Sequence[Other], now: float) -> str:
        """Why its autopilot must not fly it home and land it now, or nothing."""
        if not others:
            return ""
        own = self._own(t, now)
        wanted = self._lands(own, t)
        why = objection(own, wanted, others, self._spacing)
        if why:
            self._wait(wanted, "land", now, urgent=True)
            return f"the landing {why}"
        self._claim = None
        return ""

    def twin(self, t: Telemetry, others: Sequence[Other]) -> str:
        """Why it may be the aircraft that another mission has already, over another link; or nothing. Who flies keeps
        it, else the first by name."""
        for other in others:
            if t.system_id and t.system_id == other.system_id and (other.in_air or other.name < self.name):
                return (
                    f"its autopilot has the MAVLink system id {t.system_id}, as that of {called(other)}: it may be the "
                    "same aircraft over two links; give each its own id (MAV_SYS_ID, SYSID_THISMAV)"
                )
        return ""

    def uneven(self, t: Telemetry, others: Sequence[Other]) -> str:
        """Why its height above home is not comparable with that of another one above its own, or nothing: without a
        ground file nothing else says how high they are. Who flies has its height, else the first by name.

        Homes side by side are on the same ground, whatever two receivers make of its height.
        """
        if self._heights.relief is not None:
            return ""
        most_m = self._flight.layer_m - self._spacing.gap_m
        for other in others:
            before = other.in_air or (not other.ended and other.name < self.name)
            higher_m = t.home_alt_amsl_m - other.home_amsl_m
            far = math.hypot(*offset_m(self._chart.home(t), other.home)) > SAME_GROUND_M
            if before and far and abs(higher_m) > most_m:
                return (
                    f"home is {abs(higher_m):.0f} m {'higher' if higher_m > 0.0 else 'lower'} than that of "
                    f"{called(other)}, more than the {most_m:g} m that the layers allow for: give the heights of the "
                    "ground (--ground), or let both begin equally high"
                )
        return ""

    def wait_s(self, t: Telemetry, others: Sequence[Other]) -> float:
        """Seconds that it may have to wait over home, until all who land there too are down."""
        return wait_s(self._chart.home(t), self._heights.home_m, others, self._spacing) if others else 0.0

    def near(self, t: Telemetry, others: Sequence[Other], now: float) -> str:
        """Why it must stop at once, or nothing."""
        why = near(self._own(t, now), others, self._spacing) if others else ""
        return f"the aircraft {why}" if why else ""

    def _wait(
        self, wanted: Other, to: str, now: float, *, urgent: bool = False, searches: bool = False
    ) -> None:
        """Let the others keep out of the largest of the rooms that are wanted."""
        room = rooms(wanted, self._spacing)[-1]
        self._claim, self._claimed_at = Claim(room, urgent, to, searches), now
