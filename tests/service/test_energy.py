"""When the aircraft must fly home: by what was measured, around what is in the way, against the wind that blows."""

from __future__ import annotations

import math

import pytest

from service.config import FlightSettings
from service.mavlink.telemetry import Wind
from service.mission.energy import Consumption, Energy, WayHome, WindFelt, speed_over_ground

FLIGHT = FlightSettings(return_height_m=30.0, descent_mps=1.0, climb_mps=2.0)
STRAIGHT = [(0.0, 0.0), (-800.0, 0.0)]  # 800 m to the west


def burned(rate: float, seconds: float, start: float = 100.0) -> Consumption:
    """A battery that fell evenly, told in whole percents ten times a second."""
    consumption = Consumption()
    for tick in range(int(seconds * 10)):
        consumption.update(float(round(start - rate * tick / 10)), tick / 10)
    return consumption


def test_consumption_is_measured_from_whole_percents() -> None:
    assert burned(0.1, 25.0).percent_per_s is None  # too few to say
    assert burned(0.1, 300.0).percent_per_s == pytest.approx(0.1, rel=0.01)


def test_the_dearer_of_the_whole_flight_and_of_late_counts() -> None:
    consumption = burned(0.05, 400.0)
    for tick in range(600):
        consumption.update(float(round(80.0 - 0.2 * tick / 10)), 400.0 + tick / 10)
    assert consumption.percent_per_s == pytest.approx(0.2, rel=0.05)
    for tick in range(3000):
        consumption.update(float(round(68.0 - 0.01 * tick / 10)), 460.0 + tick / 10)
    assert consumption.percent_per_s is not None
    assert consumption.percent_per_s > 0.03  # of late it was cheap, over the flight it was not


def test_a_correction_of_the_percent_is_not_taken_for_consumption() -> None:
    consumption = burned(0.1, 200.0)
    for tick in range(300):
        consumption.update(float(round(50.0 - 0.1 * tick / 10)), 200.0 + tick / 10)
    assert consumption.percent_per_s == pytest.approx(0.1, rel=0.1)


@pytest.mark.parametrize(
    ("wind", "speed"),
    [
        (None, 8.0),
        (Wind(0.0, -10.0), 8.0),  # from behind: no faster than it is told to fly
        (Wind(0.0, 4.0), 8.0),  # against it, and it leans into that
        (Wind(0.0, 10.0), 5.0),
        (Wind(12.0, 0.0), 8.0),  # from the side: 9 of 15 m/s are left
        (Wind(14.0, 0.0), math.sqrt(15.0**2 - 14.0**2)),
        (Wind(0.0, 20.0), -5.0),
    ],
)
def test_speed_over_ground_is_what_the_wind_leaves(wind: Wind | None, speed: float) -> None:
    assert speed_over_ground((-100.0, 0.0), wind, FLIGHT) == pytest.approx(speed)


def test_the_way_home_has_its_bends_its_climb_and_its_descent() -> None:
    straight = WayHome.along(STRAIGHT, 30.0, None, FLIGHT)
    assert (straight.length_m, straight.seconds) == (800.0, pytest.approx(800 / 8 + 30))
    bent = WayHome.along([(0.0, 0.0), (0.0, 300.0), (-800.0, 0.0)], 30.0, None, FLIGHT)
    assert bent.length_m == pytest.approx(300 + math.hypot(800, 300))
    low, high = (WayHome.along(STRAIGHT, height, None, FLIGHT).seconds for height in (10.0, 90.0))
    assert (low, high) == (pytest.approx(100 + 10 + 30), pytest.approx(100 + 90))
    against = WayHome.along(STRAIGHT, 30.0, Wind(0.0, 10.0), FLIGHT)
    assert (against.seconds, against.against_mps) == (pytest.approx(800 / 5 + 30), pytest.approx(10.0))
    assert math.isinf(WayHome.along(STRAIGHT, 30.0, Wind(0.0, 20.0), FLIGHT).seconds)


def test_it_flies_home_when_the_way_needs_what_is_left_but_the_reserve() -> None:
    home = WayHome.along(STRAIGHT, 30.0, Wind(0.0, 10.0), FLIGHT)  # 190 s
    enough, low = Energy(44.0, 0.15, home), Energy(43.0, 0.15, home)
    assert enough.objection(100.0, FLIGHT) == ""
    assert low.objection(100.0, FLIGHT) == (
        "battery 43 %: the way home, 800 m against 10 m/s of wind, needs 28 % and 15 % are kept"
    )
    calm = Energy(43.0, 0.15, WayHome.along(STRAIGHT, 30.0, None, FLIGHT))
    assert calm.objection(100.0, FLIGHT) == ""
    assert "cannot be flown in this wind" in Energy(
        90.0, 0.15, WayHome.along(STRAIGHT, 30.0, Wind(0.0, 20.0), FLIGHT)
    ).objection(100.0, FLIGHT)


def test_the_fixed_minimum_and_the_time_stay_as_limits() -> None:
    near = WayHome(0.0, 30.0, 0.0)
    assert Energy(21.0, None, near).objection(100.0, FLIGHT) == ""
    assert Energy(20.0, None, near).objection(100.0, FLIGHT) == "battery at 20 %"
    assert Energy(None, None, near).objection(7200.0, FLIGHT) == "7200 s in the air"


def test_the_time_left_ends_when_the_way_home_must_begin() -> None:
    home = WayHome.along(STRAIGHT, 30.0, None, FLIGHT)  # 130 s, 19.5 % at 0.15 %/s
    assert Energy(64.5, 0.15, home).seconds_left(FLIGHT) == pytest.approx(200.0)
    assert Energy(30.0, 0.15, home).seconds_left(FLIGHT) == 0.0
    assert Energy(64.5, None, home).seconds_left(FLIGHT) is None
    assert Energy(None, 0.15, home).seconds_left(FLIGHT) is None


def test_a_wind_that_is_not_told_is_felt_as_missing_speed() -> None:
    felt = WindFelt(FLIGHT)
    winds = [felt.update(None, (-5.0, 0.0), True, 0.1 * tick) for tick in range(60)]
    assert winds[0] is None
    wind = winds[-1]
    assert wind is not None
    assert (wind.east_mps, wind.north_mps) == (pytest.approx(10.0), pytest.approx(0.0))
    assert speed_over_ground((-1.0, 0.0), wind, FLIGHT) == pytest.approx(5.0)
    assert felt.update(Wind(1.0, 0.0), (-5.0, 0.0), True, 7.0) == Wind(1.0, 0.0)  # what is told goes first
    assert felt.update(None, (0.0, 0.0), False, 400.0) is None  # long ago


def test_an_aircraft_that_brakes_or_flies_as_told_feels_no_wind() -> None:
    braking, steady, hovering = WindFelt(FLIGHT), WindFelt(FLIGHT), WindFelt(FLIGHT)
    for tick in range(100):
        now = 0.1 * tick
        assert braking.update(None, (-8.0 + 0.15 * (tick % 50), 0.0), True, now) is None
        assert steady.update(None, (-7.8, 0.0), True, now) is None
        assert hovering.update(None, (-2.0, 0.0), False, now) is None
