"""Others who command the aircraft: a target that is not ours, and a second service that speaks as we do."""

from __future__ import annotations

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.mavlink.errors import NotPermitted
from service.mavlink.events import AnotherService, ModeChanged, TargetNotTaken, TargetReplaced

from .peer import ALT, FLAVORS, GUIDED, LAT, LON, NORTH, PILOT, REPOSITION, RETURN, Peer, Rig, go


def searching(flavor: str) -> Rig:
    """On its way to a waypoint of ours."""
    rig = Rig(flavor).flying()
    go(rig)
    rig.peer.target = (NORTH, LON, ALT)
    rig.run(2.0)
    return rig


def names(rig: Rig, lat: float) -> None:
    """It names a target, once, a moment later."""
    rig.now += 0.1
    rig.peer.target = (lat, LON, ALT)
    rig.say(rig.peer.position_target(rig.now))


@FLAVORS
@pytest.mark.parametrize(
    "theirs", [(LAT - 0.001, LON, ALT), (NORTH, LON, ALT + 10.0)], ids=["go to", "change altitude"]
)
def test_a_target_of_somebody_else_takes_the_aircraft(
    flavor: str, theirs: tuple[float, float, float]
) -> None:
    rig = searching(flavor)
    rig.forget()
    rig.peer.target = theirs
    rig.run(2.0)
    (replaced,) = rig.of(TargetReplaced)
    assert (replaced.found.lat, replaced.found.alt_amsl_m) == pytest.approx((theirs[0], theirs[2]))
    assert not rig.core.in_control
    assert "another target" in rig.core.telemetry.control_reason
    with pytest.raises(NotPermitted):
        go(rig)
    assert rig.motion() == [], "nobody is overridden"


@FLAVORS
def test_a_target_of_somebody_else_is_noticed_while_none_of_ours_is_under_way(flavor: str) -> None:
    rig = searching(flavor)
    rig.core.stand_by("the mission wants something else now", rig.now)
    rig.peer.target = (LAT - 0.001, LON, ALT)
    rig.run(2.0)
    (replaced,) = rig.of(TargetReplaced)
    assert replaced.target is None


@FLAVORS
def test_a_target_of_somebody_else_is_noticed_as_soon_as_the_mode_that_we_asked_for_is_there(
    flavor: str,
) -> None:
    """Not only after the time for which that mode might have been on its way."""
    rig = Rig(flavor).flying()
    rig.peer.mode = PILOT[flavor]
    rig.run(1.5)
    rig.core.request(rig.autopilot.set_mode(GUIDED[flavor]), rig.now, ordered=True)
    rig.run(0.3)
    rig.peer.mode = GUIDED[flavor]
    rig.run(1.2)
    rig.core.take_control(rig.now)
    go(rig)
    rig.peer.target = (NORTH, LON, ALT)
    rig.run(1.0)
    rig.peer.target = (LAT - 0.001, LON, ALT)
    rig.run(1.5)
    assert len(rig.of(TargetReplaced)) == 1
    assert not rig.core.in_control


@FLAVORS
def test_the_last_target_of_ours_that_it_took_is_no_strangers_however_many_it_does_not_take(
    flavor: str,
) -> None:
    rig = searching(flavor)
    for number in range(1, 8):
        go(rig, LAT + 0.0001 * number)
        rig.run(1.0)  # it still names the first
    assert rig.of(TargetReplaced) == []
    assert rig.core.in_control


@FLAVORS
def test_a_waypoint_waits_while_somebody_else_may_just_have_given_one(flavor: str) -> None:
    rig = searching(flavor)
    names(rig, LAT - 0.001)
    with pytest.raises(NotPermitted, match="somebody else"):
        go(rig, LAT + 0.0006)
    names(rig, NORTH)
    go(rig, LAT + 0.0006)
    assert rig.of(TargetReplaced) == []


