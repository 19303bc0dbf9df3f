"""Whether the vehicle flies to the target it was sent to: named back, sent again, given up, replaced."""

from __future__ import annotations

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.mavlink.events import Target, TargetNotTaken, TargetReplaced, TargetTaken

from .peer import ALT, FLAVORS, LAT, LON, NORTH, REPOSITION, Rig, go


def stopped(rig: Rig) -> Target:
    """The target of a stop that is ordered now."""
    rig.core.hold(rig.now)
    assert rig.core.target is not None
    return rig.core.target


@FLAVORS
def test_target_that_is_named_is_taken_and_not_sent_again(flavor: str) -> None:
    rig = Rig(flavor).flying()
    go(rig)
    if flavor == "px4":
        rig.say(rig.peer.ack(REPOSITION, mavlink.MAV_RESULT_UNSUPPORTED))
    rig.peer.target = (NORTH, LON, ALT)
    rig.run(20.0)
    (taken,) = rig.of(TargetTaken)
    assert taken.after_s < 1.0
    assert len(rig.motion()) == 1


@FLAVORS
def test_target_that_is_not_named_is_sent_again_a_few_times_and_then_given_up(flavor: str) -> None:
    rig = Rig(flavor).flying()
    rig.peer.target = (LAT, LON, ALT)
    go(rig)
    rig.run(30.0)
    assert len(rig.motion()) == 3
    (lost,) = rig.of(TargetNotTaken)
    assert (lost.attempts, lost.target.lat) == (3, NORTH)
    assert rig.core.target is None


def test_lost_reposition_is_made_good_by_the_next_attempt() -> None:
    rig = Rig().flying()
    go(rig)
    rig.run(3.0)
    rig.peer.target = (NORTH, LON, ALT)
    rig.run(5.0)
    assert len(rig.motion()) == 2
    assert len(rig.of(TargetTaken)) == 1
    assert rig.of(TargetNotTaken) == []


def test_refusal_of_ardupilot_is_believed_and_not_repeated() -> None:
    rig = Rig("ardupilot").flying()
    go(rig)
    rig.say(rig.peer.ack(REPOSITION, mavlink.MAV_RESULT_FAILED))
    rig.run(2.0)
    (lost,) = rig.of(TargetNotTaken)
    assert "FAILED" in lost.reason
    assert len(rig.motion()) == 1


def test_answer_to_somebody_elses_reposition_is_not_ours() -> None:
    rig = Rig("ardupilot").flying()
    go(rig)
    rig.say(rig.peer.ack(REPOSITION, mavlink.MAV_RESULT_DENIED, target=(255, 190)))
    rig.run(1.0)
    assert rig.of(TargetNotTaken) == []


def test_next_target_may_be_sent_before_the_last_is_reached() -> None:
    rig = Rig().flying()
    for step in range(1, 4):
        lat = LAT + 0.0002 * step
        go(rig, lat)
        rig.peer.target = (lat, LON, ALT)
        rig.run(1.0)
    assert len(rig.motion()) == 3
    assert len(rig.of(TargetTaken)) == 3


def test_altitude_of_another_reference_is_not_our_target() -> None:
    rig = Rig().flying()
    go(rig)
    rig.peer.target = (NORTH, LON, 20.0)
    rig.run(10.0)
    assert rig.of(TargetTaken) == []
    assert len(rig.of(TargetNotTaken)) == 1


def test_target_given_by_somebody_else_in_the_guided_mode_is_told() -> None:
    rig = Rig().flying()
    go(rig)
    rig.peer.target = (NORTH, LON, ALT)
    rig.run(2.0)
    rig.peer.target = (LAT - 0.001, LON, ALT)
    rig.run(3.0)
    (replaced,) = rig.of(TargetReplaced)
    assert replaced.found.lat == pytest.approx(LAT - 0.001)
    assert len(rig.motion()) == 1


@FLAVORS
def test_hold_stops_ahead_and_not_behind(flavor: str) -> None:
    """A target where the aircraft is now would make it fly past and come back."""
    rig = Rig(flavor)
    rig.peer.velocity = (5.0, 0.0, 0.0)
    rig.flying()
    target = stopped(rig)
    ahead_m = (target.lat - LAT) * 111_194.93
    assert 4.0 < ahead_m < 13.0
    assert (target.lon, target.alt_amsl_m) == pytest.approx((LON, ALT))
    rig.peer.velocity = (0.0, 0.0, 0.0)
    rig.run(0.5)
    assert stopped(rig).lat == pytest.approx(LAT)
