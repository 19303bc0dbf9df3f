"""The pose at a time of the past."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from service.mavlink.history import PoseHistory
from service.mavlink.telemetry import Telemetry

BASE = Telemetry(
    lat=47.0, lon=8.0, alt_amsl_m=500.0, alt_home_m=11.0, yaw_deg=350.0, roll_deg=0.0, pitch_deg=0.0
)


def history(*samples: Telemetry, length_s: float = 60.0) -> PoseHistory:
    past = PoseHistory(length_s)
    for sample in samples:
        past.record(sample)
    return past


def test_between_two_samples_it_is_interpolated_and_angles_turn_the_short_way() -> None:
    a = replace(BASE, position_time=100.0)
    b = replace(BASE, position_time=101.0, lat=47.001, alt_amsl_m=504.0, yaw_deg=20.0)
    pose = history(a, b).pose_at(100.25)
    assert pose is not None
    assert pose.lat == pytest.approx(47.00025)
    assert pose.alt_amsl_m == pytest.approx(501.0)
    assert pose.heading_deg == pytest.approx(357.5)


def test_longitude_goes_the_short_way_across_the_date_line() -> None:
    a = replace(BASE, position_time=100.0, lon=179.9999)
    b = replace(BASE, position_time=101.0, lon=-179.9999)
    pose = history(a, b).pose_at(100.75)
    assert pose is not None
    assert pose.lon == pytest.approx(-179.99995)


def test_shortly_after_the_newest_it_is_carried_on_with_its_speed() -> None:
    past = history(replace(BASE, position_time=100.0, velocity_ned_mps=(10.0, 0.0, 0.0)))
    pose = past.pose_at(100.4)
    assert pose is not None
    assert (pose.lat - 47.0) * 111_194.93 == pytest.approx(4.0, abs=0.01)
    assert past.pose_at(101.0) is None


def test_what_is_not_known_is_none() -> None:
    past = history(replace(BASE, position_time=100.0), replace(BASE, position_time=105.0))
    assert past.pose_at(99.9) is None, "before the past begins"
    assert past.pose_at(102.0) is None, "in a gap"
    assert past.pose_at(float("nan")) is None
    assert PoseHistory(10.0).pose_at(100.0) is None
    assert past.pose_at(105.0) is not None


def test_of_what_waited_in_a_buffer_the_last_is_where_the_aircraft_was() -> None:
    old = replace(BASE, position_time=100.0, boot_time_s=50.0)
    waited = [
        replace(BASE, position_time=140.0, boot_time_s=60.0 + 15.0 * number, lat=47.0 + 0.0001 * number)
        for number in range(3)
    ]
    past = history(old, *waited)
    pose = past.pose_at(140.0)
    assert pose is not None
    assert pose.lat == pytest.approx(47.0002)
    assert len(past) == 2
    assert past.time_of_boot(90.0) == pytest.approx(140.0)


def test_the_past_is_bounded() -> None:
    past = history(*(replace(BASE, position_time=100.0 + 0.1 * i) for i in range(5000)), length_s=60.0)
    assert len(past) <= 760
    assert past.pose_at(100.0 + 499.9 - 59.0) is not None


@given(st.floats(0.0, 10.0), st.floats(-0.01, 0.01), st.floats(0.0, 360.0))
def test_a_pose_lies_between_its_neighbours(time: float, step: float, yaw: float) -> None:
    samples = [
        replace(BASE, position_time=float(i), lat=47.0 + step * i, yaw_deg=(yaw + 10 * i) % 360.0)
        for i in range(11)
    ]
    pose = history(*samples).pose_at(time)
    assert pose is not None
    assert pose.lat == pytest.approx(47.0 + step * time, abs=1e-9)
    assert 0.0 <= pose.heading_deg <= 360.0
    assert abs((pose.heading_deg - yaw - 10 * time + 180.0) % 360.0 - 180.0) < 1e-6


def test_time_since_boot_is_found_between_the_samples_it_was_received_with() -> None:
    past = history(
        replace(BASE, position_time=100.0, boot_time_s=7.0),
        replace(BASE, position_time=101.0, boot_time_s=8.0),
    )
    assert past.time_of_boot(7.25) == pytest.approx(100.25)
    assert past.time_of_boot(8.4) == pytest.approx(101.4)
    assert past.time_of_boot(7.0) == 100.0
    for unknown in (6.9, 8.6, float("nan"), float("inf")):
        assert past.time_of_boot(unknown) is None
    assert history(replace(BASE, position_time=100.0)).time_of_boot(7.0) is None


def test_the_time_since_boot_means_nothing_any_longer_after_a_reboot_and_the_places_do() -> None:
    past = history(*(replace(BASE, position_time=100.0 + i, boot_time_s=1000.0 + i) for i in range(3)))
    assert past.time_of_boot(1001.5) == pytest.approx(101.5)
    past.forget_boot()
    assert past.time_of_boot(1001.5) is None
    assert past.pose_at(101.0) is not None
    for i in range(2):
        past.record(replace(BASE, position_time=103.0 + i, boot_time_s=5.0 + i))
    assert past.time_of_boot(1001.5) is None
    assert past.time_of_boot(5.5) == pytest.approx(103.5)
