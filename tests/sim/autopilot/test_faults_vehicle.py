"""What a mock under a fault does: references that move, others who take it, a mind of its own."""

from __future__ import annotations

import math

import pytest

from sim.autopilot.dialect import M
from sim.autopilot.faults import Fault
from tests.conformance.dialogue import GUIDED, PILOT
from tests.conformance.wire import mav
from tests.sim.autopilot.hovering import LAND, RETURN, Flight, flavor, flight

__all__ = ["flavor", "flight"]


# ---- what heights and places are counted from
def test_a_corrected_sea_level_lowers_who_flies_to_an_old_altitude(flight: Flight) -> None:
    before, amsl = flight.latest["GLOBAL_POSITION_INT"], flight.amsl(20.0)
    flight.fault("amsl_corrected", metres=10.0)
    flight.listen(1.0)
    here = flight.latest["GLOBAL_POSITION_INT"]
    assert here.alt - before.alt == pytest.approx(10_000, abs=1500)
    assert here.relative_alt == pytest.approx(before.relative_alt, abs=1500)
    assert flight.latest["HOME_POSITION"].altitude == pytest.approx(here.alt - here.relative_alt, abs=1500)
    flight.reposition(*flight.point(0, 0), amsl, flags=0)
    flight.listen(15.0)
    assert flight.autopilot.vehicle.body.up == pytest.approx(10.0, abs=1.5)


def test_home_that_moves_changes_the_heights_above_it(flight: Flight) -> None:
    before, up = flight.latest["GLOBAL_POSITION_INT"], flight.autopilot.vehicle.body.up
    flight.fault("home_moved", north=30.0, up=8.0, seconds=4.0)
    flight.listen(1.0)
    here = flight.latest["GLOBAL_POSITION_INT"]
    assert before.relative_alt - here.relative_alt == pytest.approx(8000, abs=1500)
    assert here.alt == pytest.approx(before.alt, abs=1500)
    assert flight.autopilot.vehicle.body.up == pytest.approx(up, abs=1.0)
    flight.listen(4.0)
    assert flight.latest["GLOBAL_POSITION_INT"].relative_alt == pytest.approx(before.relative_alt, abs=1500)


def test_an_origin_that_moves_changes_local_positions_only(flight: Flight) -> None:
    for number in (mav.MAVLINK_MSG_ID_LOCAL_POSITION_NED, mav.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN):
        flight.long(mav.MAV_CMD_SET_MESSAGE_INTERVAL, number, 2e5)
    flight.listen(1.0)
    local, place = flight.latest["LOCAL_POSITION_NED"].x, flight.latest["GLOBAL_POSITION_INT"].lat
    origin = flight.latest["GPS_GLOBAL_ORIGIN"].latitude
    flight.fault("origin_moved", north=100.0)
    flight.listen(1.0)
    assert local - flight.latest["LOCAL_POSITION_NED"].x == pytest.approx(100.0, abs=2.0)
    assert (flight.latest["GPS_GLOBAL_ORIGIN"].latitude - origin) * 0.0111 == pytest.approx(100.0, abs=1.0)
    assert flight.latest["GLOBAL_POSITION_INT"].lat == pytest.approx(place, abs=200)


def test_a_distance_sensor_sees_the_ground_that_is_higher(flight: Flight) -> None:
    flight.fault("distance_sensor", rise=5.0)
    number = mav.MAVLINK_MSG_ID_DISTANCE_SENSOR
    flight.long(mav.MAV_CMD_SET_MESSAGE_INTERVAL, number, 1e5)
    flight.listen(1.0)
    seen = flight.latest["DISTANCE_SENSOR"]
    assert seen.orientation == mav.MAV_SENSOR_ROTATION_PITCH_270
    assert seen.current_distance == pytest.approx(100.0 * (flight.autopilot.vehicle.body.up - 5.0), abs=60)


