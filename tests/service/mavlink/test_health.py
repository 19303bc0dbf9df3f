"""Several of a thing, and the same health on both autopilots."""

from __future__ import annotations

from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from .peer import FLAVORS, Rig

GOOD = mavlink.ESTIMATOR_ATTITUDE | mavlink.ESTIMATOR_VELOCITY_HORIZ | mavlink.ESTIMATOR_POS_HORIZ_ABS
GLITCH = {"px4": mavlink.ESTIMATOR_GPS_GLITCH, "ardupilot": mavlink.EKF_GPS_GLITCHING}


def paired(flavor: str = "px4") -> Rig:
    """A vehicle that only says what a test lets it say."""
    rig = Rig(flavor)
    rig.say(rig.peer.heartbeat())
    return rig


def passes(rig: Rig, seconds: float) -> None:
    """Time passes, with heartbeats and nothing else."""
    for _ in range(round(seconds)):
        rig.now += 1.0
        rig.say(rig.peer.heartbeat())


def battery(rig: Rig, number: int, percent: int, state: int = 1, **more: Any) -> None:
    """BATTERY_STATUS of one battery."""
    cells = [more.get("voltage", 15000), *[65535] * 9]
    rig.say(
        rig.peer.pack(
            mavlink.MAVLink_battery_status_message(
                number,
                1,
                1,
                3000,
                cells,
                more.get("current", 500),
                more.get("used", 100),
                0,
                percent,
                0,
                state,
            )
        )
    )


def status(rig: Rig, percent: int, **more: int) -> None:
    """SYS_STATUS."""
    enabled, health = more.get("enabled", 0), more.get("health", 0)
    rig.say(
        rig.peer.pack(
            mavlink.MAVLink_sys_status_message(
                enabled, enabled, health, 100, 15400, 1200, percent, 0, 0, 0, 0, 0, 0
            )
        )
    )


def gps(rig: Rig, second: bool, fix: int, satellites: int) -> None:
    """One of two receivers."""
    head = (0, fix, 470000000, 80000000, 489000, 70, 110, 0, 0, satellites)
    message = (
        mavlink.MAVLink_gps2_raw_message(*head, 0, 0)
        if second
        else mavlink.MAVLink_gps_raw_int_message(*head)
    )
    rig.say(rig.peer.pack(message))


def estimator(rig: Rig, flavor: str, flags: int) -> None:
    """The estimator's flags, as either autopilot tells them."""
    message = (
        mavlink.MAVLink_estimator_status_message(0, flags, *[0.0] * 8)
        if flavor == "px4"
        else mavlink.MAVLink_ekf_status_report_message(flags, *[0.0] * 5)
    )
    rig.say(rig.peer.pack(message))


def test_the_lowest_of_all_batteries_counts_and_the_worst_state() -> None:
    rig = paired()
    status(rig, 90)
    battery(rig, 0, 88, current=500, used=100)
    battery(rig, 1, 31, 2, voltage=14000, current=700, used=400)
    t = rig.core.telemetry
    assert (t.battery_percent, t.battery_state, t.battery_voltage_v) == (31.0, "low", 14.0)
    assert (t.battery_current_a, t.battery_consumed_mah) == (pytest.approx(19.0), 500.0)


def test_a_second_battery_that_falls_silent_makes_the_level_unknown() -> None:
    rig = paired()
    battery(rig, 1, 31)
    for _ in range(12):
        passes(rig, 1)
        status(rig, 90)
        battery(rig, 0, 88)
    assert rig.core.telemetry.battery_percent is None


def test_a_second_battery_that_stops_telling_its_level_makes_it_unknown_too() -> None:
    rig = paired()
    battery(rig, 0, 88)
    battery(rig, 1, -1)
    assert rig.core.telemetry.battery_percent == 88.0, "one that never told a level has none to tell"
    battery(rig, 1, 31)
    battery(rig, 1, -1)
    assert rig.core.telemetry.battery_percent is None


@pytest.mark.parametrize("lost", ["SYS_STATUS", "BATTERY_STATUS"])
def test_either_message_is_enough_for_the_first_battery(lost: str) -> None:
    rig = paired()
    status(rig, 76)
    battery(rig, 0, 76)
    for _ in range(12):
        passes(rig, 1)
        battery(rig, 0, 60) if lost == "SYS_STATUS" else status(rig, 60)
    assert rig.core.telemetry.battery_percent == 60.0


def test_a_battery_that_nobody_tells_of_any_longer_is_unknown() -> None:
    rig = paired()
    status(rig, 76)
    battery(rig, 0, 76)
    passes(rig, 12)
    t = rig.core.telemetry
    assert (t.battery_percent, t.battery_voltage_v, t.battery_state) == (None, None, "")


def test_the_better_of_two_receivers_counts() -> None:
    rig = paired()
    gps(rig, False, 1, 0)
    gps(rig, True, 4, 14)
    assert (rig.core.telemetry.fix, rig.core.telemetry.satellites) == (4, 14)
    for _ in range(6):
        passes(rig, 1)
        gps(rig, False, 1, 0)
    assert rig.core.telemetry.fix == 1, "the other has fallen silent"


@FLAVORS
def test_a_gps_glitch_is_one_on_both_autopilots(flavor: str) -> None:
    rig = paired(flavor)
    assert rig.core.telemetry.estimator_ok is None
    estimator(rig, flavor, GOOD)
    assert rig.core.telemetry.estimator_ok is True
    estimator(rig, flavor, GOOD | GLITCH[flavor])
    assert rig.core.telemetry.estimator_ok is False


@FLAVORS
def test_an_estimate_without_a_place_is_none_on_both(flavor: str) -> None:
    rig = paired(flavor)
    estimator(rig, flavor, GOOD & ~mavlink.ESTIMATOR_POS_HORIZ_ABS)
    assert rig.core.telemetry.estimator_ok is False
    passes(rig, 6)
    assert rig.core.telemetry.estimator_ok is None


@pytest.mark.parametrize("fault", [mavlink.EKF_CONST_POS_MODE, mavlink.EKF_UNINITIALIZED])
def test_ardupilot_s_estimator_that_holds_still_or_never_was_well_is_not_healthy(fault: int) -> None:
    rig = paired("ardupilot")
    estimator(rig, "ardupilot", GOOD | fault)
    assert rig.core.telemetry.estimator_ok is False


@FLAVORS
def test_a_sensor_that_is_enabled_and_not_healthy_is_named_on_both(flavor: str) -> None:
    rig = paired(flavor)
    sensors = mavlink.MAV_SYS_STATUS_SENSOR_3D_MAG | mavlink.MAV_SYS_STATUS_AHRS
    status(rig, 90, enabled=sensors, health=mavlink.MAV_SYS_STATUS_SENSOR_3D_MAG)
    assert rig.core.telemetry.sensors_failed == ("attitude and position estimate",)
    status(rig, 90, enabled=0, health=0)
    assert rig.core.telemetry.sensors_failed == ()
