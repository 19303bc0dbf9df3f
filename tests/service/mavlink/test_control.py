"""The pilot always wins: what may be sent when, judged by what goes out on the wire."""

from __future__ import annotations

import math

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.mavlink.autopilots.px4 import PX4
from service.mavlink.core import LinkCore
from service.mavlink.errors import NotPermitted
from service.mavlink.events import (
    ArmedChanged,
    Cancelled,
    CommandDone,
    ModeChanged,
    Stalled,
    TargetNotTaken,
)
from service.mavlink.modes import mode_title

from .peer import ALT, FLAVORS, GROUND, GUIDED, LAT, LON, NORTH, PILOT, REPOSITION, RETURN, Rig, go

SET_MODE, RTL = 176, 20


def refused(rig: Rig) -> str:
    """Why a reposition is refused; fails if anything at all is sent."""
    rig.forget()
    with pytest.raises(NotPermitted) as caught:
        go(rig)
    assert rig.motion() == []
    return str(caught.value)


@FLAVORS
def test_reposition_is_the_one_form_that_never_changes_the_mode(flavor: str) -> None:
    rig = Rig(flavor).flying()
    go(rig)
    (sent,) = rig.motion()
    assert (sent.get_type(), sent.command) == ("COMMAND_INT", REPOSITION)
    assert sent.frame == mavlink.MAV_FRAME_GLOBAL
    assert sent.param2 == 0
    assert (sent.target_system, sent.target_component) == (7, 1)
    assert (sent.x, sent.y) == (round(NORTH * 1e7), round(LON * 1e7))
    assert sent.z == pytest.approx(ALT)
    assert math.isnan(sent.param4)


@FLAVORS
def test_control_is_not_assumed_even_in_the_guided_mode(flavor: str) -> None:
    rig = Rig(flavor)
    rig.say(rig.peer.heartbeat())
    rig.run(3.0)
    assert rig.core.telemetry.guided
    assert "control has not been taken" in refused(rig)


@FLAVORS
def test_pilot_mode_change_stops_every_motion_command(flavor: str) -> None:
    rig = Rig(flavor).flying()
    go(rig)
    rig.forget()
    rig.peer.mode = PILOT[flavor]
    rig.say(rig.peer.heartbeat())
    (change,) = rig.of(ModeChanged)
    assert (change.commanded, change.kind) == (False, "pilot")
    rig.run(30.0)
    assert rig.motion() == []
    assert not rig.core.in_control
    for motion in (rig.autopilot.return_to_launch(), rig.autopilot.change_speed(3.0)):
        with pytest.raises(NotPermitted):
            rig.core.request(motion, rig.now)
    assert mode_title(PILOT[flavor]) in refused(rig)


@FLAVORS
def test_control_stays_lost_when_the_pilot_goes_back_to_the_guided_mode(flavor: str) -> None:
    rig = Rig(flavor).flying()
    rig.peer.mode = PILOT[flavor]
    rig.run(1.0)
    rig.peer.mode = GUIDED[flavor]
    rig.run(3.0)
    assert rig.core.telemetry.guided
    assert mode_title(PILOT[flavor]) in refused(rig)
    rig.core.take_control(rig.now)
    go(rig)
    assert len(rig.motion()) == 1


@FLAVORS
def test_pilot_who_switches_there_and_back_between_two_decisions_is_not_missed(flavor: str) -> None:
    rig = Rig(flavor).flying()
    there = rig.peer.mode, PILOT[flavor]
    rig.peer.mode = there[1]
    away = rig.peer.heartbeat()
    rig.peer.mode = there[0]
    rig.core.receive_data(away + rig.peer.heartbeat(), rig.now)
    assert "not by us" in refused(rig)


@FLAVORS
def test_take_over_drops_the_repetitions_of_a_mode_command(flavor: str) -> None:
    """A lost acknowledgement must not make us take the mode back from the pilot a second later."""
    rig = Rig(flavor).flying()
    rig.peer.mode = PILOT[flavor]
    rig.run(1.0)
    rig.core.request(rig.autopilot.set_mode(GUIDED[flavor]), rig.now, ordered=True)
    assert len(rig.messages("COMMAND_LONG", SET_MODE)) == 1
    rig.peer.mode = "STABILIZE" if flavor == "ardupilot" else "AUTO_RTL"
    rig.say(rig.peer.heartbeat())
    rig.forget()
    rig.run(20.0)
    assert rig.motion() == []
    assert any(isinstance(done.outcome, Cancelled) for done in rig.of(CommandDone))