@FLAVORS
def test_a_suspicion_that_nothing_follows_ends_and_never_keeps_a_stop_from_going_out(flavor: str) -> None:
    rig = searching(flavor)
    names(rig, LAT - 0.001)
    rig.peer.target = None  # the stream stops
    with pytest.raises(NotPermitted, match="somebody else"):
        go(rig, LAT + 0.0006)
    rig.forget()
    rig.core.hold(rig.now)
    rig.run(0.1)
    assert len(rig.motion()) == 1
    rig.run(5.5)
    go(rig, LAT + 0.0006)


@FLAVORS
def test_who_was_overtaken_by_a_waypoint_on_its_way_gets_the_aircraft(flavor: str) -> None:
    rig = searching(flavor)
    go(rig, LAT + 0.0006)
    for lat in (LAT - 0.001, LAT + 0.0006):
        names(rig, lat)
    (replaced,) = rig.of(TargetReplaced)
    assert replaced.found.lat == pytest.approx(LAT - 0.001)
    assert not rig.core.in_control


@FLAVORS
def test_a_waypoint_is_not_repeated_while_somebody_else_may_just_have_given_one(flavor: str) -> None:
    rig = searching(flavor)
    go(rig, LAT + 0.0006)
    rig.run(1.8)  # it is not named: in a moment it is sent again
    rig.forget()
    rig.peer.target = (LAT - 0.001, LON, ALT)
    rig.say(rig.peer.position_target(rig.now))
    rig.peer.target = None
    rig.run(0.6)
    assert rig.motion() == []


@FLAVORS
def test_where_it_hovered_when_it_was_taken_over_is_nobody_elses_target(flavor: str) -> None:
    rig = Rig(flavor)
    rig.peer.target = (LAT, LON, ALT)
    rig.flying()
    rig.run(3.0)
    go(rig)
    rig.run(3.0)  # the first waypoint is lost for a while: it still names where it hovers
    rig.peer.target = (NORTH, LON, ALT)
    rig.run(3.0)
    rig.core.hold(rig.now)
    rig.run(3.0)
    assert rig.of(TargetReplaced) == []
    assert rig.core.in_control


@FLAVORS
def test_what_the_aircraft_flies_by_itself_is_nobody_elses_target(flavor: str) -> None:
    rig = searching(flavor)
    rig.core.brake(rig.now)
    rig.peer.target = (LAT + 0.0001, LON, ALT)
    rig.run(1.0)
    rig.peer.target = (LAT + 0.0002, LON, ALT)
    rig.run(5.0)
    assert rig.of(TargetReplaced) == []


@FLAVORS
def test_the_target_of_a_mode_that_we_asked_for_may_be_named_before_the_mode_shows(flavor: str) -> None:
    rig = searching(flavor)
    rig.core.request(rig.autopilot.return_to_launch(), rig.now)
    rig.peer.target = (LAT - 0.001, LON, ALT + 10.0)
    for _ in range(3):
        rig.now += 0.3
        rig.say(rig.peer.position_target(rig.now))
    rig.peer.mode = RETURN[flavor]
    rig.say(rig.peer.heartbeat())
    (change,) = rig.of(ModeChanged)
    assert change.commanded
    assert rig.of(TargetReplaced) == []


def test_who_gave_it_is_named_when_the_answer_to_it_was_heard() -> None:
    rig = searching("ardupilot")
    rig.say(rig.peer.ack(REPOSITION, mavlink.MAV_RESULT_ACCEPTED, target=(255, 190)))
    rig.peer.target = (LAT - 0.001, LON, ALT)
    rig.run(2.0)
    (replaced,) = rig.of(TargetReplaced)
    assert replaced.by == "system 255, component 190 (DO_REPOSITION)"


def follows(rig: Rig, mask: int, times: int = 1, north: float = 0.0) -> None:
    """ArduCopter tells what its guided mode follows."""
    for _ in range(times):
        rig.run(0.5)
        message = mavlink.MAVLink_position_target_local_ned_message(
            rig.peer.boot_ms(rig.now), mavlink.MAV_FRAME_LOCAL_NED, mask, 0.0, 0.0, 0.0, north, *[0.0] * 7
        )
        rig.say(rig.peer.pack(message))


