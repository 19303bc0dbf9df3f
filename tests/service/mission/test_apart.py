"""Where aircraft may be, and that what is judged apart never meets."""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from itertools import combinations
from typing import Any

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from service.config import FlightSettings
from service.geometry import LatLon, moved
from service.mission.apart import (
    Claim,
    Other,
    Room,
    Spacing,
    between_m,
    home_by_s,
    near,
    objection,
    rooms,
)
from service.mission.traffic import brakes_at

FLIGHT = FlightSettings()
SPACING = Spacing.of(FLIGHT, 2.0)
HOME = (47.0, 8.0)
SPEED, CLIMB = 8.0, 2.0


def at(east: float, north: float) -> LatLon:
    """A place so many metres from home."""
    return moved(HOME, east, north)


def other(name: str, east: float, north: float, up: float = 30.0, **changes: Any) -> Other:
    """An aircraft that hovers."""
    place = at(east, north)
    return replace(Other(name, place, up, place, HOME, 60.0, SPEED), **changes)


def why(own: Other, goal: LatLon, *others: Other, up: float = 30.0) -> str:
    """What speaks against a leg."""
    return objection(own, own.sent(goal, up), others, SPACING)


OURS = other("b", 0.0, 0.0)


def test_a_leg_past_another_at_the_same_height_is_refused_and_the_sentence_says_all() -> None:
    said = why(OURS, at(100.0, 0.0), other("a", 60.0, 12.0))
    assert said == (
        "comes within 12 m of where aircraft a is or goes, nearer than 20 m, and not 7 m above or below it"
    )
    assert not why(OURS, at(100.0, 0.0), other("a", 60.0, 30.0))
    assert not why(OURS, at(30.0, 0.0), other("a", 60.0, 12.0))


def test_a_leg_in_another_layer_crosses_as_it_likes_and_one_that_changes_layers_does_not() -> None:
    crossing = other("a", 60.0, 0.0, up=40.0).sent(at(0.0, 60.0), 40.0)
    assert not why(OURS, at(100.0, 0.0), crossing)
    assert why(OURS, at(100.0, 0.0), crossing, up=45.0)
    assert why(OURS, at(100.0, 0.0), replace(crossing, goals_up_m=(20.0,)))


def test_where_the_other_goes_counts_and_not_only_where_it_is() -> None:
    far = other("a", 200.0, 100.0)
    assert not why(OURS, at(100.0, 0.0), far)
    assert why(OURS, at(100.0, 0.0), far.sent(at(50.0, 10.0), 30.0))
    assert why(OURS, at(100.0, 0.0), replace(far, stands=at(60.0, 5.0)))


def test_our_own_stopping_distance_counts() -> None:
    past = other("a", 60.0, 60.0)
    assert not why(OURS, at(60.0, 0.0), past)
    assert why(replace(OURS, stands=at(0.0, 40.0)), at(60.0, 0.0), past)  # it swings past (60, 0) on its way


def test_who_is_on_the_ground_is_in_nobodys_way() -> None:
    assert not why(OURS, at(100.0, 0.0), other("a", 60.0, 0.0, in_air=False))


def test_a_leg_that_comes_no_nearer_than_it_is_may_be_flown() -> None:
    """Who has come too near to another is not nailed to the spot."""
    close = other("a", 10.0, 0.0)
    assert not why(OURS, at(-50.0, 0.0), close)
    assert why(OURS, at(5.0, 0.0), close)
    above = close.sent(at(-100.0, 0.0), 30.0)  # and its leg leads over us
    assert not why(OURS, at(-50.0, 50.0), above)
    assert why(OURS, at(5.0, 0.0), above)


def test_who_crosses_another_in_its_own_layer_is_not_inside_that_ones_room() -> None:
    crossing = other("a", 60.0, -50.0, up=40.0).sent(at(60.0, 50.0), 40.0)
    assert why(OURS.sent(at(100.0, 0.0), 30.0), at(120.0, 0.0), crossing, up=38.0)