@FLAVORS
def test_mode_we_asked_for_is_commanded_and_ends_the_repetitions(flavor: str) -> None:
    rig = Rig(flavor).flying()
    rig.core.request(rig.autopilot.return_to_launch(), rig.now)
    rig.peer.mode = RETURN[flavor]
    rig.run(5.0)
    (change,) = rig.of(ModeChanged)
    assert (change.commanded, change.kind) == (True, "return")
    assert rig.core.in_control
    assert len(rig.messages("COMMAND_LONG", RTL)) <= 2
    assert "mode" in refused(rig)


@FLAVORS
def test_guided_mode_chosen_by_the_pilot_during_our_return_is_not_ours(flavor: str) -> None:
    rig = Rig(flavor).flying()
    rig.core.request(rig.autopilot.return_to_launch(), rig.now)
    rig.peer.mode = RETURN[flavor]
    rig.run(10.0)
    rig.peer.mode = GUIDED[flavor]
    rig.run(2.0)
    assert [c.commanded for c in rig.of(ModeChanged)] == [True, False]
    assert "not by us" in refused(rig)


@FLAVORS
def test_mode_that_the_pilot_chooses_after_overtaking_our_order_is_not_ours(flavor: str) -> None:
    """We ask for the return, the pilot takes the sticks, and then returns himself: that return is his."""
    rig = Rig(flavor).flying()
    rig.core.request(rig.autopilot.return_to_launch(), rig.now)
    for mode in (PILOT[flavor], RETURN[flavor]):
        rig.peer.mode = mode
        rig.run(1.0)
    assert [c.commanded for c in rig.of(ModeChanged)] == [False, False]


@FLAVORS
def test_order_that_was_carried_out_does_not_make_the_pilots_later_choice_ours(flavor: str) -> None:
    rig = Rig(flavor).flying()
    rig.core.request(rig.autopilot.return_to_launch(), rig.now)
    rig.peer.mode = RETURN[flavor]
    rig.run(1.0)
    rig.core.request(rig.autopilot.set_mode(GUIDED[flavor]), rig.now)
    rig.peer.mode = GUIDED[flavor]
    rig.run(1.0)
    rig.peer.mode = RETURN[flavor]
    rig.run(1.0)
    assert [c.commanded for c in rig.of(ModeChanged)] == [True, True, False]


@FLAVORS
def test_target_is_not_repeated_nor_missed_once_we_fly_home(flavor: str) -> None:
    rig = Rig(flavor).flying()
    go(rig)
    rig.core.request(rig.autopilot.return_to_launch(), rig.now)
    rig.peer.mode = RETURN[flavor]
    rig.run(20.0)
    assert len(rig.messages("COMMAND_INT")) == 1
    assert rig.of(TargetNotTaken) == []


@pytest.mark.parametrize(("flavor", "altitude"), [("px4", GROUND + 20.0), ("ardupilot", 20.0)])
def test_take_off_altitude_is_in_the_reference_of_the_autopilot(flavor: str, altitude: float) -> None:
    rig = Rig(flavor, allow_arming=True).flying()
    rig.core.request(rig.autopilot.take_off(20.0, GROUND), rig.now)
    (sent,) = rig.messages("COMMAND_LONG", mavlink.MAV_CMD_NAV_TAKEOFF)
    assert sent.param7 == pytest.approx(altitude)


def test_hold_after_our_take_off_and_after_our_landing_is_ours_on_px4() -> None:
    rig = Rig("px4", allow_arming=True).flying()
    rig.core.request(rig.autopilot.take_off(20.0, GROUND), rig.now)
    for mode, height in (("AUTO_TAKEOFF", 5.0), ("AUTO_LOITER", 19.0)):
        rig.peer.mode, rig.peer.height = mode, height
        rig.run(12.0)
    rig.core.request(rig.autopilot.return_to_launch(), rig.now)
    rig.peer.mode = "AUTO_RTL"
    rig.run(60.0)
    rig.peer.mode, rig.peer.armed = "AUTO_LOITER", False
    rig.run(2.0)
    assert [c.commanded for c in rig.of(ModeChanged)] == [True] * 4
    assert not rig.core.in_control, "a disarmed aircraft is nobody's"


