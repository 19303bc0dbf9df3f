"""From decision to decision: when the planner is asked, what is sent, and what a hit changes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from roisearch import Motion
from service.evidence.found import Found
from service.ground.relief import Relief
from service.mavlink.events import Stalled
from service.mission.effects import DropThought, Passed, Reckon, SendWaypoint, SetSpeed, Tell, Think
from service.mission.heights import Leg
from service.mission.news import Hit, Judged
from service.mission.searching import DOUBTED_S, Levelling
from service.mission.states import State
from service.motion import MotionLimits
from service.rows import TransitionRow
from tests.service.mission.flown import GRID, HERE, Talk, place, reached, searching, telemetry


def thoughts(talk: Talk) -> list[Think]:
    """What the planner was asked so far."""
    return [effect for effect in talk.wanted if isinstance(effect, Think)]


def test_the_speed_is_set_before_the_first_waypoint() -> None:
    talk = reached(State.SEARCHING)
    talk.tick()
    assert talk.doing() == SetSpeed(8.0)
    talk.pass_by(5.0)
    assert not thoughts(talk)
    talk.failed("it answered DENIED")  # which is told, and no reason not to search
    talk.tick()
    talk.tick()
    assert len(thoughts(talk)) == 1


def test_what_the_parameters_allow_is_told_before_the_first_decision() -> None:
    talk = reached(State.SEARCHING, most_speed_mps=6.0)
    talk.tick()
    talk.tick()
    assert [each.limits for each in talk.wanted if isinstance(each, Reckon)] == [MotionLimits(6.0, None)]
    assert not thoughts(talk)
    talk.shows(most_acceleration_mps2=1.5)
    talk.tick()
    assert [each.limits for each in talk.wanted if isinstance(each, Reckon)][1:] == [MotionLimits(6.0, 1.5)]


def test_a_place_that_waits_for_a_person_is_hovered_over_and_not_circled_for_ever() -> None:
    talk, why = (
        searching(),
        "the detector reported the target everywhere; a person has to confirm what it finds",
    )
    talk.sees(place_probability=0.999, doubt=why)
    talk.pass_by(DOUBTED_S - 5.0)
    assert talk.state == State.CONFIRMING
    talk.sees(doubt="")  # a few looks in vain
    talk.pass_by(10.0)
    talk.sees(doubt=why)
    talk.pass_by(DOUBTED_S - 5.0)
    assert talk.state == State.CONFIRMING
    talk.pass_by(10.0)
    assert (talk.state, talk.core.standing.why) == (State.HOLDING, why)
    assert Tell(f"search HOLDING: {why}") in talk.wanted
    talk.sees(doubt="", place_probability=0.01)  # the person rejects it
    talk.pass_by(1.0)
    assert talk.state == State.SEARCHING


def test_what_a_person_confirms_while_it_is_waited_for_is_found() -> None:
    talk = searching()
    talk.sees(place_probability=0.999, doubt="a person has to confirm what it finds")
    talk.pass_by(DOUBTED_S + 5.0)
    assert talk.state == State.HOLDING
    found = Found(*HERE, 0.999, 10.0, {})
    talk.sees(found=found, confirmed=True, doubt="")
    talk.on(Judged(confirmed=True, found=found, ticket=7))
    assert talk.state == State.FOUND


def test_it_flies_to_the_area_first() -> None:
    lat, lon = place(-40.0, 30.0)
    talk = reached(State.SEARCHING, lat=lat, lon=lon)
    talk.tick()
    talk.done()
    talk.tick()
    waypoint = talk.doing()
    assert isinstance(waypoint, SendWaypoint)
    assert waypoint.on_way
    assert not thoughts(talk)


def test_a_decision_is_sent_and_the_next_one_asked_for_in_time() -> None:
    talk = searching()
    (row, col), _ = talk.core.chart.cell(talk.seen.telemetry)
    talk.tick()
    (asked,) = thoughts(talk)
    assert asked.cell == (row, col)
    talk.decides((row - 1, col), (row - 2, col))
    waypoint = talk.doing()
    assert isinstance(waypoint, SendWaypoint)
    assert talk.core.chart.cell(talk.seen.telemetry)[0] == (row, col)
    talk.core.sent(waypoint)
    talk.done()
    assert talk.core.flight.waypoints == 1
    assert talk.core.ahead(talk.seen)[0] == HERE
    lat, lon = waypoint.point
    talk.shows(lat=lat, lon=lon)
    talk.flew()
    talk.tick()
    assert len(thoughts(talk)) == 2
    assert talk.core.flight.steps == 1


def above_hills() -> Talk:
    """A search 30 m above ground whose heights are known, level here."""
    relief = Relief(np.zeros((110, 110)), 10.0, -400.0, -400.0, 10.0, 400.0)
    return searching(
        {"flight": {"altitude_m": 30.0}}, grid=replace(GRID, relief=relief), alt_home_m=30.0, alt_amsl_m=430.0
    )


def legs(talk: Talk) -> list[SendWaypoint]:
    """Where the aircraft was sent so far."""
    return [effect for effect in talk.wanted if isinstance(effect, SendWaypoint)]


@pytest.mark.parametrize(("up", "sinks"), [(60.0, True), (20.0, False)])
def test_over_a_cell_that_is_worth_a_look_it_changes_its_height_first(up: float, sinks: bool) -> None:
    """From 60 or 20 m above the ground, where 30 m is set, a look does not count: seen to circle for three hours."""
    talk = above_hills()
    (row, col), _ = talk.core.chart.cell(talk.seen.telemetry)
    talk.tick()
    talk.decides((row - 1, col), worth=[(row - 1, col)])
    talk.core.sent(legs(talk)[-1])
    talk.done()
    lat, lon = talk.core.chart.latlon((row - 1, col))
    talk.shows(lat=lat, lon=lon, alt_home_m=up, alt_amsl_m=400.0 + up)
    talk.flew()
    talk.tick()
    talk.decides((row - 1, col - 1))
    assert len(legs(talk)) == 2
    assert legs(talk)[-1].point == pytest.approx((lat, lon))
    assert legs(talk)[-1].altitude_m == pytest.approx(430.0)
    talk.core.sent(legs(talk)[-1])
    talk.done()
    asked = len(thoughts(talk))
    talk.pass_by(3.0)
    assert len(thoughts(talk)) == asked, "it waits for its height"
    talk.shows(alt_home_m=30.5, alt_amsl_m=430.5)
    talk.tick()
    assert thoughts(talk)[-1].cell == (row - 1, col)
    talk.decides((row - 1, col - 1))
    assert talk.core.chart.distance(legs(talk)[-1].point, (lat, lon)) > 15.0


def test_over_what_is_not_worth_a_look_it_flies_on_as_high_as_it_is() -> None:
    talk = above_hills()
    (row, col), _ = talk.core.chart.cell(talk.seen.telemetry)
    talk.tick()
    talk.decides((row - 1, col))
    talk.core.sent(legs(talk)[-1])
    talk.done()
    lat, lon = talk.core.chart.latlon((row - 1, col))
    talk.shows(lat=lat, lon=lon, alt_home_m=60.0, alt_amsl_m=460.0)
    talk.flew()
    talk.tick()
    talk.decides((row - 1, col - 1))
    assert talk.core.chart.distance(legs(talk)[-1].point, (lat, lon)) > 15.0


def test_a_hit_drops_what_was_thought_and_asks_at_once() -> None:
    talk = searching()
    talk.tick()
    did = talk.on(Hit((HERE,), arrived=5.0))
    assert DropThought() in did
    assert isinstance(did[-1], Think)
    (row, col), _ = talk.core.chart.cell(talk.seen.telemetry)
    talk.decides((row - 1, col))
    waypoint = talk.doing()
    assert isinstance(waypoint, SendWaypoint)
    assert waypoint.hit_at == 5.0
    assert talk.core.flight.hits == [HERE]


def test_what_was_thought_before_the_search_was_left_is_not_flown_after() -> None:
    talk = searching()
    talk.pilot()
    talk.decides((3, 3))
    assert talk.core.doing is None


def test_a_waypoint_that_may_have_been_lost_is_decided_anew_after_a_moment() -> None:
    talk = searching()
    talk.tick()
    (row, col), _ = talk.core.chart.cell(talk.seen.telemetry)
    talk.decides((row - 1, col))
    talk.done()
    asked = len(thoughts(talk))
    talk.on(Stalled(talk.now, 3.0))
    talk.tick()
    assert len(thoughts(talk)) <= asked + 1
    talk.pass_by(1.5)
    assert thoughts(talk)[-1].cell == (row, col)


@pytest.mark.parametrize(
    ("searched", "steps", "why"),
    [(1.0, 0, "searched to POS over 99.9 %"), (0.1, 40_000, "40000 steps flown")],
)
def test_a_search_ends_when_there_is_nothing_more_to_gain(searched: float, steps: int, why: str) -> None:
    talk = searching()
    talk.core.flight.steps = steps
    talk.sees(searched=searched)
    talk.tick()
    assert (talk.state, talk.core.standing.why_stopped) == (State.RETURNING, why)
    assert talk.core.standing.searched


def test_it_ends_at_what_the_search_can_see_and_not_while_a_suspect_can_be_looked_at_again() -> None:
    talk = searching()
    talk.sees(searched=0.7, enough=0.6, place_probability=0.8)
    talk.tick()
    assert talk.state == State.CONFIRMING
    talk.sees(place_in_sight=False)
    talk.tick()
    talk.tick()
    assert (talk.state, talk.core.standing.why_stopped) == (State.RETURNING, "searched to POS 70.0 %")
    assert "the place cannot be looked at from the air: it needs a ground team" in [
        row.reason for row in talk.rows if isinstance(row, TransitionRow)
    ]


def test_every_cell_that_is_entered_for_a_look_is_told_of_but_not_while_it_hovers() -> None:
    talk = searching({"sensor": {"hover_look_s": 2.0}})
    cell, _ = talk.core.chart.cell(talk.seen.telemetry)
    talk.tick()
    talk.tick()
    assert [each for each in talk.wanted if isinstance(each, Passed)] == [Passed(cell, "north")]
    talk.sees(place_probability=0.8, suspect_in_view=True)
    talk.pass_by(1.0)
    lat, lon = talk.core.chart.latlon((cell[0] - 1, cell[1]))
    talk.shows(lat=lat, lon=lon)
    talk.flew()
    talk.tick()
    assert talk.core.flight.cell == (cell[0] - 1, cell[1])
    assert len([each for each in talk.wanted if isinstance(each, Passed)]) == 1


def test_a_place_that_stands_out_is_confirmed_or_cleared() -> None:
    talk = searching()
    for probability, state in ((0.6, State.CONFIRMING), (0.4, State.CONFIRMING), (0.3, State.SEARCHING)):
        talk.sees(place_probability=probability)
        talk.tick()
        assert talk.state == state
    assert [row.reason for row in talk.rows if isinstance(row, TransitionRow)][-2:] == [
        "something at a place that is 60 % probable",
        "the place is no longer likely, 30 %",
    ]


def test_a_place_that_wavers_is_told_of_once() -> None:
    talk = searching()
    for probability in (0.67, 0.45, 0.67, 0.4, 0.6, 0.36, 0.67):
        talk.sees(place_probability=probability)
        talk.tick()
    told = [row.after for row in talk.rows if isinstance(row, TransitionRow)]
    assert told.count(State.CONFIRMING) == 1


def test_an_aircraft_taken_over_low_climbs_straight_up_first() -> None:
    talk = reached(State.SEARCHING, alt_home_m=3.0, alt_amsl_m=403.0)
    talk.tick()
    talk.done()
    talk.tick()
    waypoint = talk.doing()
    assert isinstance(waypoint, SendWaypoint)
    assert (waypoint.point, waypoint.altitude_m) == (HERE, 415.0)
    talk.core.sent(waypoint)
    talk.done()
    talk.shows(alt_home_m=8.0, alt_amsl_m=408.0)
    talk.pass_by(5.0)
    assert not thoughts(talk)
    talk.shows(alt_home_m=14.0, alt_amsl_m=414.0)
    talk.pass_by(1.0)
    assert len(thoughts(talk)) == 1


def test_a_climb_that_follows_another_at_once_is_over_when_the_aircraft_stands() -> None:
    """It coasts uphill while it climbs, and would have to climb again for ever."""
    fast = telemetry(alt_amsl_m=440.0, velocity_ned_mps=(0.0, 8.0, 0.0))
    still = telemetry(alt_amsl_m=440.0)
    climb, sink = Leg(440.0, climbs=True), Leg(440.0, sinks=True)
    for height in (climb, sink):
        assert Levelling(height, stands=False).done(fast)
        assert not Levelling(height, stands=True).done(fast)
        assert Levelling(height, stands=True).done(still)
    assert not Levelling(climb, stands=False).done(telemetry(alt_amsl_m=430.0))
    assert not Levelling(sink, stands=False).done(telemetry(alt_amsl_m=450.0))


def test_how_the_aircraft_brakes_is_flown_by_once_it_was_learnt() -> None:
    """One that brakes weakly begins to, far before its waypoint: what comes after it is decided before that."""
    talk = searching({"flight": {"altitude_m": 15.0, "deceleration_mps2": 3.0}})
    (row, col), _ = talk.core.chart.cell(talk.seen.telemetry)
    talk.tick()
    talk.decides((row - 1, col), (row - 2, col), (row - 3, col))
    talk.core.sent(legs(talk)[-1])
    talk.done()
    talk.tick()
    asked = len(thoughts(talk))
    talk.sees(motion=Motion(cell_m=20.0, braking_mps2=0.2))
    talk.tick()
    assert len(thoughts(talk)) == asked + 1