def test_an_old_position_is_the_last_leg_and_a_circle_that_grows() -> None:
    silent = other("a", 400.0, 0.0).sent(at(400.0, 50.0), 30.0)
    seen = replace(silent, age_s=1.0)
    assert not why(OURS, at(0.0, 100.0), seen)
    assert not why(OURS, at(0.0, 100.0), replace(silent, age_s=10.0, home=at(400.0, -50.0)))
    said = why(OURS, at(0.0, 100.0), replace(silent, age_s=50.0, home=at(400.0, -50.0)))
    assert said == "may come near aircraft a, which has not been heard for 50 s"


def test_a_silent_aircraft_may_be_flown_home_by_its_autopilot_through_all_layers_below_its_height() -> None:
    silent = other("a", 300.0, 0.0, age_s=5.0, home=at(0.0, 0.0))
    across = at(150.0, -60.0)
    for up, refused in [(10.0, True), (30.0, True), (66.0, True), (67.0, False)]:
        ours = other("b", 150.0, 60.0, up=up)
        assert bool(why(ours, across, silent, up=up)) == refused, up
    after = replace(silent, age_s=home_by_s(silent, SPACING) + 1.0)
    assert not why(other("b", 150.0, 60.0), across, after)
    assert why(other("b", 300.0, 60.0), at(300.0, -60.0), after)  # it may hover there still
    assert not why(other("b", 300.0, 60.0), at(300.0, -60.0), replace(silent, age_s=SPACING.battery_s + 1.0))


@pytest.mark.parametrize("fields", [{"place": (math.nan, math.nan)}, {"stands": (47.0, math.nan)}])
def test_a_place_that_is_not_known_speaks_against_everything(fields: dict[str, Any]) -> None:
    assert why(OURS, at(100.0, 0.0), replace(other("a", 9000.0, 0.0), **fields))


def test_a_height_that_is_not_known_is_every_height() -> None:
    assert why(OURS, at(100.0, 0.0), other("a", 60.0, 0.0, up=math.nan))
    assert why(replace(OURS, up_m=math.nan), at(100.0, 0.0), other("a", 60.0, 0.0, up=90.0))


def test_whom_its_pilot_flies_may_go_anywhere_it_can_reach_while_we_look() -> None:
    taken = other("a", 0.0, 90.0, steered=False)
    assert why(OURS, at(40.0, 60.0), taken)
    assert not why(OURS, at(40.0, 60.0), replace(taken, steered=True))


def test_a_landing_needs_the_column_down_to_the_ground() -> None:
    over_home = other("b", 0.0, 0.0, up=50.0)
    lands = replace(over_home, returns=True, return_up_m=0.0)
    below = other("a", 10.0, 0.0, up=30.0)
    assert objection(over_home, lands, (below,), SPACING)
    assert not objection(over_home, lands, (replace(below, in_air=False),), SPACING)
    assert why(other("a", 100.0, 0.0, up=10.0), at(0.0, 0.0), lands, up=10.0)


def test_a_room_that_is_waited_for_may_be_left_and_not_be_entered() -> None:
    column = Room((at(0.0, 0.0),), -math.inf, 50.0)
    waits = other("c", 0.0, 0.0, up=50.0, claim=Claim(column, urgent=True, to="land"))
    assert why(other("a", 90.0, 0.0), at(10.0, 0.0), waits) == "leads through where aircraft c waits to land"
    assert not why(other("a", 10.0, 0.0), at(90.0, 0.0), waits)
    urgent = replace(other("a", 90.0, 0.0), claim=Claim(column, urgent=True, to="land"))
    assert not why(urgent, at(10.0, 0.0), waits)  # of two that fly home the first by name
    taking_off = replace(waits, claim=Claim(column, urgent=False, to="take off"), up_m=0.0)
    for name in "ad":  # who searches waits for nothing
        assert why(other(name, 90.0, 0.0), at(10.0, 0.0), taking_off)
    for name, refused in [("a", False), ("d", True)]:
        waiting = replace(other(name, 90.0, 0.0), claim=Claim(column, urgent=False, to="take off"))
        assert bool(why(waiting, at(10.0, 0.0), taking_off)) == refused
    assert not why(urgent, at(10.0, 0.0), taking_off)