def test_hold_chosen_by_the_pilot_in_the_middle_of_our_climb_is_not_ours() -> None:
    rig = Rig("px4", allow_arming=True).flying()
    rig.core.request(rig.autopilot.take_off(20.0, GROUND), rig.now)
    for mode, height in (("AUTO_TAKEOFF", 5.0), ("AUTO_LOITER", 9.0)):
        rig.peer.mode, rig.peer.height = mode, height
        rig.run(3.0)
    assert [c.commanded for c in rig.of(ModeChanged)] == [True, False]
    assert "not by us" in refused(rig)


def test_hold_after_a_take_off_that_was_not_ours_is_not_ours() -> None:
    rig = Rig("px4").flying()
    for mode in ("AUTO_TAKEOFF", "AUTO_LOITER"):
        rig.peer.mode = mode
        rig.run(2.0)
    assert [c.commanded for c in rig.of(ModeChanged)] == [False, False]


@FLAVORS
def test_failsafe_is_told_from_a_pilot(flavor: str) -> None:
    pilot, failsafe = Rig(flavor).flying(), Rig(flavor).flying()
    failsafe.say(failsafe.peer.text("Battery Failsafe", 4))
    for rig in (pilot, failsafe):
        rig.peer.mode = RETURN[flavor]
        rig.run(1.0)
    assert [c.failsafe for c in pilot.of(ModeChanged)] == [False]
    assert [c.failsafe for c in failsafe.of(ModeChanged)] == [True]


@FLAVORS
def test_stale_heartbeat_stops_repositions_and_their_repetitions(flavor: str) -> None:
    rig = Rig(flavor).flying()
    go(rig)
    rig.beating = False
    rig.forget()
    rig.run(2.5)
    assert rig.motion() == []
    assert "not been heard" in refused(rig)
    rig.run(20.0)
    assert rig.motion() == []
    assert len(rig.of(TargetNotTaken)) == 1


@pytest.mark.parametrize(
    ("what", "why"),
    [
        ("disarmed", "armed"),
        ("on the ground", "on_ground"),
        ("climbing", "takeoff"),
        ("landing", "landing"),
        ("no position", "position"),
    ],
)
def test_only_an_aircraft_in_the_air_at_a_known_place_is_sent_anywhere(what: str, why: str) -> None:
    rig = Rig().flying()
    rig.peer.landed = {"on the ground": 1, "climbing": 3, "landing": 4}.get(what, 2)
    rig.peer.armed = what != "disarmed"
    rig.positioning = what != "no position"
    rig.run(3.0)
    assert why in refused(rig)


@pytest.mark.parametrize(
    ("lat", "lon", "alt", "why"),
    [
        (95.0, LON, ALT, "not on earth"),
        (LAT, 181.0, ALT, "not on earth"),
        (math.nan, LON, ALT, "not a place"),
        (LAT, math.inf, ALT, "not a place"),
        (LAT, LON, math.nan, "not a place"),
        (0.0, 0.0, ALT, "m away"),
        (LAT + 2.0, LON, ALT, "m away"),
        (NORTH, LON, 20.0, "above sea level"),
        (NORTH, LON, ALT + 5000.0, "above sea level"),
    ],
)
def test_a_place_that_is_a_mistake_is_not_flown_to(lat: float, lon: float, alt: float, why: str) -> None:
    """PX4 accepts latitude 95, 0/0, and an altitude over home taken for one above sea level."""
    rig = Rig().flying()
    with pytest.raises(NotPermitted, match=why):
        go(rig, lat, lon, alt)
    assert rig.motion() == []


