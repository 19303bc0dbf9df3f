"""What an operator's orders do, state by state, and what they need first."""

from __future__ import annotations

import re
from typing import Any

import pytest

from service.mission.effects import ACTIONS, Answer, DropAction, Effect, EnterGuided, Stop, Tell
from service.mission.news import Order
from service.mission.orders import ASKED, OFFERED, SIGNAL
from service.mission.states import TABLE, Event, State
from service.rows import TransitionRow
from tests.service.mission.flown import LEFT_US, ON_GROUND, Talk, reached

SO_ALREADY = {
    (State.HOLDING, "hold"),
    (State.SEARCHING, "resume"),
    (State.CONFIRMING, "resume"),
    (State.RETURNING, "return"),
    (State.ABORTED, "abort"),
}
COMMANDS = {"hold": Event.HOLD, "resume": Event.RESUME, "return": Event.RETURN, "abort": Event.ABORT}


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("state", list(State))
def test_an_order_does_what_the_table_says_and_is_answered(state: State, command: str) -> None:
    talk = reached(state)
    did = talk.on(Order(command, 7))
    if talk.core.doing == EnterGuided() and Answer(7) not in did:
        talk.shows(guided=True, in_control=True)
        did = talk.done()
    assert talk.state == TABLE.get((state, COMMANDS[command]), state)
    (answer,) = [each for each in did if isinstance(each, Answer)]
    obeyed = (state, COMMANDS[command]) in TABLE or (state, command) in SO_ALREADY
    obeyed |= state == State.WAITING and command in ("hold", "return")  # once it is heard
    assert answer == Answer(7, "" if obeyed else f"there is nothing to {command} in {state}")


@pytest.mark.parametrize("command", ["resume", "return"])
def test_an_aircraft_is_taken_from_the_pilot_by_an_order_alone_and_first(command: str) -> None:
    talk = reached(State.YIELDED)
    talk.on(Order(command, 7))
    assert (talk.doing(), talk.state) == (EnterGuided(), State.YIELDED)
    did = talk.failed("the pilot keeps it")
    assert talk.state == State.YIELDED
    assert Answer(7, f"{command} failed: the pilot keeps it") in did
    assert Tell(f"search YIELDED: {command} failed: the pilot keeps it") in did


def test_a_pilot_who_takes_over_while_an_order_is_carried_out_wins() -> None:
    talk = reached(State.HOLDING)
    talk.shows(**LEFT_US)
    talk.on(Order("resume", 7))
    assert talk.doing() == EnterGuided()
    did = talk.pilot("STABILIZE")
    assert talk.state == State.YIELDED
    assert DropAction() in did
    assert [each.refused for each in did if isinstance(each, Answer)] == [
        "another order or event came before it was carried out"
    ]
    assert talk.core.doing is None


def test_a_hold_on_the_autopilots_way_home_takes_it_back_first() -> None:
    talk = reached(State.RETURNING)
    talk.shows(**{**LEFT_US, "mode": "RTL"})
    talk.on(Order("hold"))
    assert (talk.doing(), talk.state) == (EnterGuided(), State.RETURNING)
    talk.shows(guided=True, in_control=True)
    talk.done()
    assert (talk.state, talk.core.standing.causes) == (State.HOLDING, {"operator"})


def test_a_hold_that_is_ordered_once_more_stops_once_more() -> None:
    talk = reached(State.HOLDING)
    talk.wanted.clear()
    talk.on(Order("hold"))
    assert Stop() in talk.wanted
    talk.pilot()
    talk.wanted.clear()
    talk.on(Order("hold"))
    assert Stop() not in talk.wanted


def test_why_a_run_stopped_is_who_ordered_it() -> None:
    talk = reached(State.SEARCHING)
    talk.on(Order("return"))
    assert talk.core.standing.why_stopped == "the operator asked to return"
    talk = reached(State.SEARCHING)
    talk.on(Order("abort"))
    assert talk.core.standing.why_stopped == "the operator aborted the run"


@pytest.mark.parametrize("command", [*OFFERED, "abort", "leave"])
@pytest.mark.parametrize("changes", [{}, ON_GROUND], ids=["in the air", "on the ground"])
def test_no_order_takes_the_aircraft_from_a_hand_on_the_sticks(changes: dict[str, Any], command: str) -> None:
    talk = yielded(changes, 0.4)
    did = talk.on(Order(command, 7))
    refused = next((each.refused for each in did if isinstance(each, Answer)), "")
    assert not takes(did)
    if takes(yielded(changes, 0.02).on(Order(command, 8))):  # which is what the sticks are against
        assert "sticks" in refused
        assert talk.state in (State.YIELDED, State.DONE)  # landed, as it is on the ground
        assert any(isinstance(each, Tell) and "sticks" in each.text for each in did)


