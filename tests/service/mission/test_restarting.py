"""What comes up after a restart: as the process before it left the aircraft, or as a person has had it since."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from service.mavlink.events import ArmedChanged, Home, ModeChanged
from service.mavlink.modes import ModeKind
from service.mission.departing import AS_LEFT
from service.mission.effects import (
    Answer,
    Arm,
    EnterGuided,
    ReturnToLaunch,
    SendWaypoint,
    Stop,
    TakeOff,
    Tell,
    WaitReady,
)
from service.mission.flight import Flight
from service.mission.news import Order
from service.mission.phase import RETRY_S
from service.mission.standing import Standing
from service.mission.states import Event, State
from service.rows import TransitionRow
from tests.service.mission.flown import LEFT_US, ON_GROUND, Talk, place
from tests.service.mission.test_departing import MOVES, STEPS, at_once

LAST = Standing(state=State.RETURNING, why_stopped="searched to POS 97.0 %", searched=True)


def test_a_run_that_was_on_its_way_home_does_not_take_off_again() -> None:
    talk = Talk(may_take_off=True, standing=LAST, **ON_GROUND)
    talk.tick()
    talk.done()
    talk.tick()
    talk.tick()
    talk.tick()
    assert talk.state == State.RETURNING
    assert not [effect for effect in talk.wanted if effect in STEPS[1:]]
    assert (talk.core.standing.why_stopped, talk.core.standing.searched) == ("searched to POS 97.0 %", True)


@pytest.mark.parametrize("ours", [True, False])
def test_a_run_that_was_on_its_way_home_goes_on_home_or_waits_for_who_flies(ours: bool) -> None:
    talk = Talk(standing=LAST, **({} if ours else LEFT_US))
    talk.tick()
    talk.done()
    talk.pass_by(3.0)
    if ours:
        assert talk.doing() == EnterGuided()
        talk.done()
    else:
        assert (talk.state, talk.core.doing) == (State.READY, None)
        talk.shows(**ON_GROUND)
        talk.tick()
    assert talk.state == State.RETURNING


@pytest.mark.parametrize("left", [State.RETURNING, State.FOUND])
def test_a_run_that_was_on_its_way_home_ends_when_the_autopilot_disarms_down_there(left: State) -> None:
    """Whichever is told first: that it is disarmed, or that it stands."""
    talk = Talk(may_take_off=True, standing=Standing(state=left), **LEFT_US)
    talk.tick()
    talk.done()
    talk.pass_by(1.0)
    talk.on(ArmedChanged(talk.now, armed=False, commanded=False))
    talk.shows(**ON_GROUND)
    talk.pass_by(1.0)
    assert talk.state == State.DONE


def test_whoever_took_the_aircraft_after_a_restart_may_land_it_before_anything_else_is_told() -> None:
    talk = Talk(standing=Standing(state=State.HOLDING, why="an operator ordered it"))
    talk.tick()
    talk.done()
    talk.pass_by(1.0)
    talk.shows(**ON_GROUND)
    talk.pilot("LAND")
    talk.pass_by(1.0)
    assert talk.state == State.DONE


def restarted(left: State, *, flown_s: float = 60.0, **changes: Any) -> Talk:
    """A mission that goes on with a run that an earlier process left like this, after so many seconds in the air."""
    flight = Flight(flown=flown_s > 0.0, carried_s=flown_s, steps=7, left_at=990.0 if flown_s else 0.0)
    standing = Standing(state=left, why="the pilot or the autopilot selected LOITER")
    talk = Talk(may_take_off=True, standing=standing, flight=flight, **{"in_control": False, **changes})
    talk.tick()
    talk.done()
    talk.pass_by(5.0)
    return talk


@pytest.mark.parametrize("where", [{}, ON_GROUND, {"guided": False, "mode": "LOITER"}])
def test_a_restart_comes_up_yielded_as_it_was_and_moves_nothing(where: dict[str, Any]) -> None:
    talk = restarted(State.YIELDED, **where)
    assert talk.state == State.YIELDED
    assert talk.core.standing.why == f"{AS_LEFT}: the pilot or the autopilot selected LOITER"
    talk.pass_by(60.0)
    assert not [effect for effect in talk.wanted if isinstance(effect, MOVES)]


def test_a_restart_comes_up_holding_as_it_was_and_waits_for_resume() -> None:
    talk = restarted(State.HOLDING)
    assert (talk.state, talk.core.standing.causes) == (State.HOLDING, {"operator"})
    assert talk.doing() == EnterGuided()  # in which it hovers already: this takes control, and moves nothing
    talk.shows(in_control=True)
    talk.done()
    talk.pass_by(120.0)
    assert talk.state == State.HOLDING
    assert not [effect for effect in talk.wanted if isinstance(effect, (SendWaypoint, Arm, TakeOff, Stop))]
    talk.on(Order("resume"))
    assert talk.state == State.SEARCHING


BRAKED = {"guided": False, "stopped": True, "mode": "BRAKE"}


def test_a_restart_has_in_hand_what_was_stopped_without_a_position_and_sends_it_home_in_time() -> None:
    """An ArduCopter stands in a mode of its own then, and hovered there until its battery was empty."""
    talk = restarted(State.HOLDING, **BRAKED)
    assert talk.doing() == EnterGuided(there=True)  # stays where it is, in that mode
    talk.failed("it was not heard", answered=False)
    talk.pass_by(RETRY_S + 1.0)
    assert talk.doing() == EnterGuided(there=True)
    talk.shows(in_control=True)
    talk.done()
    talk.pass_by(60.0)
    assert talk.state == State.HOLDING
    assert not [effect for effect in talk.wanted if isinstance(effect, (SendWaypoint, Arm, TakeOff, Stop))]
    talk.shows(battery_percent=18.0)
    talk.pass_by(6.0)
    assert (talk.state, talk.doing()) == (State.RETURNING, ReturnToLaunch())


@pytest.mark.parametrize("sticks", [0.0, 0.5])
def test_an_operators_return_takes_what_a_restart_found_in_another_mode_if_no_hand_is_on_the_sticks(
    sticks: float,
) -> None:
    talk = restarted(State.HOLDING, guided=False, mode="LOITER", sticks=sticks)
    assert talk.core.doing is None
    did = talk.on(Order("return", 7))
    if sticks:
        assert "sticks" in next(each.refused for each in did if isinstance(each, Answer))
        assert talk.core.doing is None
        return
    assert talk.doing() == EnterGuided()
    talk.shows(in_control=True, guided=True, mode="GUIDED")
    talk.done()
    assert talk.state == State.RETURNING


@pytest.mark.parametrize("left", [State.SEARCHING, State.RETURNING])
@pytest.mark.parametrize("why_not", [{"fix": 1}, BRAKED], ids=["in doubt", "in BRAKE"])
def test_what_was_left_in_the_air_is_not_left_hovering_until_its_battery_is_empty(
    left: State, why_not: dict[str, Any]
) -> None:
    """Its position is in doubt after the restart, or its mode is not the search's; but it has to come home."""
    talk = restarted(left, **why_not)
    talk.pass_by(60.0)
    assert (talk.state, talk.core.doing) == (State.READY, None)
    talk.shows(battery_percent=18.0)
    talk.tick()
    assert talk.doing() == EnterGuided(there=True)
    talk.shows(in_control=True)
    talk.done()
    talk.pass_by(20.0)
    assert (talk.state, talk.doing()) == (State.RETURNING, ReturnToLaunch())