def test_after_our_own_pause_nothing_old_is_sent_until_the_vehicle_is_heard_again() -> None:
    rig = Rig().flying()
    go(rig)
    waiting = [rig.peer.heartbeat(), rig.peer.position(rig.now)]
    rig.forget()
    rig.now += 5.0
    for data in waiting:  # from the socket's buffer, as old as the pause
        rig.say(data)
    assert "stood still" in refused(rig)
    assert len(rig.of(Stalled)) == 1
    assert [e.reason for e in rig.of(TargetNotTaken)] == ["the service stood still"]
    rig.run(3.0)
    assert rig.motion() == []
    go(rig)
    assert len(rig.motion()) == 1


def test_a_pause_drops_the_repetitions_of_motion_commands() -> None:
    rig = Rig().flying()
    rig.core.request(rig.autopilot.return_to_launch(), rig.now)
    rig.forget()
    rig.now += 5.0
    rig.run(10.0)
    assert rig.motion() == []


@FLAVORS
def test_nothing_is_repeated_that_is_not_wanted_any_more(flavor: str) -> None:
    rig = Rig(flavor).flying()
    go(rig)
    rig.core.request(rig.autopilot.change_speed(3.0), rig.now)
    rig.forget()
    rig.core.stand_by("the mission holds", rig.now)
    rig.run(30.0)
    assert rig.motion() == []
    assert rig.of(TargetNotTaken) == []
    go(rig)
    assert len(rig.motion()) == 1


@FLAVORS
def test_motion_command_is_not_repeated_while_the_vehicle_is_not_heard(flavor: str) -> None:
    rig = Rig(flavor, link_lost_s=60.0, command_attempts=50).flying()
    rig.core.request(rig.autopilot.return_to_launch(), rig.now)
    rig.beating = False
    rig.run(3.0)
    assert 1 <= len(rig.motion()) <= 3
    rig.forget()
    rig.run(20.0)
    assert rig.motion() == []
    rig.beating = True
    rig.run(3.0)
    assert len(rig.messages("COMMAND_LONG", RTL)) >= 1, "in the same mode as before, the order still stands"


def test_arming_and_take_off_are_never_sent_unless_allowed() -> None:
    rig = Rig().flying()
    for command in (rig.autopilot.arm(), rig.autopilot.take_off(20.0, GROUND)):
        with pytest.raises(NotPermitted, match="not allowed"):
            rig.core.request(command, rig.now, ordered=True)
    rig.run(5.0)
    assert rig.motion() == []


def test_disarming_ends_control() -> None:
    rig = Rig().flying()
    rig.peer.armed = False
    rig.run(1.0)
    rig.peer.armed = True
    rig.run(2.0)
    assert [e.armed for e in rig.of(ArmedChanged)] == [False, True]
    assert "disarmed" in refused(rig)


def test_disarmed_aircraft_is_sent_nowhere_even_in_our_control() -> None:
    rig = Rig().flying()
    rig.peer.armed = False
    rig.run(1.0)
    rig.core.take_control(rig.now)
    assert "not armed" in refused(rig)


def test_disarming_drops_the_repetitions_of_motion_commands() -> None:
    rig = Rig().flying()
    rig.core.request(rig.autopilot.change_speed(5.0), rig.now)
    rig.peer.armed = False
    rig.say(rig.peer.heartbeat())
    rig.forget()
    rig.run(10.0)
    assert rig.motion() == []


def test_control_cannot_be_taken_in_the_pilots_mode_or_from_a_silent_vehicle() -> None:
    rig = Rig().flying()
    rig.peer.mode = "POSCTL"
    rig.run(1.0)
    with pytest.raises(NotPermitted, match="Position"):
        rig.core.take_control(rig.now)
    rig.beating = False
    rig.run(4.0)
    with pytest.raises(NotPermitted, match="not been heard"):
        rig.core.take_control(rig.now)
    with pytest.raises(NotPermitted, match="no vehicle"):
        LinkCore(rig.core.settings).take_control(rig.now)


def test_every_mode_of_px4_has_the_name_that_a_ground_station_shows() -> None:
    numbers = [(main << 16, main) for main in (1, 2, 3, 5, 6, 7, 8)] + [
        (4 << 16 | sub << 24, sub) for sub in (*range(1, 7), 8, 9, 10)
    ]
    titles = [mode_title(PX4().mode_name(1, custom)) for custom, _ in numbers]
    assert len(set(titles)) == len(titles)
    assert not [title for title in titles if "_" in title or title.isupper()]
