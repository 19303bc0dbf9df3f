"""The stop that needs no position of ours."""

from __future__ import annotations

import math

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.mavlink.errors import NotPermitted
from service.mavlink.events import ModeChanged, TargetNotTaken, TargetReplaced

from .peer import ALT, FLAVORS, LON, MODES, NORTH, PILOT, REPOSITION, Rig, go

MODES["ardupilot"]["BRAKE"] = 17


def blind(flavor: str) -> Rig:
    """Under way to a waypoint, and its position has stopped."""
    rig = Rig(flavor).flying()
    go(rig)
    rig.peer.target = (NORTH, LON, ALT)
    rig.run(2.0)
    rig.positioning = False
    rig.run(4.0)
    rig.forget()
    with pytest.raises(NotPermitted):
        rig.core.hold(rig.now)
    assert rig.motion() == []
    return rig


def test_px4_is_stopped_by_a_reposition_to_nowhere() -> None:
    rig = blind("px4")
    rig.core.brake(rig.now)
    (stop,) = rig.messages("COMMAND_LONG", REPOSITION)
    assert stop.param2 == 0.0, "it cannot take a mode"
    assert all(math.isnan(value) for value in (stop.param4, stop.param5, stop.param6, stop.param7))


def test_arducopter_is_stopped_in_its_mode_brake_which_is_not_a_pilots() -> None:
    rig = blind("ardupilot")
    rig.core.brake(rig.now)
    (stop,) = rig.messages("COMMAND_LONG", mavlink.MAV_CMD_DO_SET_MODE)
    assert stop.param2 == 17.0
    rig.peer.mode = "BRAKE"
    rig.run(2.0)
    (change,) = rig.of(ModeChanged)
    assert change.commanded
    assert rig.core.in_control


def test_arducopter_that_refuses_brake_is_stopped_by_a_velocity_of_zero() -> None:
    rig = blind("ardupilot")
    rig.core.brake(rig.now)
    rig.say(rig.peer.ack(mavlink.MAV_CMD_DO_SET_MODE, mavlink.MAV_RESULT_FAILED))
    (still,) = rig.messages("SET_POSITION_TARGET_LOCAL_NED")
    assert (still.vx, still.vy, still.vz) == (0.0, 0.0, 0.0)
    assert still.type_mask & mavlink.POSITION_TARGET_TYPEMASK_X_IGNORE
    assert not still.type_mask & mavlink.POSITION_TARGET_TYPEMASK_VX_IGNORE


def test_where_it_stops_is_nobodys_target_however_late_it_does() -> None:
    """On a busy radio it names where it flew to for as long as the stop is on its way."""
    rig = blind("px4")
    rig.core.brake(rig.now)
    rig.run(4.0)
    rig.say(rig.peer.ack(REPOSITION, mavlink.MAV_RESULT_ACCEPTED))
    rig.peer.target = (NORTH + 2e-4, LON, ALT)
    rig.run(4.0)
    assert rig.of(TargetReplaced) == []
    assert rig.core.in_control
    rig.peer.target = (NORTH + 4e-4, LON, ALT)  # and this is somebody's
    rig.run(4.0)
    assert len(rig.of(TargetReplaced)) == 1


@pytest.mark.parametrize("late_s", [0.2, 3.0])
def test_each_stop_that_arrives_may_end_somewhere_else(late_s: float) -> None:
    """It is sent several times; an aircraft that is still braking at the second names another place."""
    rig = blind("px4")
    rig.core.brake(rig.now)
    rig.run(late_s)
    for number in range(3):
        rig.say(rig.peer.ack(REPOSITION, mavlink.MAV_RESULT_UNSUPPORTED))
        rig.peer.target = (NORTH + number * 1e-4, LON, ALT)
        for _ in range(4):
            rig.say(rig.peer.position_target(rig.now))
        rig.run(1.0)
    assert len(rig.messages("COMMAND_LONG", REPOSITION)) == 3
    rig.run(3.0)
    assert rig.of(TargetReplaced) == []
    rig.peer.target = (NORTH + 9e-4, LON, ALT)  # and this is somebody's
    rig.run(3.0)
    assert len(rig.of(TargetReplaced)) == 1


def test_an_answer_that_is_for_anybody_does_not_hide_where_somebody_sends_it() -> None:
    rig = blind("px4")
    rig.core.brake(rig.now)
    rig.run(6.0)  # it is sent no more, and rests
    rig.peer.target = (NORTH + 9e-4, LON, ALT)
    rig.say(rig.peer.ack(REPOSITION, mavlink.MAV_RESULT_ACCEPTED, target=(0, 0)))
    rig.run(3.0)
    assert len(rig.of(TargetReplaced)) == 1


def test_an_aircraft_that_still_brakes_names_where_it_is_and_nobody_sends_it_there() -> None:
    rig = blind("px4")
    rig.core.brake(rig.now)
    rig.say(rig.peer.ack(REPOSITION, mavlink.MAV_RESULT_UNSUPPORTED))
    for number in [*range(24), 24, 24, 24]:  # five metres, told often
        rig.peer.target = (NORTH + (number * 0.4 - number**2 / 120.0) * 9e-6, LON, ALT)
        rig.now += 0.03
        rig.say(rig.peer.position_target(rig.now))
    assert rig.of(TargetReplaced) == []
    rig.run(8.0)
    rig.peer.target = (NORTH + 9e-4, LON, ALT)  # and this is somebody's
    rig.run(4.0)
    assert len(rig.of(TargetReplaced)) == 1


@FLAVORS
def test_a_pilot_who_takes_over_while_it_brakes_wins(flavor: str) -> None:
    rig = blind(flavor)
    rig.core.brake(rig.now)
    rig.peer.mode = PILOT[flavor]
    rig.say(rig.peer.heartbeat())
    rig.forget()
    rig.run(10.0)
    assert not rig.core.in_control
    assert rig.motion() == []


@FLAVORS
def test_nothing_is_stopped_that_is_not_ours(flavor: str) -> None:
    rig = blind(flavor)
    rig.core.release_control("a test", rig.now)
    with pytest.raises(NotPermitted, match="a test"):
        rig.core.brake(rig.now)
    assert rig.motion() == []


def test_a_stop_is_sent_again_but_not_after_the_next_waypoint() -> None:
    rig = blind("px4")
    rig.core.brake(rig.now)
    rig.run(1.5)
    assert len(rig.messages("COMMAND_LONG", REPOSITION)) == 2
    rig.positioning = True
    rig.run(0.3)
    go(rig)
    rig.peer.target = (NORTH, LON, ALT)
    rig.run(5.0)
    assert len(rig.messages("COMMAND_LONG", REPOSITION)) == 2


def test_the_waypoint_before_a_stop_is_not_repeated() -> None:
    rig = Rig("px4").flying()
    go(rig)
    rig.core.brake(rig.now)
    rig.run(10.0)
    assert len(rig.messages("COMMAND_INT", REPOSITION)) == 1
    assert rig.of(TargetNotTaken) == []