@pytest.mark.parametrize("left", [State.SEARCHING, State.RETURNING])
def test_who_ends_the_process_brings_home_what_it_has_found_in_the_air_or_leaves_it_to_its_pilot(
    left: State,
) -> None:
    """systemctl stop, in READY: it was answered and nothing done, and the search began as the position came back."""
    talk = restarted(left, fix=1)
    assert (talk.state, talk.core.doing) == (State.READY, None)
    talk.on(Order("home", 7))
    assert talk.doing() == EnterGuided()
    talk.shows(fix=3, in_control=True)
    talk.done()
    talk.tick()
    standing = talk.core.standing
    assert (standing.state, standing.settled, standing.searched) == (State.RETURNING, True, False)
    for where in ({"guided": False, "mode": "LOITER"}, ON_GROUND):
        talk = restarted(left, **where)
        talk.on(Order("home", 7))
        assert talk.state in (State.ABORTED, State.DONE)
        assert not [effect for effect in talk.wanted if isinstance(effect, MOVES)]


@pytest.mark.parametrize("hovers", [{}, {"fix": 1}], ids=["trusted", "in doubt"])
def test_what_flies_far_from_its_home_of_now_is_held_and_not_given_up(hovers: dict[str, Any]) -> None:
    """Home was moved in flight: the run was over with the restart, and the aircraft in nobody's hands."""
    talk = restarted(State.SEARCHING, home=Home(*place(2000.0, 2000.0), 400.0), **hovers)
    assert talk.state == State.HOLDING
    assert "launch point" in talk.core.standing.why
    assert talk.doing() == EnterGuided(there=True) if hovers else EnterGuided()


def test_a_restart_twice_over_does_not_forget_nor_repeat_itself() -> None:
    first = restarted(State.YIELDED)
    standing = replace(first.core.standing)
    talk = Talk(standing=standing, in_control=False)
    talk.tick()
    talk.done()
    talk.pass_by(1.0)
    assert talk.core.standing.why == f"{AS_LEFT}: the pilot or the autopilot selected LOITER"


@pytest.mark.parametrize(
    "left", [State.SEARCHING, State.CONFIRMING, State.TAKEOFF, State.YIELDED, State.HOLDING]
)
def test_after_a_flight_no_flag_takes_off_again_but_an_order_does(left: State) -> None:
    talk = restarted(left, **ON_GROUND)
    talk.pass_by(120.0)
    assert not [effect for effect in talk.wanted if isinstance(effect, (*MOVES, WaitReady))]
    talk.on(Order("launch", 7))
    assert talk.doing() == WaitReady()
    talk.done()
    talk.tick()
    assert (talk.state, talk.doing()) == (State.TAKEOFF, EnterGuided())