def test_an_ardupilot_with_heights_of_the_ground_tells_how_far_it_is_below(flight: Flight) -> None:
    ask = (mav.MAV_CMD_SET_MESSAGE_INTERVAL, mav.MAVLINK_MSG_ID_TERRAIN_REPORT, 1e5)
    if flight.px4:
        assert flight.long(*ask) != ["ACCEPTED"]
        return
    flight.long(*ask)
    flight.listen(1.0)
    assert flight.latest["TERRAIN_REPORT"].spacing == 0
    flight.fault("terrain_report", rise=5.0)
    flight.listen(1.0)
    seen = flight.latest["TERRAIN_REPORT"]
    assert seen.current_height == pytest.approx(flight.autopilot.vehicle.body.up - 5.0, abs=0.6)


def test_wind_is_told_only_when_the_estimator_knows_it(flight: Flight) -> None:
    name = "WIND_COV" if flight.px4 else "WIND"
    flight.fault("wind", north=0.0, east=6.0)
    number = getattr(mav, f"MAVLINK_MSG_ID_{name}")
    assert flight.long(mav.MAV_CMD_SET_MESSAGE_INTERVAL, number, 2e5) == ["ACCEPTED"]
    flight.listen(2.0)
    assert name not in flight.latest
    flight.fault("wind", north=0.0, east=6.0, told="yes")
    flight.listen(1.0)
    wind = flight.latest[name]
    assert (wind.wind_y if flight.px4 else wind.speed) == pytest.approx(6.0)
    if not flight.px4:
        assert wind.direction == pytest.approx(-90.0)  # it comes from the west


# ---- the pilot
@pytest.mark.parametrize("mode", ["pilot", "land"])
def test_a_pilot_chooses_a_mode_on_the_ground(flavor: str, mode: str) -> None:
    flight = Flight(flavor, hovers=False)
    chosen = PILOT[flavor] if mode == "pilot" else LAND[flavor]
    flight.fault("pilot", mode="" if mode == "pilot" else chosen)
    flight.listen(1.5)
    assert flight.mode == chosen
    assert not flight.armed


def test_a_pilot_chooses_a_mode_the_moment_it_arms(flavor: str) -> None:
    flight = Flight(flavor, hovers=False)
    flight.autopilot.faults.add(Fault.of({"kind": "pilot", "after_arming": 0.0}))
    flight.listen(1.0)
    assert flight.mode == GUIDED[flavor]
    assert flight.long(mav.MAV_CMD_COMPONENT_ARM_DISARM, 1) == ["ACCEPTED"]
    flight.listen(1.5)
    assert flight.mode == PILOT[flavor]


def test_deflected_sticks_are_told(flight: Flight) -> None:
    for number in (mav.MAVLINK_MSG_ID_RC_CHANNELS, mav.MAVLINK_MSG_ID_MANUAL_CONTROL):
        flight.long(mav.MAV_CMD_SET_MESSAGE_INTERVAL, number, 2e5)
    flight.listen(1.5)
    if flight.px4:
        assert "RC_CHANNELS" not in flight.latest
    else:  # its simulator's receiver: everything in the middle, the throttle down
        assert flight.latest["RC_CHANNELS"].chan3_raw == 1000
    flight.fault("pilot", mode="keep", pitch=0.2, roll=-0.2)
    flight.listen(1.0)
    channels = flight.latest["RC_CHANNELS"]
    assert (channels.chan1_raw, channels.chan2_raw, channels.chan3_raw) == (1400, 1400, 1500)
    if flight.px4:
        assert (flight.latest["MANUAL_CONTROL"].x, flight.latest["MANUAL_CONTROL"].y) == (200, -200)


@pytest.mark.parametrize("flavor", ["px4"])
def test_a_pilots_hold_on_px4_is_the_guided_mode_and_stops_nothing(flavor: str) -> None:
    flight = Flight(flavor)
    leg = flight.go(60, 0, wait=0)
    flight.listen(3.0)
    flight.fault("pilot_hold")
    modes = set()
    for _ in range(200):
        flight.listen(0.1)
        modes.add(flight.autopilot.firmware.mode)
    assert modes == {"AUTO_LOITER"}
    assert leg.remaining < 2.0