PLACE, VELOCITY, BOTH, ACCELERATION = 0x0DF8, 0x0DC7, 0x0C00, 0x0C3F


@pytest.mark.parametrize("mask", [VELOCITY, BOTH, ACCELERATION])
def test_who_steers_it_without_a_waypoint_takes_it(mask: int) -> None:
    rig = searching("ardupilot")
    rig.peer.target = None
    follows(rig, PLACE, times=3)
    follows(rig, mask)
    follows(rig, PLACE)  # a waypoint of ours came after it
    follows(rig, mask)
    assert rig.of(TargetReplaced) == []
    follows(rig, mask)
    (replaced,) = rig.of(TargetReplaced)
    assert replaced.found is None
    assert not rig.core.in_control


def test_what_it_flies_before_a_waypoint_of_ours_or_after_our_stop_is_no_strangers_velocity() -> None:
    rig = Rig("ardupilot").flying()
    rig.peer.target = None
    follows(rig, VELOCITY, times=5)  # so it enters the guided mode
    go(rig)
    follows(rig, VELOCITY, times=3)  # the waypoint is on its way
    rig.peer.target = (NORTH, LON, ALT)
    rig.run(2.0)
    rig.peer.target = None
    rig.core.brake(rig.now)
    rig.run(0.1)
    rig.say(
        rig.peer.ack(mavlink.MAV_CMD_DO_SET_MODE, mavlink.MAV_RESULT_FAILED)
    )  # so it is told to stand still
    follows(rig, VELOCITY, times=5)
    assert rig.of(TargetReplaced) == []
    assert rig.core.in_control


def test_who_steers_it_somewhere_takes_it_before_a_waypoint_of_ours_is_named_too() -> None:
    rig = Rig("ardupilot").flying()
    rig.peer.target = None
    go(rig)
    follows(rig, VELOCITY, north=2.0)
    assert rig.of(TargetReplaced) == []
    follows(rig, VELOCITY, north=2.0)
    assert len(rig.of(TargetReplaced)) == 1


def test_what_another_autopilot_tells_of_its_own_steering_takes_nothing() -> None:
    rig = searching("px4")
    follows(rig, VELOCITY, times=5)
    assert rig.of(TargetReplaced) == []


@pytest.mark.parametrize(
    ("command", "theirs"), [(mavlink.MAV_CMD_DO_PAUSE_CONTINUE, True), (REPOSITION, False)]
)
def test_an_answer_that_names_nobody_is_somebody_elses_where_we_have_not_asked(
    command: int, theirs: bool
) -> None:
    """MAVLink 1 has no room for whom an answer is for."""
    rig = searching("ardupilot")
    rig.say(rig.peer.ack(command, mavlink.MAV_RESULT_ACCEPTED, target=(0, 0)))
    assert len(rig.of(TargetReplaced)) == theirs
    assert rig.core.in_control != theirs


def test_heartbeats_as_ours_that_we_did_not_send_are_told_once_a_minute() -> None:
    rig = Rig().flying()
    other = Peer(system=7, component=191)
    for _ in range(40):
        rig.say(other.heartbeat(mavlink.MAV_TYPE_ONBOARD_CONTROLLER, mavlink.MAV_AUTOPILOT_INVALID))
        rig.run(1.0)
    (told,) = rig.of(AnotherService)
    assert told.reason == "another program sends heartbeats as this service"
    rig.run(40.0)
    for _ in range(3):
        rig.say(other.heartbeat(mavlink.MAV_TYPE_ONBOARD_CONTROLLER, mavlink.MAV_AUTOPILOT_INVALID))
        rig.run(1.0)
    assert len(rig.of(AnotherService)) == 2