def test_before_the_first_flight_the_flag_is_the_order() -> None:
    talk = restarted(State.WAITING, flown_s=0.0, **ON_GROUND)
    assert talk.doing() == WaitReady()


def test_a_launch_is_refused_in_flight_and_without_leave_to_take_off() -> None:
    talk = restarted(State.YIELDED)
    (answer,) = [each for each in talk.on(Order("launch", 7)) if isinstance(each, Answer)]
    assert "on the ground" in answer.refused
    forbidden = Talk(**ON_GROUND)
    forbidden.tick()
    forbidden.done()
    forbidden.tick()
    (answer,) = [each for each in forbidden.on(Order("launch", 7)) if isinstance(each, Answer)]
    assert "--takeoff" in answer.refused
    assert forbidden.core.doing is None


def test_a_search_that_was_under_way_goes_on_where_the_aircraft_hovers_still() -> None:
    talk = restarted(State.SEARCHING)
    talk.done()
    assert talk.state == State.SEARCHING
    assert talk.core.flight.steps == 7
    assert talk.core.flight.seconds(talk.now) == pytest.approx(
        60.0 + talk.now - 990.0
    )  # it was in the air meanwhile


def test_the_limit_of_a_flight_is_counted_from_its_take_off() -> None:
    talk = restarted(State.SEARCHING, flown_s=7000.0, **ON_GROUND)
    talk.on(Order("launch"))
    talk.done()
    talk.tick()
    assert talk.core.flight.seconds(talk.now) >= 7000.0
    assert talk.core.flight.aloft_s(talk.now) < 1.0


@pytest.mark.parametrize(
    ("left", "command", "comes_up"),
    [
        (State.SEARCHING, "hold", State.HOLDING),
        (State.RETURNING, "hold", State.HOLDING),
        (State.SEARCHING, "return", State.RETURNING),
        (State.HOLDING, "return", State.RETURNING),
        (State.SEARCHING, "finish", State.RETURNING),
        (State.YIELDED, "hold", State.YIELDED),
        (State.YIELDED, "return", State.YIELDED),
    ],
)
def test_what_is_ordered_before_it_is_heard_again_in_the_air_is_done_then(
    left: State, command: str, comes_up: State
) -> None:
    flight = Flight(flown=True, carried_s=60.0, left_at=990.0)
    talk = Talk(may_take_off=True, standing=Standing(state=left), flight=flight, in_control=False)
    talk.tick()
    assert bool(at_once(talk, command)) == (left == State.YIELDED)
    talk.tick()
    talk.done()
    talk.pass_by(2.0)
    if talk.core.doing == EnterGuided(there=True):
        talk.shows(in_control=True)
        talk.done()
        talk.tick()
    assert talk.state == comes_up
    assert talk.core.standing.settled == (command == "finish")


def test_one_that_is_not_heard_when_the_search_is_over_for_all_flies_home_once_it_is() -> None:
    flight = Flight(flown=True, carried_s=60.0, left_at=990.0)
    talk = Talk(standing=Standing(state=State.SEARCHING), flight=flight, in_control=False)
    talk.sees(over="found")
    talk.pass_by(2.0)
    assert talk.state == State.WAITING
    linked_rows = [row for row in talk.rows if isinstance(row, TransitionRow)]
    assert [(row.event, row.after) for row in linked_rows] == [(Event.FINISH, State.WAITING)]
    talk.done()
    talk.pass_by(2.0)
    talk.shows(in_control=True)
    talk.done()
    talk.tick()
    assert (talk.state, talk.core.standing.settled) == (State.RETURNING, True)


def test_one_that_was_held_and_is_not_heard_when_the_search_is_over_for_all_stays_held() -> None:
    flight = Flight(flown=True, carried_s=60.0, left_at=990.0)
    talk = Talk(standing=Standing(state=State.HOLDING), flight=flight, in_control=False)
    talk.sees(over="found")
    talk.pass_by(2.0)
    assert not [row for row in talk.rows if isinstance(row, TransitionRow)]
    talk.done()
    talk.pass_by(2.0)
    assert (talk.state, talk.core.standing.settled) == (State.HOLDING, True)


def test_after_a_restart_who_takes_off_by_hand_as_ready_says_gives_the_aircraft_over() -> None:
    talk = Talk(may_take_off=True, **{**ON_GROUND, **LEFT_US, "mode": "STABILIZE"})
    talk.core.terms = replace(talk.core.terms, restarted=True)
    talk.tick()
    talk.done()
    talk.pass_by(3.0)
    assert Tell("search READY: order launch, or take off and select the guided mode") in talk.wanted
    talk.pilot("LOITER")
    talk.shows(armed=True, landed_state="in_air", alt_home_m=15.0, alt_amsl_m=415.0)
    talk.pass_by(2.0)
    talk.shows(mode="GUIDED", guided=True)
    talk.on(ModeChanged(talk.now, "GUIDED", "LOITER", ModeKind.GUIDED, True, False, False))
    talk.pass_by(2.0)
    assert (talk.state, talk.doing()) == (State.READY, EnterGuided())
    talk.done()
    assert talk.state == State.SEARCHING