@pytest.mark.parametrize("flavor", ["px4"])
def test_a_hold_that_was_left_and_entered_drops_the_target(flavor: str) -> None:
    flight = Flight(flavor)
    leg = flight.go(60, 0, wait=0)
    flight.listen(3.0)
    flight.fault("pilot_hold", way="flick")
    assert flight.autopilot.firmware.mode == "POSCTL"
    flight.listen(20.0)
    assert flight.mode == "AUTO_LOITER"
    assert leg.remaining > 20.0


@pytest.mark.parametrize("flavor", ["ardupilot"])
def test_a_pilots_hold_on_arducopter_is_another_mode(flavor: str) -> None:
    flight = Flight(flavor)
    flight.fault("pilot_hold", way="flick")
    flight.listen(1.5)
    assert flight.mode == "LOITER"


# ---- its own failsafes
@pytest.mark.parametrize("then", ["return", "recovers"])
def test_a_failsafe_holds_first(flight: Flight, then: str) -> None:
    holds, text = flight.autopilot.firmware.flavor.failsafe_hold
    flight.fault("failsafe_hold", then=then)
    flight.listen(2.0)
    assert flight.autopilot.firmware.mode == holds
    assert flight.latest["HEARTBEAT"].system_status == mav.MAV_STATE_CRITICAL
    assert flight.said(text)
    flight.listen(5.0)
    assert flight.mode == (RETURN[flight.flavor] if then == "return" else holds.replace("BRAKE", "17"))
    critical = flight.latest["HEARTBEAT"].system_status == mav.MAV_STATE_CRITICAL
    assert critical == (then == "return")


def test_it_flies_on_by_dead_reckoning_to_its_last_waypoint(flight: Flight) -> None:
    leg = flight.go(60, 0, wait=0)
    flight.listen(2.0)
    flight.fault("gps_lost", reckons_s=30.0)
    flight.listen(15.0)
    assert not flight.status.onboard_control_sensors_health & mav.MAV_SYS_STATUS_SENSOR_GPS
    assert flight.mode == GUIDED[flight.flavor]
    assert leg.remaining < 3.0


def test_dead_reckoning_drifts(flight: Flight) -> None:
    flight.fault("gps_lost", reckons_s=30.0, drift_mps=1.0, seconds=10.0)
    flight.listen(9.5)
    body, seen = flight.autopilot.vehicle.body, flight.autopilot.vehicle.seen
    assert seen.north - body.north == pytest.approx(9.5, abs=1.5)
    assert body.north < -5.0  # it holds the place that it believes in


# ---- arming
def test_it_refuses_to_arm_although_it_says_it_is_ready(flavor: str) -> None:
    flight = Flight(flavor, hovers=False)
    flight.fault("arming_refused", seconds=6.0)
    flight.listen(1.0)
    assert flight.ready
    assert flight.long(mav.MAV_CMD_COMPONENT_ARM_DISARM, 1) == [
        "TEMPORARILY_REJECTED" if flight.px4 else "FAILED"
    ]
    assert flight.said("Preflight Fail: " if flight.px4 else "PreArm: Need Position Estimate")
    assert flight.said("Resolve system health" if flight.px4 else "Arm: Need Position")
    flight.listen(6.0)
    assert flight.long(mav.MAV_CMD_COMPONENT_ARM_DISARM, 1) == ["ACCEPTED"]


