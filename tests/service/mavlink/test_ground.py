"""What the vehicle tells of the ground: how far it is below, and how high it flies home by itself."""

from __future__ import annotations

import math
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.mavlink.parameters import MOTION, RETURN_HEIGHT, Parameters
from sim.autopilot.parameter_tables import ARDUCOPTER_PARAMETERS, PX4_PARAMETERS

from .peer import START, Rig

DOWN, AHEAD = mavlink.MAV_SENSOR_ROTATION_PITCH_270, mavlink.MAV_SENSOR_ROTATION_NONE


def distance(rig: Rig, cm: int, *, orientation: int = DOWN, quality: int = 0) -> bytes:
    stamp = round((rig.now - START) * 1000.0) + 1000
    return rig.peer.pack(
        mavlink.MAVLink_distance_sensor_message(
            stamp, 20, 12_000, cm, 0, 0, orientation, 255, signal_quality=quality
        )
    )


def flying(**settings: Any) -> Rig:
    rig = Rig(**settings)
    rig.say(rig.peer.heartbeat())
    rig.run(2.0)
    return rig


def test_only_a_sensor_that_looks_down_and_sees_the_ground_measures_it() -> None:
    rig = flying()
    assert rig.core.telemetry.ground_distance_m is None
    rig.say(distance(rig, 1730))
    assert rig.core.telemetry.ground_distance_m == pytest.approx(17.3)
    rig.run(0.3)
    rig.say(distance(rig, 300, orientation=AHEAD))
    assert rig.core.telemetry.ground_distance_m == pytest.approx(17.3)
    for nothing in ({"cm": 12_001}, {"cm": 10}, {"cm": 900, "quality": 1}, {"cm": 65_535}):
        rig.run(0.3)
        rig.say(distance(rig, **nothing))
        assert rig.core.telemetry.ground_distance_m is None


def test_the_autopilots_own_heights_of_the_ground_are_read_where_it_has_them() -> None:
    rig = flying(flavor="ardupilot")
    for spacing, known in ((100, pytest.approx(23.5)), (0, None)):
        rig.say(rig.peer.pack(mavlink.MAVLink_terrain_report_message(0, 0, spacing, 480.0, 23.5, 0, 504)))
        assert rig.core.telemetry.terrain_distance_m == known
        rig.run(0.3)


def test_a_distance_that_is_not_told_any_longer_is_not_known() -> None:
    rig = flying()
    rig.say(distance(rig, 1730))
    rig.run(6.0)
    assert rig.core.telemetry.ground_distance_m is None


@pytest.mark.parametrize(
    ("flavor", "name", "value", "metres"),
    [
        ("px4", "RTL_RETURN_ALT", 60.0, 60.0),
        ("ardupilot", "RTL_ALT", 1500.0, 15.0),
        ("ardupilot", "RTL_ALT_M", 15.0, 15.0),
    ],
)
def test_the_height_of_the_autopilots_own_return_is_asked_for_until_it_is_told(
    flavor: str, name: str, value: float, metres: float
) -> None:
    rig = flying(flavor=flavor, read_return_height=True)
    rig.run(3.0)
    names = {m.param_id.rstrip("\0") for m in rig.messages("PARAM_REQUEST_READ")}
    assert name in names
    rig.say(rig.peer.pack(mavlink.MAVLink_param_value_message(b"COM_OTHER", 3.0, 9, 1, 0)))
    assert rig.core.telemetry.return_height_m is None
    rig.say(rig.peer.pack(mavlink.MAVLink_param_value_message(name.encode(), value, 9, 1, 0)))
    assert rig.core.telemetry.return_height_m == pytest.approx(metres)
    rig.collect()
    before = len(rig.sent)
    rig.run(10.0)
    assert not [m for m in rig.sent[before:] if m.get_type() == "PARAM_REQUEST_READ"]


def test_what_is_not_answered_is_asked_for_seldom_and_for_ever_and_what_changes_is_heard() -> None:
    """The first seconds on a bad radio decided it for the whole flight, and so did what stood there at first."""
    parameters = Parameters("ardupilot", [RETURN_HEIGHT])
    asked = [now for now in range(0, 200) if parameters.due(float(now))]
    assert asked == [0, 2, 4, 6, 8, 68, 128, 188]
    assert parameters.read("RTL_ALT", 1500.0) == ("return_height_m", 15.0)
    assert parameters.due(1000.0) == []
    assert parameters.read("RTL_ALT", 6000.0) == ("return_height_m", 60.0)
    px4 = Parameters("px4", MOTION)
    for name, value, lowest in (
        ("MPC_Z_VEL_MAX_UP", 3.0, 3.0),
        ("MPC_Z_V_AUTO_UP", 2.0, 2.0),
        ("MPC_Z_V_AUTO_UP", 4.0, 3.0),
    ):
        assert px4.read(name, value) == ("most_climb_mps", lowest)


