"""PX4's Hold is the mode in which it follows us: what tells a failsafe's and a pilot's Hold from ours."""

from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.mavlink.events import ModeChanged, TargetReplaced

from .peer import ALT, LAT, LON, NORTH, Rig, go

TEXT = "Failsafe activated: entering Hold for 5 seconds"


def searching() -> Rig:
    """PX4 on its way to a waypoint of ours."""
    rig = Rig("px4").flying()
    go(rig)
    rig.peer.target = (NORTH, LON, ALT)
    rig.run(2.0)
    rig.forget()
    return rig


def test_a_failsafe_that_holds_in_hold_takes_the_aircraft() -> None:
    rig = searching()
    rig.say(rig.peer.text(TEXT, 2))
    rig.peer.status = mavlink.MAV_STATE_CRITICAL
    rig.run(2.0)
    (change,) = rig.of(ModeChanged)
    assert (change.commanded, change.failsafe, change.mode) == (False, True, "AUTO_LOITER")
    assert not rig.core.in_control
    assert rig.motion() == []


def test_neither_a_text_nor_a_critical_state_alone_is_a_failsafe() -> None:
    rig = searching()
    rig.say(rig.peer.text(TEXT, 2))
    rig.run(12.0)
    rig.peer.status = mavlink.MAV_STATE_CRITICAL
    rig.run(3.0)
    assert rig.core.in_control
    assert rig.of(ModeChanged) == []


def test_hold_that_was_left_and_entered_between_two_heartbeats_shows_by_its_target() -> None:
    rig = searching()
    rig.peer.target = (LAT + 0.0001, LON, ALT)  # it brakes where it is
    rig.run(2.0)
    (replaced,) = rig.of(TargetReplaced)
    assert "the pilot" in replaced.by
    assert not rig.core.in_control


def test_a_target_that_changes_with_a_failsafe_is_the_failsafes() -> None:
    rig = searching()
    rig.say(rig.peer.text(TEXT, 2))
    rig.peer.target = (LAT + 0.0001, LON, ALT)
    rig.run(1.2)
    (replaced,) = rig.of(TargetReplaced)
    assert replaced.by == "the autopilot's failsafe"


def test_the_pilot_is_told_at_the_start_what_takes_over_and_what_does_not() -> None:
    said = {}
    for flavor in ("px4", "ardupilot"):
        rig = Rig(flavor)
        rig.say(rig.peer.heartbeat())
        rig.run(3.0)
        rig.core.take_control(rig.now)
        said[flavor] = [m.text for m in rig.messages("STATUSTEXT")]
    assert said == {"px4": ["To take over select Position, not Hold"], "ardupilot": []}
    assert all(len(text) <= 50 for text in said["px4"])