# ---- others who command
def test_a_ground_station_sends_it_somewhere_else(flight: Flight) -> None:
    flight.go(0, 60, wait=0)
    flight.fault("gcs_goes", north=50.0, east=0.0)
    flight.listen(1.0)
    target = flight.latest["POSITION_TARGET_GLOBAL_INT"]
    assert flight.metres(target.lat_int, target.lon_int) == pytest.approx((50.0, 0.0), abs=2.0)
    flight.listen(20.0)
    assert math.dist((flight.here.north, flight.here.east), (50.0, 0.0)) < 3.0
    assert flight.mode == GUIDED[flight.flavor]


def test_a_ground_station_changes_the_altitude(flight: Flight) -> None:
    before = flight.latest["GLOBAL_POSITION_INT"].relative_alt
    flight.fault("gcs_altitude", by=15.0)
    flight.listen(12.0)
    assert flight.latest["GLOBAL_POSITION_INT"].relative_alt - before == pytest.approx(15_000, abs=2500)
    assert math.hypot(flight.here.north, flight.here.east) < 3.0


def test_a_ground_station_changes_the_speed_and_the_answer_is_heard(flight: Flight) -> None:
    flight.go(0, 60, wait=0)
    flight.fault("gcs_speed", mps=2.0)
    answers = [each for each in flight.heard(1.0) if each.get_type() == "COMMAND_ACK"]
    (answer,) = [each for each in answers if each.command == M.MAV_CMD_DO_CHANGE_SPEED]
    assert (answer.result, answer.target_system, answer.target_component) == (0, 255, 190)
    flight.listen(8.0)
    assert math.hypot(flight.here.north, flight.here.east) == pytest.approx(15.0, abs=4.0)


def test_a_ground_station_pauses_it_until_it_continues(flight: Flight) -> None:
    flight.go(0, 200, wait=0)
    flight.listen(4.0)
    flight.fault("gcs_pauses", seconds=14.0)
    heard = [each for each in flight.heard(1.0) if each.get_type() == "COMMAND_ACK"]
    answers = [(each.command, each.result) for each in heard]
    paused = (M.MAV_CMD_DO_PAUSE_CONTINUE, 0)
    assert answers == ([paused] if flight.autopilot.firmware.flavor.tells_local_target else [])
    flight.listen(8.0)
    assert flight.autopilot.vehicle.body.speed < 0.3
    if answers:  # a waypoint is taken, and not flown before it continues
        flight.go(0, 30, wait=0)
        flight.listen(2.0)
        assert flight.autopilot.vehicle.body.speed < 0.3
        flight.listen(25.0)
        assert flight.here.east == pytest.approx(30.0, abs=2.0)


def test_somebody_flies_it_by_a_velocity(flight: Flight) -> None:
    number = mav.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED
    flight.long(mav.MAV_CMD_SET_MESSAGE_INTERVAL, number, 5e5)
    flight.go(0, 60, wait=0)
    flight.listen(2.0)
    in_guided = flight.autopilot.firmware.flavor.tells_local_target
    if in_guided:
        assert flight.latest["POSITION_TARGET_LOCAL_NED"].type_mask & 0x3F == 0x38
    flight.fault("gcs_velocity", north=-3.0)
    flight.listen(1.0)
    names = [each.get_type() for each in flight.heard(5.0)]
    assert flight.autopilot.vehicle.body.velocity_north == pytest.approx(-3.0, abs=0.5)
    if in_guided:
        assert flight.latest["POSITION_TARGET_LOCAL_NED"].type_mask & 0x3F == 0x07
        assert "POSITION_TARGET_GLOBAL_INT" not in names
    else:
        assert flight.autopilot.firmware.mode == "OFFBOARD"


def test_a_second_service_speaks_and_commands(flight: Flight) -> None:
    flight.fault("second_service", component=192, every_s=4.0, north=40.0)
    heard = flight.heard(3.0)
    theirs = [message for message in heard if message.get_srcComponent() == 192]
    assert {message.get_type() for message in theirs} == {"HEARTBEAT", "STATUSTEXT"}
    flight.listen(17.0)
    assert flight.here.north == pytest.approx(40.0, abs=3.0)
