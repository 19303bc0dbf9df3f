"""Several aircraft in one sky: where each may be until it is told otherwise, and whether two such rooms are apart.

An aircraft that has been sent to a point is, until it is sent elsewhere, over the convex hull of where it is, where it
would come to a stand, that point, and as far beyond that: what is turned is still carried on. In height it is between
where it is and where it goes. That is its `Room`. A leg is flown only if its own room is apart from the room of every
other aircraft: by the least gap in height, or else by the separation on the ground. A stop needs no leave, as it stays
inside the room that the leg before it had. So between any two sendings both are inside rooms that were apart when the
later one was sent, and never meet.

Each flies in a height layer of its own (see `service.config.each_aircraft`). Legs in two layers are apart by height,
and cross as they like; what leaves a layer (taking off, landing, the autopilot's own way home, a slope) has to be apart
on the ground.

Unknown is a room too, and a large one: see `rooms`. All heights are above the ground at the launch point, metres. Pure.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

import shapely

from service.config import FlightSettings
from service.config import gap_m as layer_gap_m
from service.geometry import LatLon, moved, offset_m

SLACK_M = 5.0
"""More than the separation is asked of a leg that is sent: positions are not exact, and paths not straight."""
STILL_M = 1.0  # whose stopping distance is shorter hovers
ERODES_M = 0.5  # a leg that comes no nearer than it is now may come so much nearer
LOOK_S = 5.0  # who is not steered by us may do anything for as long as it takes to see what it does
FAILSAFE_S = 30.0  # after which an autopilot that hears nobody has begun its own way home
SAME_M, LATE_S = 3.0, 1.0  # one place is told over two links, one of them later, with no more between
SETTLES_S = 20.0  # from the ground under it to motors that stand still, and the last metres are flown slowly
_SLOWER = 2.0  # than reckoned, at the most, is that way


@dataclass(frozen=True, slots=True)
class Spacing:
    """How far apart, and how fast aircraft are.

    Args:
        separation_m: the least distance on the ground, unless
        gap_m: the heights are so far apart.
        climb_mps, descent_mps: of each aircraft.
        battery_s: nothing stays longer in the air.
        fresh_s: how old a position may be.
    """

    separation_m: float
    gap_m: float
    climb_mps: float
    descent_mps: float
    battery_s: float
    fresh_s: float

    @classmethod
    def of(cls, flight: FlightSettings, fresh_s: float) -> Spacing:
        """As the settings say."""
        return cls(
            flight.separation_m,
            layer_gap_m(flight),
            flight.climb_mps,
            flight.descent_mps,
            max(flight.full_battery_s, flight.max_flight_s),
            fresh_s,
        )


@dataclass(frozen=True, slots=True)
class Room:
    """Where an aircraft may be: over the convex hull of places and `beyond_m` around it, between two heights."""

    places: tuple[LatLon, ...]
    low_m: float
    high_m: float
    beyond_m: float = 0.0


@dataclass(frozen=True, slots=True)
class Claim:
    """The room that an aircraft waits for: nobody enters it before, unless with a better right. `urgent`: it flies home
    and is let through before those who wait for anything else, of whom those who search (`searches`) come last; among
    equals the first by name."""

    room: Room
    urgent: bool
    to: str
    searches: bool = False


@dataclass(frozen=True, slots=True)
class Other:
    """One aircraft as the others see it.

    Args:
        name: what people call it; who comes first by name goes first.
        place, up_m: where it is, as last told; NaN where that was never told.
        stands: where it comes to a stand if it is told to.
        goals, goals_up_m: where it was sent, and where its autopilot says that it goes.
        home, return_up_m: where it lands, and how high its autopilot flies there by itself.
        speed_mps: how fast it flies.
        age_s: how old its place is.
        in_air: it flies, or is about to.
        steered: it flies where we send it, and hears us.
        returns: its autopilot flies home and lands.
        claim: what it waits for.
        system_id: its MAVLink system id; None: not heard yet.
        ended: its mission has.
        home_amsl_m: how high home is above the sea, by its autopilot; NaN: not told.
    """

    name: str
    place: LatLon
    up_m: float
    stands: LatLon
    home: LatLon
    return_up_m: float
    speed_mps: float
    goals: tuple[LatLon, ...] = ()
    goals_up_m: tuple[float, ...] = ()
    age_s: float = 0.0
    in_air: bool = True
    steered: bool = True
    returns: bool = False
    claim: Claim | None = None
    system_id: int | None = None
    ended: bool = False
    home_amsl_m: float = math.nan

    def sent(self, point: LatLon, up_m: float) -> Other:
        """The same aircraft, once it is sent to a point as well."""
        return replace(self, goals=(*self.goals, point), goals_up_m=(*self.goals_up_m, up_m))


def same(own: Other, other: Other) -> bool:
    """Whether another one is this aircraft, heard over a second link whose mission has ended for that: it has the same
    MAVLink system id, and is where this one is, or was when that was told."""
    if not other.ended or not own.system_id or other.system_id != own.system_id:
        return False
    flew_m = own.speed_mps * (abs(other.age_s - own.age_s) + LATE_S)
    return math.hypot(*offset_m(own.place, other.place)) <= SAME_M + flew_m


# ---- rooms


def rooms(other: Other, spacing: Spacing) -> tuple[Room, ...]:
    """Where an aircraft may be until it is told otherwise; none when it is on the ground.

    One that is not steered by us may be anywhere it can reach while we look. One that is not heard may be as far as it
    gets, at the heights of its leg; it may come down where its leg was, and its autopilot may fly it home. When it must
    have done so it is on the ground or hovers where its leg was, until no battery lasts that long. One that flies and
    has never told its place may be anywhere.
    """
    if not other.in_air or spacing.battery_s < other.age_s < math.inf:
        return ()
    path = _path(other)
    if other.age_s > spacing.fresh_s:
        if other.age_s > home_by_s(other, spacing):
            return (path,)
        far = replace(path, beyond_m=other.speed_mps * other.age_s)
        return far, replace(path, low_m=-math.inf), _way_home(other)
    if other.returns:
        return path, _way_home(other)
    if not other.steered:
        low, high = path.low_m - LOOK_S * spacing.descent_mps, path.high_m + LOOK_S * spacing.climb_mps
        return (Room(path.places, low, high, LOOK_S * other.speed_mps),)
    return (path,)


def home_by_s(other: Other, spacing: Spacing) -> float:
    """How long after it was last heard an aircraft that its autopilot brings home is on the ground; inf: not known."""
    away = math.hypot(*offset_m(other.place, other.home))
    up = max(other.up_m, other.return_up_m)
    takes = away / other.speed_mps + up / spacing.climb_mps + up / spacing.descent_mps
    return FAILSAFE_S + _SLOWER * takes if math.isfinite(takes) else math.inf


def wait_s(home: LatLon, home_m: float, others: Iterable[Other], spacing: Spacing) -> float:
    """Seconds that who lands at a place, `home_m` high, may have to wait there until the others are down before it.

    One that lands beside needs no waiting for. One that is heard comes down from as high as it is or goes; one that is
    not is over the place until its autopilot must have brought it home. Each goes before it once: who takes off again
    lets it land first.
    """
    seconds = 0.0
    for other in others:
        away = math.hypot(*offset_m(home, other.home))
        if not other.in_air or away >= spacing.separation_m + SLACK_M:
            continue
        if other.age_s > spacing.fresh_s:
            by = home_by_s(other, spacing) - other.age_s
            seconds += max(0.0, by) if math.isfinite(by) else 0.0
            continue
        tops = [up - home_m for up in (other.up_m, *other.goals_up_m) if math.isfinite(up)]
        seconds += max(0.0, *tops) / spacing.descent_mps + SETTLES_S if tops else SETTLES_S
    return seconds


def _path(other: Other) -> Room:
    heights = other.up_m, *other.goals_up_m
    known = all(math.isfinite(height) for height in heights)
    low, high = (min(heights), max(heights)) if known else (-math.inf, math.inf)
    swung = (_swung(other, goal) for goal in other.goals)
    return Room((other.place, other.stands, *other.goals, *swung), low, high)


def _swung(other: Other, goal: LatLon) -> LatLon:
    """As far beyond a goal, or beside it, as what it is carried on with now leads: of the part that leads to the goal
    only what is longer than the way, as it brakes for its goal by itself. So the room of a leg does not grow while the
    leg is flown."""
    east, north = offset_m(other.place, other.stands)
    x, y = offset_m(other.place, goal)
    length = math.hypot(x, y)
    if not length > 0.0:
        return moved(goal, east, north)
    along = min(max(0.0, (east * x + north * y) / length), length) / length
    return moved(goal, east - along * x, north - along * y)


def _way_home(other: Other) -> Room:
    """All of the way, from the ground to as high as its autopilot climbs for it."""
    top = max(other.up_m, other.return_up_m)
    return Room((other.place, other.stands, other.home), -math.inf, top if math.isfinite(top) else math.inf)


def between_m(a: Room, b: Room) -> float:
    """Metres on the ground between two rooms; 0 where they touch, and where one of the places is not known."""
    places = [*a.places, *b.places]
    if not all(math.isfinite(value) for place in places for value in place):
        return 0.0
    flat = [offset_m(places[0], place) for place in places]
    split = len(a.places)
    first, second = shapely.MultiPoint(flat[:split]), shapely.MultiPoint(flat[split:])
    metres = float(shapely.distance(shapely.convex_hull(first), shapely.convex_hull(second)))
    return max(0.0, metres - a.beyond_m - b.beyond_m)


def gap_m(a: Room, b: Room) -> float:
    """Metres of height between two rooms; less than 0 where they share heights."""
    return max(a.low_m - b.high_m, b.low_m - a.high_m)


# ---- what speaks against it


def objection(own: Other, wanted: Other, others: Iterable[Other], spacing: Spacing) -> str:
    """Why an aircraft must not do as `wanted` (itself, with another leg), as a sentence's end, or nothing.

    It may always do what brings it no nearer than it is to one that is heard. A room that another one waits for it may
    leave, not enter.
    """
    for other in others:
        for theirs in rooms(other, spacing):
            metres = _too_near_m(own, wanted, theirs, spacing)
            if math.isfinite(metres) and not (metres == 0.0 and _leaves(own, wanted, other, spacing)):
                return _said(metres, other, spacing)
        for room in awaited(own, (other,)):
            held = any(_clash(each, room, spacing) for each in rooms(own, spacing))
            if not held and any(_clash(each, room, spacing) for each in rooms(wanted, spacing)):
                assert other.claim is not None
                return f"leads through where {called(other)} waits to {other.claim.to}"
    return ""


def awaited(own: Other, others: Iterable[Other]) -> list[Room]:
    """The rooms that those with a better right wait for."""
    mine = _right(own), own.name
    return [
        other.claim.room for other in others if other.claim is not None and (_right(other), other.name) < mine
    ]


def stands_in(own: Other, room: Room, spacing: Spacing) -> bool:
    """Whether an aircraft that stays where it is leaves no room there."""
    return _clash(_standing(own), room, spacing)


def near(own: Other, others: Iterable[Other], spacing: Spacing) -> str:
    """Why an aircraft must stop at once, or nothing.

    It must when with what both still fly before they stand they come nearer than the separation, and its own part of
    that brings them nearer: who only hovers stays as it is. So of two that both come nearer both stop, and neither
    relies on the other.
    """
    ours = _standing(own)
    here = replace(ours, places=(own.place,))
    for other in others:
        if not other.in_air:
            continue
        unheard = other.age_s > spacing.fresh_s
        for theirs in rooms(other, spacing) if unheard else (_standing(other),):
            metres = between_m(ours, theirs) if gap_m(ours, theirs) < spacing.gap_m else math.inf
            if metres < spacing.separation_m and (
                metres == 0.0 or metres < between_m(here, theirs) - ERODES_M
            ):
                return _said(metres, other, spacing)
    return ""


def called(other: Other) -> str:
    """How a sentence names it."""
    return f"aircraft {other.name}"


def _standing(other: Other) -> Room:
    """Where it is and comes to a stand; as much around that as it has flown since its place was told."""
    up = other.up_m
    low, high = (up, up) if math.isfinite(up) else (-math.inf, math.inf)
    flies = math.hypot(*offset_m(other.place, other.stands)) > STILL_M
    return Room((other.place, other.stands), low, high, other.speed_mps * other.age_s if flies else 0.0)


def _clash(a: Room, b: Room, spacing: Spacing) -> bool:
    return gap_m(a, b) < spacing.gap_m and between_m(a, b) < spacing.separation_m + SLACK_M


def _leaves(own: Other, wanted: Other, other: Other, spacing: Spacing) -> bool:
    """Whether one that is inside the room of another that is heard comes no nearer to that one itself."""
    inside = any(
        gap_m(room, theirs) < spacing.gap_m and between_m(room, theirs) == 0.0
        for room in rooms(own, spacing)
        for theirs in rooms(other, spacing)
    )
    if not inside or other.age_s > spacing.fresh_s:
        return False
    return not math.isfinite(_too_near_m(own, wanted, _standing(other), spacing))


def _too_near_m(own: Other, wanted: Other, theirs: Room, spacing: Spacing) -> float:
    """How near `wanted` comes to a room that it must not come as near to; inf: it does not.

    Who is nearer already than the separation may fly away: out of it at once, and nowhere nearer than if it stopped.
    """
    clashes = [room for room in rooms(wanted, spacing) if _clash(room, theirs, spacing)]
    if not clashes:
        return math.inf
    nearest = min(between_m(room, theirs) for room in clashes)
    stopped = _standing(own)
    shares = own.in_air and gap_m(stopped, theirs) < spacing.gap_m
    now = between_m(stopped, theirs) if shares else math.inf
    least = min(spacing.separation_m + SLACK_M, now - ERODES_M)
    if now >= spacing.separation_m:
        least = max(least, spacing.separation_m)
    may = now > 0.0 and nearest >= least and _leads_out(own, wanted, theirs, spacing)
    return math.inf if may else nearest


def _leads_out(own: Other, wanted: Other, theirs: Room, spacing: Spacing) -> bool:
    """Whether what is wanted leads away from a room by at least half of its way, until it is apart: who has come near
    to one end of where another flies must not fly along all of that."""
    to = wanted.home if wanted.returns else wanted.goals[-1]
    away, length = _from_m(own.place, theirs), math.hypot(*offset_m(own.place, to))
    way = min(length, 2.0 * (spacing.separation_m - away))
    if not way > 0.0:
        return True
    east, north = offset_m(own.place, to)
    there = moved(own.place, east * way / length, north * way / length)
    return _from_m(there, theirs) >= away + 0.5 * way - ERODES_M


def _from_m(place: LatLon, theirs: Room) -> float:
    return between_m(Room((place,), 0.0, 0.0), theirs)


def _right(other: Other) -> int:
    """Whose turn it is; the least goes first: who waits to get home, to take off, to search on, who does not wait."""
    claim = other.claim
    if claim is None:
        return 3
    return 0 if claim.urgent else 1 + claim.searches


def _said(metres: float, other: Other, spacing: Spacing) -> str:
    if other.age_s > spacing.fresh_s:
        heard = (
            f"has not been heard for {other.age_s:.0f} s"
            if math.isfinite(other.age_s)
            else "flies and has never told its place"
        )
        return f"may come near {called(other)}, which {heard}"
    return (
        f"comes within {metres:.0f} m of where {called(other)} is or goes, nearer than {spacing.separation_m:g} m, and "
        f"not {spacing.gap_m:g} m above or below it"
    )
