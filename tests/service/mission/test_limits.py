"""What speaks against sending the aircraft anywhere."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest

from service.config import FlightSettings
from service.mavlink.telemetry import Telemetry, Wind
from service.mission.limits import (
    Lasting,
    PositionTrust,
    Progress,
    position_objections,
    wind_objection,
)

FLIGHT = FlightSettings()
FRESH_S = 2.0
GOOD = Telemetry(
    heartbeat_time=100.0,
    position_time=100.0,
    boot_time_s=50.0,
    lat=47.0,
    lon=8.0,
    velocity_ned_mps=(8.0, 0.0, 0.0),
    fix=3,
    satellites=10,
    estimator_ok=True,
)
NORTH_8_M = 8.0 / 111_194.93


def moved(t: Telemetry, seconds: float, north_m: float) -> Telemetry:
    """The same aircraft later, so far north of where it was."""
    assert t.boot_time_s is not None
    return replace(
        t,
        heartbeat_time=t.heartbeat_time + seconds,
        position_time=t.position_time + seconds,
        boot_time_s=t.boot_time_s + seconds,
        lat=t.lat + north_m / 111_194.93,
    )


def test_nothing_speaks_against_a_good_position() -> None:
    assert position_objections(GOOD, FLIGHT, FRESH_S) == []
    uncounted = replace(GOOD, satellites=None, horizontal_accuracy_m=0.9, estimator_ok=None, round_trip_s=1.5)
    assert position_objections(uncounted, FLIGHT, FRESH_S) == []


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"fix": 2}, "no 3D fix"),
        ({"satellites": 5}, "5 satellites, fewer than 6"),
        ({"estimator_ok": False}, "estimate is not healthy"),
        ({"satellites": None}, "neither its satellites nor how accurate"),
        ({"fix": 0, "old": frozenset({"GPS_RAW_INT"})}, "the GPS is not heard any longer"),
        ({"estimator_ok": None, "old": frozenset({"EKF_STATUS_REPORT"})}, "not told any longer"),
        ({"estimator_ok": None, "old": frozenset({"SYS_STATUS"})}, "not told any longer"),
        ({"sensors_failed": ("compass",)}, "not healthy: compass"),
        ({"position_time": 97.0}, "no new position for 3 s"),
        ({"position_time": Telemetry().position_time}, "no position"),
        ({"round_trip_s": 4.2}, "the link takes 4 s there and back"),
        ({"round_trip_s": math.inf}, "has yet to show how slow it is"),
    ],
)
def test_each_fault_of_the_position_is_named(change: dict[str, Any], words: str) -> None:
    (objection,) = position_objections(replace(GOOD, **change), FLIGHT, FRESH_S)
    assert words in objection


def test_an_aircraft_without_gps_is_not_asked_for_one() -> None:
    indoors = replace(GOOD, fix=0, satellites=0)
    assert position_objections(indoors, FlightSettings(min_satellites=0), FRESH_S) == []


def test_a_lost_link_is_not_taken_for_a_lost_position() -> None:
    trust = PositionTrust(FLIGHT, FRESH_S)
    assert trust.update(GOOD, 100.0) == []
    assert trust.update(GOOD, 130.0) == []


def test_a_jump_is_told_from_a_flight_and_is_trusted_again_after_a_while() -> None:
    trust = PositionTrust(FLIGHT, FRESH_S)
    now, t = 100.0, GOOD
    trust.update(t, now)
    for _ in range(20):  # straight on at 8 m/s
        now, t = now + 0.5, moved(t, 0.5, 4.0)
        assert trust.update(t, now) == []
    jumped, t = now + 0.5, moved(t, 0.5, 34.0)
    assert trust.update(t, jumped) == ["the position jumped by 30 m"]
    for tick in range(1, 20):
        t = moved(t, 0.5, 4.0)
        settled = 0.5 * (tick - 1) >= FLIGHT.settle_s
        assert (trust.update(t, jumped + 0.5 * tick) == []) == settled
    assert trust.trusted_at(jumped - 5.0)
    assert not trust.trusted_at(jumped - 0.2)  # it may have been bad for as long as nothing was told
    assert not trust.trusted_at(jumped + 1.0)
    assert trust.trusted_at(jumped + 9.0)


def test_a_gap_in_the_radio_is_no_jump_when_another_message_ends_it() -> None:
    """The attitude tells the time since boot before the first new position comes."""
    trust = PositionTrust(FLIGHT, FRESH_S)
    trust.update(GOOD, 100.0)
    attitude = replace(GOOD, boot_time_s=51.5, heartbeat_time=101.5)
    assert trust.update(attitude, 101.5) == []
    assert trust.update(moved(GOOD, 1.55, 12.4), 101.55) == []
    assert trust.update(moved(GOOD, 2.0, 80.0), 102.0) == ["the position jumped by 64 m"]


def test_a_reboot_is_no_jump() -> None:
    trust = PositionTrust(FLIGHT, FRESH_S)
    trust.update(GOOD, 100.0)
    assert trust.update(replace(moved(GOOD, 1.0, 500.0), boot_time_s=1.0), 101.0) == []


def test_the_position_is_trusted_at_once_the_first_time_and_later_only_once_it_has_stayed_good() -> None:
    trust = PositionTrust(FLIGHT, FRESH_S)
    assert trust.update(replace(GOOD, fix=0), 90.0)
    assert trust.update(GOOD, 100.0) == []
    assert trust.update(replace(GOOD, fix=0), 101.0)
    assert trust.update(GOOD, 102.0)
    assert trust.update(replace(GOOD, fix=0), 104.0)  # again: it has to settle anew
    assert trust.update(GOOD, 105.0)
    assert trust.update(GOOD, 107.0)
    assert trust.update(GOOD, 108.0) == []


def test_progress_is_asked_for_until_the_waypoint_is_near() -> None:
    progress = Progress(15.0, 5.0)
    assert [progress.stuck(100.0 - 8.0 * second, float(second)) for second in range(12)] == [""] * 12
    assert progress.stuck(4.0, 100.0) == ""  # it has arrived, and waits there
    progress.clear()
    assert progress.stuck(50.0, 200.0) == ""
    assert progress.stuck(60.0, 214.0) == ""
    assert "no progress" in progress.stuck(70.0, 216.0)
    progress.clear()
    assert progress.stuck(70.0, 217.0) == ""


def test_wind_counts_when_it_is_told_is_too_much_and_lasts() -> None:
    calm, storm = Wind(3.0, 4.0), Wind(-10.0, 10.0)
    assert wind_objection(None, FLIGHT) == wind_objection(calm, FLIGHT) == ""
    assert "wind of 14 m/s" in wind_objection(storm, FLIGHT)
    lasting = Lasting(5.0)
    assert lasting.after("storm", 0.0) == lasting.after("storm", 4.9) == ""
    assert lasting.after("", 5.0) == lasting.after("storm", 6.0) == ""
    assert lasting.after("storm", 11.0) == "storm"