def test_our_own_heartbeats_that_come_back_are_no_second_service() -> None:
    rig = Rig().flying()
    for _ in range(100):
        rig.now += 0.1
        rig.say(rig.peer.heartbeat())
        rig.core.tick(rig.now)
        for frame in rig.core.data_to_send():
            rig.say(frame)
    assert rig.of(AnotherService) == []


def test_answers_to_commands_that_we_never_sent_are_those_of_a_second_service() -> None:
    rig = Rig().flying()
    rig.say(rig.peer.ack(mavlink.MAV_CMD_NAV_LAND, mavlink.MAV_RESULT_ACCEPTED))
    assert rig.of(AnotherService) == []
    rig.say(rig.peer.ack(mavlink.MAV_CMD_NAV_LAND, mavlink.MAV_RESULT_ACCEPTED))
    (told,) = rig.of(AnotherService)
    assert told.reason == "another program commands as this service (NAV_LAND)"


def test_a_companion_of_another_component_is_no_second_service() -> None:
    rig = Rig().flying()
    camera = Peer(system=7, component=100)
    for _ in range(5):
        rig.say(camera.heartbeat(mavlink.MAV_TYPE_CAMERA, mavlink.MAV_AUTOPILOT_INVALID))
        rig.run(1.0)
    assert rig.of(AnotherService) == []


def corrected(rig: Rig, by_m: float) -> None:
    """The position's altitude above the sea is so much more than before."""
    rig.now += 0.1
    place = round(LAT * 1e7), round(LON * 1e7), round((ALT + by_m) * 1000), 20_000
    message = mavlink.MAVLink_global_position_int_message(rig.peer.boot_ms(rig.now), *place, 0, 0, 0, 9000)
    rig.say(rig.peer.pack(message))


@FLAVORS
@pytest.mark.parametrize("names_new", [True, False])
def test_a_target_that_a_correction_of_sea_level_renames_is_still_ours(flavor: str, names_new: bool) -> None:
    rig = searching(flavor)
    rig.positioning = False
    corrected(rig, 8.0)
    rig.peer.target = (NORTH, LON, ALT + 8.0 * names_new)
    rig.run(1.0)
    corrected(rig, 8.0)
    rig.run(1.0)
    assert rig.of(TargetReplaced) == []
    assert rig.core.in_control
    rig.peer.target = (NORTH, LON, ALT + 30.0)
    rig.run(2.0)
    assert len(rig.of(TargetReplaced)) == 1


def test_a_target_with_an_altitude_of_before_a_correction_is_not_repeated() -> None:
    rig = Rig("ardupilot").flying()
    go(rig)
    rig.positioning = False
    corrected(rig, 8.0)
    rig.forget()
    for _ in range(60):
        corrected(rig, 8.0)
        rig.run(0.1)
    assert rig.messages("COMMAND_INT", REPOSITION) == []
    (given_up,) = rig.of(TargetNotTaken)
    assert given_up.reason == "sea level has moved"


@FLAVORS
@pytest.mark.parametrize(
    "command",
    [mavlink.MAV_CMD_DO_CHANGE_SPEED, mavlink.MAV_CMD_DO_REPOSITION, mavlink.MAV_CMD_DO_PAUSE_CONTINUE],
)
def test_who_is_answered_that_a_command_of_his_flies_the_aircraft_has_it(flavor: str, command: int) -> None:
    """Which shows also where the autopilot does not name its target any more."""
    rig = searching(flavor)
    rig.peer.target = None
    rig.say(rig.peer.ack(command, mavlink.MAV_RESULT_DENIED, target=(255, 190)))
    rig.say(rig.peer.ack(command, mavlink.MAV_RESULT_ACCEPTED))  # to us
    assert rig.of(TargetReplaced) == []
    rig.forget()
    rig.say(rig.peer.ack(command, mavlink.MAV_RESULT_ACCEPTED, target=(255, 190)))
    rig.run(2.0)
    (replaced,) = rig.of(TargetReplaced)
    assert (replaced.found, replaced.by.partition(" (")[0]) == (None, "system 255, component 190")
    assert not rig.core.in_control
    assert rig.motion() == []
