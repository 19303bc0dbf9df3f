"""A stop ends what the aircraft does by itself for us, and what it is about to do while no heartbeat shows it yet."""

from __future__ import annotations

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.mavlink.errors import NotPermitted
from service.mavlink.events import ModeChanged

from .peer import FLAVORS, GROUND, GUIDED, MODES, RETURN, Rig

MODES["ardupilot"]["BRAKE"] = 17
STANDS = {"px4": "AUTO_LOITER", "ardupilot": "BRAKE"}
CLIMBS = {"px4": "AUTO_TAKEOFF", "ardupilot": "GUIDED"}
SET_MODE, TAKE_OFF, REPOSITION = 176, 22, 192
ON_GROUND, IN_AIR, TAKING_OFF = 1, 2, 3


def modes_asked_for(rig: Rig) -> list[tuple[float, float]]:
    """The modes that were asked for since the last look, as the two numbers in the command."""
    return [(m.param2, m.param3) for m in rig.messages("COMMAND_LONG", SET_MODE)]


def numbers(rig: Rig, mode: str) -> tuple[float, float]:
    """How a command names a mode."""
    _, main, sub, *_ = (*rig.autopilot.set_mode(mode).params, 0.0)
    return main, sub


def ordered_up(flavor: str) -> Rig:
    """Armed on the ground in our control, and a take-off is on the wire."""
    rig = Rig(flavor, allow_arming=True)
    rig.peer.landed, rig.peer.height = ON_GROUND, 0.0
    rig.flying()
    rig.core.request(rig.autopilot.take_off(20.0, GROUND), rig.now)
    assert len(rig.messages("COMMAND_LONG", TAKE_OFF)) == 1
    rig.core.stand_by("the mission wants something else now", rig.now)
    rig.forget()
    return rig


@FLAVORS
def test_a_stop_before_it_has_left_the_ground_keeps_it_there(flavor: str) -> None:
    rig = ordered_up(flavor)
    rig.core.hold(rig.now)
    assert modes_asked_for(rig) == [numbers(rig, STANDS[flavor])]
    assert rig.messages("COMMAND_INT", REPOSITION) == []
    for mode in {CLIMBS[flavor]: 1, STANDS[flavor]: 1}:  # it shows both, one after the other
        rig.peer.mode = mode
        rig.run(2.0)
    assert all(change.commanded for change in rig.of(ModeChanged))
    assert rig.core.in_control


@FLAVORS
def test_a_stop_in_the_middle_of_the_climb_ends_it_there(flavor: str) -> None:
    rig = ordered_up(flavor)
    rig.peer.mode, rig.peer.landed, rig.peer.height = CLIMBS[flavor], TAKING_OFF, 3.0
    for _ in range(6):
        rig.peer.height += 1.0
        rig.run(1.0)
    rig.forget()
    rig.core.hold(rig.now)
    assert modes_asked_for(rig) == [numbers(rig, STANDS[flavor])]
    rig.peer.mode, rig.peer.landed = STANDS[flavor], IN_AIR
    rig.run(2.0)
    assert rig.core.in_control


@FLAVORS
def test_a_climb_that_has_ended_is_not_broken_off_again(flavor: str) -> None:
    rig = ordered_up(flavor)
    for mode, landed, height in ((CLIMBS[flavor], TAKING_OFF, 6.0), (GUIDED[flavor], IN_AIR, 20.0)):
        rig.peer.mode, rig.peer.landed, rig.peer.height = mode, landed, height
        rig.run(8.0)
    rig.forget()
    rig.core.hold(rig.now)
    assert modes_asked_for(rig) == []
    assert len(rig.messages("COMMAND_INT", REPOSITION)) == 1


@FLAVORS
def test_a_stop_right_after_the_order_to_return_ends_the_return(flavor: str) -> None:
    rig = Rig(flavor).flying()
    rig.core.request(rig.autopilot.return_to_launch(), rig.now)
    rig.core.stand_by("the mission wants something else now", rig.now)
    rig.forget()
    rig.core.hold(rig.now)
    assert modes_asked_for(rig) == [numbers(rig, GUIDED[flavor])]
    assert len(rig.messages("COMMAND_INT", REPOSITION)) == 1
    for mode in (RETURN[flavor], GUIDED[flavor]):
        rig.peer.mode = mode
        rig.run(1.0)
    assert [change.commanded for change in rig.of(ModeChanged)] == [True, True]
    assert rig.core.in_control


@FLAVORS
def test_the_mode_that_ends_a_return_is_asked_for_until_it_is_answered(flavor: str) -> None:
    """The heartbeats of before show that very mode still: they are no answer."""
    rig = Rig(flavor).flying()
    rig.core.request(rig.autopilot.return_to_launch(), rig.now)
    rig.core.stand_by("the mission wants something else now", rig.now)
    rig.core.hold(rig.now)
    rig.forget()
    rig.run(1.2)
    assert modes_asked_for(rig) == [numbers(rig, GUIDED[flavor])]
    rig.say(rig.peer.ack(SET_MODE, mavlink.MAV_RESULT_ACCEPTED))
    rig.forget()
    rig.run(5.0)
    assert modes_asked_for(rig) == []


@FLAVORS
def test_what_its_pilot_lets_it_do_is_not_broken_off(flavor: str) -> None:
    rig = Rig(flavor).flying()
    rig.peer.mode = RETURN[flavor]
    rig.run(2.0)
    rig.forget()
    for stop in (rig.core.hold, rig.core.brake):
        with pytest.raises(NotPermitted):
            stop(rig.now)
    assert rig.motion() == []