def test_nothing_is_asked_for_that_nobody_uses_and_what_is_no_height_is_not_taken() -> None:
    rig = flying()
    rig.run(5.0)
    assert not rig.messages("PARAM_REQUEST_READ")
    for value in (math.nan, -5.0, math.inf, 1e9):
        assert Parameters("px4", [RETURN_HEIGHT]).read("RTL_RETURN_ALT", value) is None


@pytest.mark.parametrize(
    ("flavor", "name", "value", "field", "told"),
    [
        ("px4", "MPC_XY_VEL_MAX", 6.0, "most_speed_mps", 6.0),
        ("px4", "MPC_ACC_HOR", 3.0, "most_acceleration_mps2", 3.0),
        ("ardupilot", "WPNAV_ACCEL", 250.0, "most_acceleration_mps2", 2.5),
        ("ardupilot", "WP_ACC", 2.5, "most_acceleration_mps2", 2.5),
        ("px4", "MPC_Z_VEL_MAX_UP", 3.0, "most_climb_mps", 3.0),
        ("px4", "MPC_Z_VEL_MAX_DN", 1.5, "most_descent_mps", 1.5),
        ("px4", "MPC_Z_V_AUTO_UP", 3.0, "most_climb_mps", 3.0),
        ("px4", "MPC_Z_V_AUTO_DN", 1.5, "most_descent_mps", 1.5),
        ("ardupilot", "WPNAV_SPEED_UP", 250.0, "most_climb_mps", 2.5),
        ("ardupilot", "WP_SPD_DN", 1.5, "most_descent_mps", 1.5),
    ],
)
def test_how_the_aircraft_may_move_is_asked_for_until_it_can_be_so(
    flavor: str, name: str, value: float, field: str, told: float
) -> None:
    rig = flying(flavor=flavor, read_motion=True)
    rig.run(3.0)
    assert name in {m.param_id.rstrip("\0") for m in rig.messages("PARAM_REQUEST_READ")}
    for wrong in (-1.0, 0.0, math.nan, 1e6):
        rig.say(rig.peer.pack(mavlink.MAVLink_param_value_message(name.encode(), wrong, 9, 1, 0)))
    assert getattr(rig.core.telemetry, field) is None
    rig.forget()
    rig.run(3.0)
    assert name in {m.param_id.rstrip("\0") for m in rig.messages("PARAM_REQUEST_READ")}
    rig.say(rig.peer.pack(mavlink.MAVLink_param_value_message(name.encode(), value, 9, 1, 0)))
    assert getattr(rig.core.telemetry, field) == pytest.approx(told)
    rig.forget()
    rig.run(10.0)
    assert name not in {m.param_id.rstrip("\0") for m in rig.messages("PARAM_REQUEST_READ")}


@pytest.mark.parametrize(
    "told",
    [
        [("MPC_Z_VEL_MAX_UP", 3.0), ("MPC_Z_V_AUTO_UP", 1.2)],
        [("MPC_Z_V_AUTO_UP", 1.2), ("MPC_Z_VEL_MAX_UP", 3.0)],
        [("MPC_Z_V_AUTO_UP", 5.0), ("MPC_Z_VEL_MAX_UP", 1.2)],
    ],
)
def test_of_two_limits_of_the_climb_the_lower_counts(told: list[tuple[str, float]]) -> None:
    rig = flying(flavor="px4", read_motion=True)
    rig.run(3.0)
    for name, value in told:
        rig.say(rig.peer.pack(mavlink.MAVLink_param_value_message(name.encode(), value, 9, 1, 0)))
    assert rig.core.telemetry.most_climb_mps == pytest.approx(1.2)


@pytest.mark.parametrize("flavor", ["px4", "ardupilot"])
def test_what_is_asked_for_the_mock_has(flavor: str) -> None:
    table = {"px4": PX4_PARAMETERS, "ardupilot": ARDUCOPTER_PARAMETERS}[flavor]
    has = {each.name for each in table}
    for wanted in (RETURN_HEIGHT, *MOTION):
        names = wanted.names.get(flavor)
        assert names is None or has & names.keys()