def test_of_two_that_come_too_near_both_stop_and_one_that_hovers_stays() -> None:
    first = other("a", 0.0, 0.0, stands=at(30.0, 0.0))
    second = other("b", 60.0, 0.0, stands=at(40.0, 0.0))
    assert near(second, (first,), SPACING)
    assert near(first, (second,), SPACING)
    hovers = replace(second, stands=second.place)
    assert not near(hovers, (replace(first, stands=at(45.0, 0.0)),), SPACING)
    assert near(replace(first, stands=at(45.0, 0.0)), (hovers,), SPACING)
    assert not near(replace(second, up_m=40.0), (first,), SPACING)


def test_what_an_aircraft_has_flown_since_its_place_was_told_counts_before_it_is_old() -> None:
    """Telemetry comes a few times a second, and later on a bad link: so much nearer it may be than it is shown."""
    first = other("a", 0.0, 0.0, stands=at(10.0, 0.0))
    second = other("b", 50.0, 0.0, stands=at(40.0, 0.0))
    assert not near(first, (second,), SPACING)
    assert near(first, (replace(second, age_s=1.5),), SPACING)
    assert near(replace(first, age_s=1.5), (second,), SPACING)
    assert not near(first, (replace(second, stands=second.place, age_s=1.5),), SPACING)  # it hovers


def test_the_room_of_a_leg_does_not_grow_while_it_is_flown() -> None:
    """It brakes for its goal by itself, however fast it is by then: who hovers beyond is not in its way."""
    starts = other("a", 0.0, 0.0).sent(at(90.0, 0.0), 30.0)
    (leg,) = rooms(starts, SPACING)
    for east in (10.0, 30.0, 50.0, 54.0):
        (now,) = rooms(replace(starts, place=at(east, 0.0), stands=at(east + 36.0, 0.0)), SPACING)
        beyond = other("b", 120.0, 0.0)
        assert between_m(now, rooms(beyond, SPACING)[0]) >= between_m(leg, rooms(beyond, SPACING)[0]) - 0.1
    (aside,) = rooms(replace(starts, stands=at(0.0, 36.0)), SPACING)  # what leads beside the way does count
    assert between_m(aside, rooms(other("b", 90.0, 50.0), SPACING)[0]) < 15.0


def test_who_has_come_near_to_the_end_of_anothers_leg_may_not_fly_along_it() -> None:
    leg = other("a", 0.0, 0.0).sent(at(100.0, 0.0), 30.0)
    close = other("b", 100.0, 15.0)
    assert why(close, at(0.0, 15.0), leg)
    assert why(close, at(20.0, 40.0), leg)  # not steep enough to be out of it soon
    assert not why(close, at(120.0, 80.0), leg)
    assert not why(close, at(90.0, 60.0), leg)


def test_who_stands_or_flies_away_need_not_stop() -> None:
    assert not near(other("b", 10.0, 0.0), (other("a", 0.0, 0.0),), SPACING)
    assert not near(other("b", 10.0, 0.0, stands=at(30.0, 0.0)), (other("a", 0.0, 0.0),), SPACING)


# ---- the law: what passes the check never meets


STEP_S = 0.2
BRAKES = (
    0.9  # m/s2 that stopping distances are reckoned with; every simulated aircraft brakes half as hard again
)
REACTION_S = 0.5


