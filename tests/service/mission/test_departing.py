"""Getting an aircraft into the air, or not: what is asked for last may end it between any two steps."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from service.mavlink.events import ArmedChanged, ModeChanged
from service.mavlink.modes import ModeKind
from service.mavlink.telemetry import Home
from service.mavlink.vehicle import climb_s
from service.mission.departing import AS_LEFT, LACKS_S
from service.mission.effects import (
    Answer,
    Arm,
    Connect,
    EnterGuided,
    Note,
    ReturnToLaunch,
    SendWaypoint,
    Stop,
    TakeOff,
    Tell,
    WaitReady,
    WriteRow,
)
from service.mission.flight import Flight
from service.mission.news import Order
from service.mission.phase import RETRY_S
from service.mission.standing import Standing
from service.mission.states import Event, State, next_state
from service.rows import CommandRow, TransitionRow
from sim.soak import ground
from tests.service.mission.flown import LEFT_US, ON_GROUND, Talk, reached
from tests.service.mission.test_grounded import grounded

STEPS = [Connect(), WaitReady(), EnterGuided(), Arm(), TakeOff(15.0)]


def prepared(until: int) -> Talk:
    """A mission that takes off, with so many steps done and the next one under way."""
    talk = Talk(may_take_off=True, **ON_GROUND)
    for step in STEPS[:until]:
        talk.tick()
        talk.tick()
        assert talk.doing() == step
        talk.done()
    talk.tick()
    talk.tick()
    return talk


def test_it_takes_off_step_by_step() -> None:
    talk = prepared(5)
    assert talk.state == State.SEARCHING
    assert [effect for effect in talk.wanted if effect in STEPS] == STEPS


def test_the_row_of_a_take_off_comes_before_its_first_step() -> None:
    talk = prepared(2)
    row = WriteRow(CommandRow("take off", height_m=15.0))
    assert talk.wanted.index(row) < talk.wanted.index(EnterGuided())


@pytest.mark.parametrize("passes", [True, False])
def test_what_would_hold_it_in_the_air_keeps_it_on_the_ground(passes: bool) -> None:
    doubtful = {**ON_GROUND, "home": Home(*ground.launch(), 447.0)}
    talk = reached(State.READY, {"link": {"connect_timeout_s": 20.0}}, may_take_off=True, **doubtful)
    talk.tick()
    talk.done()
    talk.pass_by(10.0)
    assert (talk.state, talk.core.doing) == (State.TAKEOFF, None)
    (said,) = [
        each.text for each in talk.wanted if isinstance(each, Note) and "waits for the position" in each.text
    ]
    assert "447 m" in said
    if passes:
        talk.shows(home=Home(*ground.launch(), 400.0))
        talk.pass_by(10.0)
        assert talk.doing() == EnterGuided()
        return
    talk.pass_by(15.0)
    assert talk.state == State.ABORTED
    assert "447 m" in talk.core.standing.why
    assert not [effect for effect in talk.wanted if effect in STEPS[2:]]


@pytest.mark.parametrize("at", range(5))
def test_after_an_abort_no_further_step_is_taken(at: int) -> None:
    talk = prepared(at)
    talk.on(Order("abort"))
    assert talk.state == State.ABORTED
    assert talk.core.doing is None
    talk.pass_by(3.0)
    assert [effect for effect in talk.wanted if effect in STEPS] == STEPS[: at + 1]


@pytest.mark.parametrize("event", [Event.PILOT, Event.RETURN])
@pytest.mark.parametrize("at", [2, 3, 4])
def test_a_pilot_or_an_order_to_return_ends_the_take_off_between_its_steps(at: int, event: Event) -> None:
    talk = prepared(at)
    if event == Event.PILOT:
        talk.pilot()
    else:
        talk.on(Order("return"))
    assert talk.state == {Event.PILOT: State.YIELDED, Event.RETURN: State.RETURNING}[event]
    talk.pass_by(3.0)
    assert [effect for effect in talk.wanted if effect in STEPS] == STEPS[: at + 1]


def test_a_vehicle_that_is_not_there_ends_the_run() -> None:
    talk = Talk()
    talk.tick()
    talk.failed("nothing was heard")
    assert (talk.state, talk.core.standing.why_stopped) == (State.ABORTED, "nothing was heard")


def test_a_step_that_failed_ends_the_run_unless_the_pilot_is_why() -> None:
    """What the pilot did is told by an event of its own, which may come a moment later."""
    talk = prepared(3)
    talk.failed("the vehicle did not arm")
    talk.tick()
    assert talk.state == State.TAKEOFF
    talk.pass_by(1.5)
    assert (talk.state, talk.core.standing.why_stopped) == (State.ABORTED, "the vehicle did not arm")
    taken = prepared(4)
    taken.failed("the mode was changed")
    taken.pilot()
    taken.pass_by(3.0)
    assert taken.state == State.YIELDED


def test_without_leave_to_take_off_it_waits_for_somebody_who_does() -> None:
    talk = Talk(**{**ON_GROUND, "in_control": False})
    talk.tick()
    talk.done()
    talk.pass_by(30.0)
    assert (talk.state, talk.core.doing) == (State.READY, None)
    talk.shows(landed_state="in_air", armed=True, guided=True, alt_home_m=15.0, alt_amsl_m=415.0)
    talk.tick()
    assert talk.doing() == EnterGuided()
    talk.failed("the pilot was faster")
    talk.tick()
    assert talk.core.doing is None
    talk.pass_by(1.5)
    talk.done()
    assert talk.state == State.SEARCHING


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


def test_an_order_to_return_changes_nothing_before_the_flight() -> None:
    """Whoever has the aircraft then keeps it."""
    talk = reached(State.READY)
    talk.on(Order("return"))
    assert talk.state == next_state(State.READY, Event.RETURN) == State.READY
    assert not [effect for effect in talk.wanted if isinstance(effect, Tell) and "RETURN" in effect.text]


# ---- a person's word outlives the process


def restarted(left: State, *, flown_s: float = 60.0, **changes: Any) -> Talk:
    """A mission that goes on with a run that an earlier process left like this, after so many seconds in the air."""
    flight = Flight(flown=flown_s > 0.0, carried_s=flown_s, steps=7, left_at=990.0 if flown_s else 0.0)
    standing = Standing(state=left, why="the pilot or the autopilot selected LOITER")
    talk = Talk(may_take_off=True, standing=standing, flight=flight, **{"in_control": False, **changes})
    talk.tick()
    talk.done()
    talk.pass_by(5.0)
    return talk


MOVES = (SendWaypoint, Arm, TakeOff, EnterGuided, ReturnToLaunch, Stop)


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


def test_no_launch_against_a_hand_on_the_sticks() -> None:
    talk = reached(State.GROUNDED, may_take_off=True)
    talk.shows(sticks=0.5, **ON_GROUND)
    did = talk.on(Order("launch", 7))
    assert "sticks" in next(each.refused for each in did if isinstance(each, Answer))
    talk.shows(sticks=0.0)
    talk.on(Order("launch", 8))
    assert isinstance(talk.doing(), WaitReady)


def test_a_link_that_was_silent_for_a_moment_ends_no_take_off_and_a_pilots_mode_is_not_left() -> None:
    """The service stood still while it compiled; the run ended, on the ground."""
    talk = reached(State.TAKEOFF, mode="STABILIZE", guided=False, **ON_GROUND)
    talk.tick()
    for _ in range(5):
        step = talk.doing()
        assert isinstance(step, EnterGuided)
        assert step.out_of == "STABILIZE"
        talk.failed("the service stood still and has not heard the vehicle since", answered=False)
        assert talk.state == State.TAKEOFF
        talk.shows(mode="LOITER")  # told, and not yet taken in
        talk.pass_by(RETRY_S + 0.5)
    for _ in range(200):
        if talk.core.doing is not None:
            talk.failed("the vehicle has not been heard", answered=False)
        talk.pass_by(RETRY_S + 0.5)
    assert talk.state == State.ABORTED


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


# ---- on the ground the pilot wins too


def test_a_mode_that_a_pilot_chose_before_the_take_off_is_left_alone() -> None:
    for until in range(4):
        talk = prepared(until) if until else Talk(may_take_off=True, **ON_GROUND)
        if not until:
            talk.tick()
        talk.pilot("STABILIZE")
        assert talk.state == State.YIELDED
        steps = len([effect for effect in talk.wanted if effect in STEPS])
        talk.pass_by(60.0)
        assert len([effect for effect in talk.wanted if effect in STEPS]) == steps
        assert talk.state == State.YIELDED  # and not over, as it has not flown


def test_a_pilot_who_hands_the_aircraft_over_has_not_taken_it_away() -> None:
    talk = Talk(**{**ON_GROUND, "in_control": False, "guided": False})
    talk.tick()
    talk.pilot("STABILIZE")
    talk.done()
    talk.tick()
    talk.pilot("LOITER")
    assert talk.state == State.READY


def test_a_person_who_holds_before_the_take_off_is_obeyed() -> None:
    talk = prepared(1)
    assert talk.doing() == WaitReady()
    talk.on(Order("hold"))
    assert (talk.state, talk.core.doing) == (State.HOLDING, None)
    (answer,) = [each for each in talk.on(Order("resume", 7)) if isinstance(each, Answer)]
    assert "order launch" in answer.refused
    talk.pass_by(60.0)
    assert talk.core.doing is None


def at_once(talk: Talk, command: str) -> str:
    """What an order is answered with, at once."""
    (answer,) = [each for each in talk.on(Order(command, 7)) if isinstance(each, Answer)]
    return answer.refused


def linked(talk: Talk) -> Talk:
    """The aircraft is heard, and then a minute passes."""
    talk.tick()
    talk.done()
    talk.pass_by(60.0)
    return talk


@pytest.mark.parametrize("command", ["hold", "return"])
def test_a_person_who_stops_it_before_it_is_heard_is_obeyed_whatever_a_flag_says(command: str) -> None:
    talk = Talk(may_take_off=True, **ON_GROUND)
    talk.tick()
    assert at_once(talk, command) == ""
    linked(talk)
    assert (talk.state, talk.core.doing) == (State.HOLDING, None)
    assert not [effect for effect in talk.wanted if effect in STEPS[1:]]
    talk.on(Order("launch", 7))
    assert talk.doing() == WaitReady()


def test_a_return_while_it_gets_ready_to_take_off_keeps_it_on_the_ground() -> None:
    talk = prepared(1)
    assert at_once(talk, "return") == ""
    talk.pass_by(60.0)
    assert (talk.state, talk.core.doing) == (State.HOLDING, None)


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


# ---- where it is


def test_nothing_is_armed_where_home_is_far_from_the_launch_point() -> None:
    lat, lon = ground.launch()
    talk = Talk(may_take_off=True, home=Home(lat + 0.1, lon, 400.0), **ON_GROUND)
    talk.tick()
    talk.done()
    talk.tick()
    talk.tick()
    assert talk.state == State.ABORTED
    assert "11 km from the launch point, more than 500 m" in talk.core.standing.why_stopped
    assert not [effect for effect in talk.wanted if isinstance(effect, (WaitReady, *MOVES))]
    late = prepared(1)
    late.shows(home=Home(lat + 0.1, lon, 400.0))  # it is told only now
    late.done()
    late.tick()
    assert late.state == State.ABORTED
    assert Arm() not in late.wanted


@pytest.mark.parametrize(
    ("battery", "words"),
    [
        ({"battery_percent": None}, "flight.allow_unknown_battery"),
        ({"battery_percent": 15.0}, "20 % is the least"),
        ({"battery_state": "critical"}, "calls the battery critical"),
    ],
)
def test_nothing_is_armed_on_a_battery_that_is_unknown_or_too_low(
    battery: dict[str, Any], words: str
) -> None:
    talk = prepared(1)
    talk.shows(**battery)
    talk.done()
    talk.tick()
    assert talk.state == State.ABORTED
    assert words in talk.core.standing.why_stopped
    assert Arm() not in talk.wanted


def test_a_home_beside_the_launch_point_is_told() -> None:
    lat, lon = ground.launch()
    talk = Talk(may_take_off=True, home=Home(lat + 0.001, lon, 400.0), **ON_GROUND)
    talk.tick()
    talk.done()
    talk.tick()
    talk.tick()
    assert Tell("search: home is 111 m from the launch point", 4) in talk.wanted


def test_what_is_not_heard_yet_is_no_fault_and_no_reason_to_begin() -> None:
    talk = Talk(fix=0, satellites=None, in_control=False)
    talk.tick()
    talk.done()
    talk.pass_by(10.0)
    assert (talk.state, talk.core.doing) == (State.READY, None)
    talk.shows(fix=3, satellites=12)
    talk.pass_by(5.0)
    assert talk.doing() == EnterGuided()


def test_the_pilot_is_told_what_to_do_in_ready() -> None:
    talk = Talk(in_control=False, guided=False, mode="LOITER")
    talk.sees(guided_title="Hold")
    talk.tick()
    talk.done()
    talk.tick()
    talk.tick()
    assert Tell("search READY: select Hold") in talk.wanted


@pytest.mark.parametrize("landed", ["takeoff", "in_air", "on_ground", "undefined"])
def test_a_take_off_that_fails_in_the_air_flies_home(landed: str) -> None:
    talk = prepared(4)
    talk.shows(armed=True, guided=True)
    talk.shows(landed_state=landed, alt_home_m=9.0, alt_amsl_m=409.0)
    assert isinstance(talk.doing(), TakeOff)
    talk.failed("the take-off to 15 m did not end: it is at 9.0 m")
    talk.pass_by(3.0)
    assert (talk.state, talk.doing()) == (State.RETURNING, ReturnToLaunch())
    assert "did not end" in talk.core.standing.why_stopped


def test_a_take_off_that_fails_on_the_ground_stays_there() -> None:
    talk = prepared(4)
    talk.shows(armed=True)
    talk.failed("the vehicle did not take off: it answered DENIED")
    talk.pass_by(3.0)
    assert talk.state == State.ABORTED
    assert ReturnToLaunch() not in talk.wanted


def test_a_slow_climb_is_given_its_time() -> None:
    assert climb_s(70.0, None) == climb_s(70.0, 2.5) == 120.0
    assert climb_s(100.0, 0.5) > 100.0 / 0.5


@pytest.mark.parametrize("state", [State.READY, State.GROUNDED])
def test_who_takes_off_by_hand_hears_before_what_the_aircraft_lacks(state: State) -> None:
    lacks = "it does not tell whether it is in the air (EXTENDED_SYS_STATE)"
    talk = reached(state, **{**ON_GROUND, **LEFT_US}) if state == State.READY else grounded()
    talk.tick()
    talk.sees(missing=(lacks,))
    talk.wanted.clear()
    talk.pass_by(LACKS_S - 1.0)
    assert not [each for each in talk.wanted if isinstance(each, Tell) and lacks in each.text]
    talk.pass_by(20.0)
    assert len([each for each in talk.wanted if isinstance(each, Tell) and lacks in each.text]) == 1
    assert lacks in talk.core.standing.why


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
