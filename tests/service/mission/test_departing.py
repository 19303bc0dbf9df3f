"""Getting an aircraft into the air, or not: what is asked for last may end it between any two steps."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from service.mavlink.telemetry import Home
from service.mavlink.vehicle import climb_s
from service.mission.apart import Other
from service.mission.departing import LACKS_S
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
from service.mission.news import Order
from service.mission.phase import RETRY_S
from service.mission.situation import Situation
from service.mission.standing import Standing
from service.mission.states import Event, State, next_state
from service.rows import CommandRow
from sim.soak import ground
from tests.service.mission.flown import HERE, LEFT_US, ON_GROUND, Talk, place, reached
from tests.service.mission.test_grounded import grounded

STEPS = [Connect(), WaitReady(), EnterGuided(), Arm(), TakeOff(15.0)]
MOVES = (SendWaypoint, Arm, TakeOff, EnterGuided, ReturnToLaunch, Stop)


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


def test_one_that_is_not_heard_may_join_the_others_later_and_is_taken_up_by_an_order_only() -> None:
    """Somebody switches it on, and has a hand on it, long after the flag to take off was given."""
    talk = Talk(may_take_off=True, **ON_GROUND)
    talk.sees(others=(Other("2", HERE, 60.0, HERE, HERE, 60.0, 8.0, system_id=2),))
    for _ in range(2):
        talk.tick()
        talk.failed("nothing was heard")
        talk.pass_by(RETRY_S + 0.5)
    assert (talk.state, talk.doing()) == (State.WAITING, Connect())
    said = "nothing was heard; the others go on, and it may join them later"
    assert talk.core.standing.why == said
    assert sum(effect.text == said for effect in talk.wanted if isinstance(effect, Note)) == 1
    talk.done()
    talk.pass_by(30.0)
    assert (talk.state, talk.core.doing) == (State.READY, None)
    talk.on(Order("launch", 7))
    assert talk.doing() == WaitReady()


def test_one_whose_link_itself_waits_joins_by_an_order_only_as_well() -> None:
    """Its radio is plugged in an hour later; nothing had failed until then, and so nothing was late."""
    talk = Talk(may_take_off=True, **ON_GROUND)
    talk.sees(others=(Other("2", HERE, 60.0, HERE, HERE, 60.0, 8.0, system_id=2),))
    talk.pass_by(200.0)
    assert talk.core.standing.why == "it is not heard; the others go on, and it may join them later"
    talk.done()
    talk.pass_by(30.0)
    assert (talk.state, talk.core.doing) == (State.READY, None)


def test_who_was_never_heard_vouches_for_nobody() -> None:
    """Two that are both switched off took each other for heard, and the run never ended."""
    assert Talk().core.told(Situation(), 0.0).system_id is None


def test_what_hovers_over_a_home_of_another_height_is_not_taken_over() -> None:
    """Two that were taken up by hand, ten metres apart above their homes, were at one height above the sea."""
    talk = Talk(**{**ON_GROUND, "in_control": False})
    far = place(-100.0, -100.0)
    talk.sees(others=(Other("2", far, 400.0, far, far, 400.0, 8.0, system_id=2, home_amsl_m=380.0),))
    talk.tick()
    talk.done()
    talk.shows(landed_state="in_air", armed=True, guided=True, alt_home_m=15.0, alt_amsl_m=415.0)
    talk.pass_by(10.0)
    assert (talk.state, talk.core.doing) == (State.READY, None)
    assert "it is not taken over: home is 20 m higher" in talk.core.standing.why
    talk.sees(others=())
    talk.pass_by(2.0)
    assert talk.doing() == EnterGuided(there=True)


@pytest.mark.parametrize("left", [State.HOLDING, State.YIELDED, State.SEARCHING])
def test_another_missions_aircraft_is_not_taken_however_this_one_was_left(left: State) -> None:
    """Held before it was heard, and heard over the other's radio: it would have had two masters."""
    talk = Talk(standing=Standing(state=left), system_id=2, in_control=False)
    talk.sees(others=(Other("2", HERE, 60.0, HERE, HERE, 60.0, 8.0, system_id=2),))
    talk.tick()
    talk.done()
    talk.pass_by(3.0)
    assert talk.state == State.ABORTED
    assert "the same aircraft over two links" in talk.core.standing.why_stopped
    assert not [effect for effect in talk.wanted if isinstance(effect, MOVES)]


@pytest.mark.parametrize("changes", [{"system_id": None}, {"system_id": 2, "ended": True}])
def test_one_that_is_not_heard_is_not_waited_for_where_no_other_is_there(changes: dict[str, Any]) -> None:
    talk = Talk()
    talk.sees(others=(replace(Other("2", HERE, 60.0, HERE, HERE, 60.0, 8.0), **changes),))
    talk.tick()
    talk.failed("nothing was heard")
    assert talk.state == State.ABORTED


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


def test_an_order_to_return_changes_nothing_before_the_flight() -> None:
    """Whoever has the aircraft then keeps it."""
    talk = reached(State.READY)
    talk.on(Order("return"))
    assert talk.state == next_state(State.READY, Event.RETURN) == State.READY
    assert not [effect for effect in talk.wanted if isinstance(effect, Tell) and "RETURN" in effect.text]


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