def takes(did: list[Effect]) -> bool:
    """Whether what follows from an order takes the aircraft, or begins to."""
    return any(isinstance(each, ACTIONS) for each in did)


def yielded(changes: dict[str, Any], sticks: float) -> Talk:
    """An aircraft that its pilot has, in the air or on the ground, with a hand on the sticks or none."""
    talk = reached(State.YIELDED, may_take_off=True)
    talk.shows(sticks=sticks, **changes)
    return talk


def test_the_orders_that_take_a_yielded_aircraft_are_known() -> None:
    """Without a hand on the sticks, each of these does; so the test above is about something."""
    taking = set()
    for changes in ({}, ON_GROUND):
        for command in (*OFFERED, "abort", "leave"):
            if takes(yielded(changes, 0.02).on(Order(command, 7))):
                taking.add(command)
    assert taking == {"resume", "return", "launch"}


def test_a_hold_in_the_climb_stops_it() -> None:
    talk = reached(State.TAKEOFF)
    talk.shows(landed_state="takeoff", armed=True, guided=False, mode="AUTO_TAKEOFF")
    talk.on(Order("hold", 7))
    assert talk.doing() == EnterGuided()
    talk.shows(guided=True, landed_state="in_air", alt_home_m=6.0, alt_amsl_m=406.0)
    did = talk.done()
    assert talk.state == State.HOLDING
    assert Stop() in did


def test_a_return_on_the_ground_leaves_the_mode_that_the_pilot_chose() -> None:
    talk = reached(State.TAKEOFF)
    talk.pilot("STABILIZE")
    assert EnterGuided() not in talk.on(Order("return"))
    talk.tick()
    assert talk.state == State.DONE


def test_ending_the_process_says_nothing_about_the_search() -> None:
    """The same run can be gone on with, as it was left; an operator's abort ends it."""
    talk = reached(State.YIELDED)
    talk.on(Order("leave"))
    row = TransitionRow(State.YIELDED, Event.ABORT, State.ABORTED, SIGNAL)
    assert row in talk.rows
    assert SIGNAL != ASKED  # which is what a run that is over is known by


@pytest.mark.parametrize("command", ["return", "finish"])
def test_what_an_earlier_process_left_in_the_air_is_brought_home_before_it_is_in_hand(command: str) -> None:
    """And is not left hovering there, which is what the end of a run that has not begun would be."""
    talk = reached(State.READY, in_control=False)
    talk.core.flight.flown = True
    assert command in talk.core.orders(talk.seen)
    talk.on(Order(command, 7))
    assert (talk.state, talk.doing()) == (State.READY, EnterGuided())
    talk.shows(in_control=True)
    assert Answer(7) in talk.done()
    assert talk.state == State.RETURNING
    assert talk.core.standing.settled == (command == "finish")
    assert talk.core.standing.why_stopped


@pytest.mark.parametrize("changes", [ON_GROUND, LEFT_US], ids=["on the ground", "its pilot has it"])
def test_what_is_finished_before_it_is_in_hand_is_left_alone_elsewhere(changes: dict[str, Any]) -> None:
    talk = reached(State.READY, **changes)
    talk.core.flight.flown = True
    talk.on(Order("finish", 7))
    assert (talk.state, talk.core.doing) == (State.DONE, None)


@pytest.mark.parametrize("changes", [{}, ON_GROUND], ids=["in the air", "on the ground"])
@pytest.mark.parametrize("state", list(State))
def test_what_is_offered_is_what_is_not_refused_as_meaning_nothing(
    state: State, changes: dict[str, Any]
) -> None:
    talk = reached(state)
    talk.shows(**changes)
    offered = talk.core.orders(talk.seen)
    for command in OFFERED:
        asked = reached(state)
        asked.shows(**changes)
        refused = next((each.refused for each in asked.on(Order(command, 7)) if isinstance(each, Answer)), "")
        senseless = re.match("there is nothing|a launch is for|another aircraft|the aircraft is on", refused)
        assert (command in offered) == (senseless is None and (state, command) not in SO_ALREADY), command


@pytest.mark.parametrize(
    ("state", "changes", "offered"),
    [
        (State.HOLDING, {}, ["resume", "return", "finish"]),
        (State.HOLDING, ON_GROUND, ["return", "launch", "finish"]),
        (State.YIELDED, {}, ["resume", "return", "finish"]),
        (State.YIELDED, ON_GROUND, ["return", "launch", "finish"]),
        (State.FOUND, {}, ["hold", "return", "finish"]),
        (State.GROUNDED, ON_GROUND, ["launch", "replace", "finish"]),
        (State.DONE, ON_GROUND, []),
    ],
)
def test_what_is_offered_goes_by_the_state_and_by_whether_it_flies(
    state: State, changes: dict[str, Any], offered: list[str]
) -> None:
    talk = reached(state)
    talk.shows(**changes)
    assert talk.core.orders(talk.seen) == offered