@dataclass
class Flyer:
    """An aircraft that flies to where it was sent, some time after it was, and brakes for it; metres, m/s."""

    name: str
    x: float
    y: float
    up: float
    brakes: float
    vx: float = 0.0
    vy: float = 0.0
    goal: tuple[float, float, float] | None = None
    ordered: list[tuple[float, tuple[float, float, float] | None]] = field(default_factory=list)

    def seen(self) -> Other:
        """As the others see it: with what it was sent, and what it still flies to."""
        speed = math.hypot(self.vx, self.vy)
        coasts = speed / (2.0 * BRAKES) + REACTION_S
        goals = [goal for goal in (self.goal, *(order for _, order in self.ordered)) if goal is not None]
        points = tuple(at(x, y) for x, y, _ in goals)
        here, stands = at(self.x, self.y), at(self.x + coasts * self.vx, self.y + coasts * self.vy)
        return Other(
            self.name,
            here,
            self.up,
            brakes_at(here, stands, points),
            HOME,
            60.0,
            SPEED,
            points,
            tuple(up for *_, up in goals),
        )

    def fly(self, now: float) -> None:
        """One step."""
        while self.ordered and self.ordered[0][0] <= now:
            self.goal = self.ordered.pop(0)[1]
        x, y, up = self.goal or (self.x, self.y, self.up)
        away = math.hypot(x - self.x, y - self.y)
        speed = min(SPEED, math.sqrt(2.0 * self.brakes * away), away / STEP_S) if self.goal else 0.0
        wx, wy = (speed * (x - self.x) / away, speed * (y - self.y) / away) if away > 0.0 else (0.0, 0.0)
        turn = math.hypot(wx - self.vx, wy - self.vy)
        share = min(1.0, self.brakes * STEP_S / turn) if turn > 0.0 else 0.0
        self.vx, self.vy = self.vx + share * (wx - self.vx), self.vy + share * (wy - self.vy)
        self.x, self.y = self.x + self.vx * STEP_S, self.y + self.vy * STEP_S
        self.up += min(max(up - self.up, -CLIMB * STEP_S), CLIMB * STEP_S)


def apart_m(a: Flyer, b: Flyer) -> float:
    """Metres between two on the ground; inf while the one is well above the other."""
    if abs(a.up - b.up) >= SPACING.gap_m:
        return math.inf
    return math.hypot(a.x - b.x, a.y - b.y)


Judge = Callable[[Other, Other, tuple[Other, ...]], str]


def judged(own: Other, wanted: Other, others: tuple[Other, ...]) -> str:
    """The judge of the service."""
    return objection(own, wanted, others, SPACING)


def nearest_m(draw: random.Random, judge: Judge) -> float:
    """The nearest that two of three aircraft come that are sent where the judge lets them, and stopped at any time."""
    flyers = [
        Flyer(name, 60.0 * n, 0.0, 30.0 + 8.0 * n, BRAKES * draw.uniform(1.5, 4.0))
        for n, name in enumerate("abc")
    ]
    nearest = math.inf
    for step in range(300):
        now = step * STEP_S
        own = draw.choice(flyers)
        if draw.random() < 0.15:
            goal = (
                draw.uniform(-60.0, 160.0),
                draw.uniform(-80.0, 80.0),
                draw.choice((30.0, 34.0, 38.0, 46.0)),
            )
            seen = own.seen()
            others = tuple(each.seen() for each in flyers if each is not own)
            if not judge(seen, seen.sent(at(*goal[:2]), goal[2]), others):
                last = own.ordered[-1][0] if own.ordered else now
                own.ordered.append((max(last, now + draw.uniform(0.0, 1.0)), goal))
        elif draw.random() < 0.02:
            own.ordered, own.goal = [], None
        for each in flyers:
            each.fly(now)
        nearest = min([nearest, *(apart_m(a, b) for a, b in combinations(flyers, 2))])
    return nearest


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32))
@example(974)  # where one end of a leg is passed by somebody who then flies along it
def test_nothing_that_is_let_through_ever_comes_nearer_than_the_separation(seed: int) -> None:
    assert nearest_m(random.Random(seed), judged) >= SPACING.separation_m


def test_where_nobody_judges_they_do_meet() -> None:
    """The law above can fail: the same flights, each time with a part of the judge left out."""

    def nobody(own: Other, wanted: Other, others: tuple[Other, ...]) -> str:
        return ""

    def places_alone(own: Other, wanted: Other, others: tuple[Other, ...]) -> str:
        return judged(own, wanted, tuple(replace(each, goals=(), goals_up_m=()) for each in others))

    for judge in (nobody, places_alone):
        assert min(nearest_m(random.Random(seed), judge) for seed in range(20)) < SPACING.separation_m, judge
