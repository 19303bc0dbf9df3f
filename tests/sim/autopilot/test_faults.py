"""What each fault does to a mock, as its ground station sees it."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from sim.autopilot.fault_kinds import KINDS
from sim.autopilot.faults import read_faults
from sim.autopilot.settings import Settings
from tests.conformance.dialogue import GUIDED, PILOT, Dialogue
from tests.conformance.wire import Lockstep, codec, mav
from tests.sim.autopilot.hovering import LAND, RETURN, Flight, flavor, flight

__all__ = ["flavor", "flight"]


def test_every_kind_of_fault_is_tested() -> None:
    source = "".join(
        path.read_text(encoding="utf-8") for path in Path(__file__).parent.glob("test_faults*.py")
    )
    assert [kind for kind in KINDS if f'fault("{kind}"' not in source] == []


def test_lost_link_is_silent_deaf_and_comes_back(flight: Flight) -> None:
    flight.fault("link_lost", seconds=5.0)
    flight.send(mav.MAVLink_command_long_message(1, 1, mav.MAV_CMD_NAV_RETURN_TO_LAUNCH, 0, *(0.0,) * 7))
    assert flight.heard(4.5) == []
    assert flight.autopilot.firmware.mode == GUIDED[flight.flavor]
    assert flight.count("GLOBAL_POSITION_INT", 2.0) > 20


def test_dropped_packets_are_missing(flight: Flight) -> None:
    before = flight.count("GLOBAL_POSITION_INT")
    flight.fault("packets", drop=0.5, seconds=4.0)
    assert 0.25 * before < flight.count("GLOBAL_POSITION_INT") < 0.75 * before
    flight.listen(0.5)
    assert flight.count("GLOBAL_POSITION_INT") > 0.9 * before


def test_duplicated_packets_come_twice(flight: Flight) -> None:
    before = flight.count("GLOBAL_POSITION_INT")
    flight.fault("packets", duplicate=1.0)
    assert flight.count("GLOBAL_POSITION_INT") > 1.8 * before


def test_reordered_packets_overtake_each_other(flight: Flight) -> None:
    def times() -> list[int]:
        return [m.time_boot_ms for m in flight.heard(4.0) if m.get_type() == "GLOBAL_POSITION_INT"]

    ordered = times()
    assert ordered == sorted(ordered)
    flight.fault("packets", reorder=0.3)
    mixed = times()
    assert mixed != sorted(mixed)


def test_delayed_packets_come_late_both_ways(flight: Flight) -> None:
    flight.fault("packets", delay_s=0.6)
    start = flight.now
    flight.send(mav.MAVLink_command_long_message(1, 1, mav.MAV_CMD_REQUEST_MESSAGE, 0, 148, *(0.0,) * 6))
    assert flight.wait(lambda: flight.acks, 5.0)
    assert flight.now - start > 1.15


def test_corrupted_packets_fail_their_checksum(flight: Flight) -> None:
    before = flight.count("GLOBAL_POSITION_INT")
    flight.fault("packets", corrupt=0.5)
    assert flight.count("GLOBAL_POSITION_INT") < 0.8 * before
    flight.autopilot.faults.clear("packets")
    flight.listen(1.0)
    assert flight.long(mav.MAV_CMD_REQUEST_MESSAGE, 148) == ["ACCEPTED"]


def test_lost_acknowledgements_do_not_stop_obedience(flight: Flight) -> None:
    flight.fault("acks_lost", seconds=10.0)
    leg = flight.go(20, 0, wait=0)
    assert leg.acks == []
    flight.listen(4.0)
    assert leg.moved > 3.0


def test_accepted_command_is_not_flown(flight: Flight) -> None:
    flight.fault("not_flown", seconds=10.0)
    leg = flight.go(20, 0, wait=0)
    assert leg.acks == ["ACCEPTED"]
    flight.listen(6.0)
    assert leg.moved < 2.0
    flight.listen(4.0)
    assert flight.go(20, 0).remaining < 2.0


def test_lost_gps_is_told_and_ends_in_a_landing(flight: Flight) -> None:
    flight.fault("gps_lost")
    flight.listen(2.0)
    assert flight.latest["GPS_RAW_INT"].fix_type < 2
    assert not flight.status.onboard_control_sensors_health & mav.MAV_SYS_STATUS_SENSOR_GPS
    flight.listen(4.0)
    assert flight.mode == LAND[flight.flavor]


def test_gps_jump_moves_what_the_vehicle_believes(flight: Flight) -> None:
    before = flight.here
    flight.fault("gps_jump", north=30.0, east=0.0, seconds=3.0)
    flight.listen(0.4)
    assert math.isclose(flight.here.north - before.north, 30.0, abs_tol=5.0)
    flight.listen(2.0)
    assert flight.autopilot.vehicle.body.north < before.north - 2.0  # it corrects what was no error


def test_bad_estimate_is_told_and_ends_in_a_landing(flight: Flight) -> None:
    name = "ESTIMATOR_STATUS" if flight.px4 else "EKF_STATUS_REPORT"
    number = getattr(mav, f"MAVLINK_MSG_ID_{name}")
    flight.long(mav.MAV_CMD_SET_MESSAGE_INTERVAL, number, 5e5)
    flight.listen(1.0)
    good = flight.latest[name].flags
    flight.fault("ekf_bad", seconds=20.0)
    flight.listen(2.0)
    assert good & ~flight.latest[name].flags & mav.EKF_POS_HORIZ_ABS
    assert not flight.status.onboard_control_sensors_health & mav.MAV_SYS_STATUS_AHRS
    assert not flight.ready
    assert flight.mode == LAND[flight.flavor]


def test_low_and_critical_battery_are_told(flight: Flight) -> None:
    flight.fault("battery", percent=12.0)
    flight.listen(2.0)
    assert flight.status.battery_remaining == 12
    assert flight.said("Low battery" if flight.px4 else "Battery 1 is low")
    flight.fault("battery", percent=5.0)
    flight.listen(2.0)
    assert flight.said("Critical battery" if flight.px4 else "Battery 1 is critical")


@pytest.mark.parametrize(
    ("flavor", "parameter", "action"),
    [("px4", "COM_LOW_BAT_ACT", 3.0), ("ardupilot", "BATT_FS_CRT_ACT", 2.0)],
)
def test_critical_battery_comes_home_when_the_parameter_says_so(
    flavor: str, parameter: str, action: float
) -> None:
    flight = Flight(flavor)
    flight.autopilot.firmware.parameters.set(parameter, action)
    flight.fault("battery", percent=6.0)
    flight.listen(2.0)
    assert flight.mode == RETURN[flavor]


@pytest.mark.parametrize("action", ["return", "land", "warn"])
def test_critical_battery_is_answered_as_it_was_told(flight: Flight, action: str) -> None:
    before = flight.mode
    flight.fault("battery_critical", action=action)
    flight.listen(2.0)
    assert flight.said("Critical battery" if flight.px4 else "Battery 1 is critical")
    assert flight.status.battery_remaining == 6
    modes = {"return": RETURN[flight.flavor], "land": LAND[flight.flavor], "warn": before}
    assert flight.mode == modes[action]


def test_empty_battery_stops_the_motors(flight: Flight) -> None:
    flight.fault("battery", percent=0.0)
    flight.listen(6.0)
    assert not flight.armed
    assert flight.autopilot.vehicle.body.on_ground
    assert flight.autopilot.vehicle.crashed


def test_pilot_who_flies_out_of_the_fence_is_brought_home(flight: Flight) -> None:
    item = mav.MAVLink_mission_item_int_message
    x, y = flight.point(0, 0)
    corners = ((-2000, -2000), (-2000, 2000), (2000, 2000), (2000, -2000))
    items = [item(1, 1, k, 0, 5001, 0, 1, 4, 0, 0, 0, x + a, y + b, 0, 1) for k, (a, b) in enumerate(corners)]
    flight.autopilot.firmware.fence.load(items)
    flight.autopilot.firmware.parameters.set(
        "GF_ACTION" if flight.px4 else "FENCE_ACTION", 3 if flight.px4 else 1
    )
    flight.long(mav.MAV_CMD_DO_FENCE_ENABLE, 1)
    flight.fault("pilot", pitch=0.25)  # gently: PX4 takes a hard push for a pilot who wants it back
    assert flight.wait(lambda: flight.mode == RETURN[flight.flavor], 60.0)
    flight.listen(0.5)
    assert any("fence" in text.lower() for text in flight.texts)


def test_pilot_takes_the_mode_and_the_sticks(flight: Flight) -> None:
    before = flight.here
    flight.fault("pilot", pitch=1.0, seconds=15.0)
    flight.listen(4.0)
    assert flight.mode == PILOT[flight.flavor]
    assert math.hypot(flight.here.north - before.north, flight.here.east - before.east) > 5.0
    leg = flight.go(0, 0, flags=0, wait=0)
    flight.listen(3.0)
    assert leg.acks in (["UNSUPPORTED"], ["DENIED"])
    assert flight.mode == PILOT[flight.flavor]


def test_pushed_sticks_take_px4_out_of_its_automatic_mode_and_not_arducopter(flight: Flight) -> None:
    flight.fault("pilot", mode="keep", pitch=1.0, seconds=15.0)
    flight.listen(3.0)
    assert flight.mode == ("POSCTL" if flight.px4 else "GUIDED")


def test_failsafe_comes_home_and_says_so(flight: Flight) -> None:
    flight.fault("failsafe", text="Failsafe activated")
    flight.listen(2.0)
    assert flight.mode == RETURN[flight.flavor]
    assert flight.latest["HEARTBEAT"].system_status == mav.MAV_STATE_CRITICAL
    assert flight.said("Failsafe activated")


def test_fence_breach_comes_home_and_says_so(flight: Flight) -> None:
    flight.fault("fence_breach")
    flight.listen(2.0)
    assert flight.mode == RETURN[flight.flavor]
    assert any("fence" in text.lower() for text in flight.texts)


def test_reboot_in_flight_starts_the_clock_again_and_falls(flight: Flight) -> None:
    flight.fault("reboot")
    assert flight.heard(1.9) == []
    flight.wait(lambda: False, 2.0)
    assert not flight.armed
    assert flight.mode == flight.autopilot.firmware.flavor.boot_mode
    assert flight.autopilot.vehicle.time < 10.0
    assert flight.autopilot.vehicle.body.up < 10.0
    if flight.px4:
        assert flight.latest["GLOBAL_POSITION_INT"].time_boot_ms < 10_000


def test_second_autopilot_shares_the_link(flight: Flight) -> None:
    flight.fault("second_autopilot", sysid=42, seconds=10.0)
    heard = flight.heard(3.0)
    others = {message.get_type() for message in heard if message.get_srcSystem() == 42}
    assert others == {"HEARTBEAT", "GLOBAL_POSITION_INT"}


@pytest.mark.parametrize(
    ("kind", "kind_of_vehicle", "component"),
    [("gcs_heartbeat", mav.MAV_TYPE_GCS, 190), ("camera_heartbeat", mav.MAV_TYPE_CAMERA, 100)],
)
def test_others_heartbeats_share_the_link(
    flight: Flight, kind: str, kind_of_vehicle: int, component: int
) -> None:
    flight.fault(kind)
    beats = [m for m in flight.heard(3.0) if m.get_type() == "HEARTBEAT" and m.type == kind_of_vehicle]
    assert {beat.get_srcComponent() for beat in beats} == {component}


def test_every_other_voice_can_be_asked_for(flight: Flight) -> None:
    flight.fault("gcs_heartbeat", sysid=250)
    flight.fault("camera_heartbeat", component=101)
    voices = {(m.get_srcSystem(), m.get_srcComponent()) for m in flight.heard(3.0)}
    assert {(250, 190), (1, 101)} <= voices


def test_strong_wind_carries_it_away_and_a_breeze_does_not(flight: Flight) -> None:
    start = flight.autopilot.vehicle.body.east
    flight.fault("wind", east=6.0)
    flight.listen(15.0)
    assert abs(flight.autopilot.vehicle.body.east - start) < 3.0
    flight.fault("wind", east=22.0)
    flight.listen(15.0)
    assert flight.autopilot.vehicle.body.east - start > 20.0


def test_frozen_autopilot_only_beats(flight: Flight) -> None:
    flight.fault("frozen", seconds=6.0)
    flight.send(mav.MAVLink_command_long_message(1, 1, mav.MAV_CMD_NAV_RETURN_TO_LAUNCH, 0, *(0.0,) * 7))
    assert {message.get_type() for message in flight.heard(5.0)} == {"HEARTBEAT"}
    flight.listen(2.0)
    assert flight.mode == GUIDED[flight.flavor]
    assert flight.go(20, 0).remaining < 2.0


def test_file_of_faults_comes_at_its_times(tmp_path: Path) -> None:
    path = tmp_path / "faults.toml"
    path.write_text(
        """
        [[fault]]
        kind = "battery"
        at = 5.0
        percent = 40.0

        [[fault]]
        kind = "wind"
        after_takeoff = 3.0
        seconds = 4.0
        east = 3.0
        """,
        encoding="utf-8",
    )
    wire = Lockstep(Settings(flavor="px4"))
    for fault in read_faults(path):
        wire.autopilot.faults.add(fault)
    dialogue = Dialogue(wire, "px4")
    dialogue.listen(4.8)
    assert wire.autopilot.vehicle.battery.percent == 100
    dialogue.listen(0.4)
    assert wire.autopilot.vehicle.battery.percent == 40
    dialogue.on_ground()
    assert wire.autopilot.faults.active == []
    dialogue.take_off()
    dialogue.wait(lambda: wire.autopilot.vehicle.flying, 10)
    dialogue.listen(3.3)
    assert wire.autopilot.faults.active == ["wind"]
    dialogue.listen(4.0)
    assert wire.autopilot.faults.active == []


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('[[fault]]\nkind = "gremlins"', "no fault of kind 'gremlins'"),
        ('[[fault]]\nkind = "battery"\nvolts = 3.0', "has no 'volts'"),
        ('[[fault]]\nkind = "battery"\npercent = "low"', "'percent'"),
        ('[[fault]]\nkind = "battery_critical"\naction = "pray"', "is one of return, land, warn"),
        ("[[fault]", "faults.toml"),
    ],
)
def test_file_of_faults_that_is_wrong_is_named_in_one_sentence(text: str, words: str, tmp_path: Path) -> None:
    path = tmp_path / "faults.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ValueError, match=words):
        read_faults(path)


def test_a_link_that_is_opened_in_trouble_is_in_trouble_from_its_first_byte(flight: Flight) -> None:
    flight.fault("one_way", carries="down")
    flight.autopilot.advance(10)
    late = flight.autopilot.add_link()
    order = mav.MAVLink_command_long_message(1, 1, mav.MAV_CMD_NAV_RETURN_TO_LAUNCH, 0, *(0.0,) * 7)
    flight.autopilot.receive(late, order.pack(codec()))
    flight.autopilot.advance(1)
    assert flight.autopilot.firmware.mode == GUIDED[flight.flavor]
