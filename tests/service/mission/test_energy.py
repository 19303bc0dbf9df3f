"""When the aircraft must fly home: by what was measured, around what is in the way, against the wind that blows."""

from __future__ import annotations

import math

import pytest

from service.config import FlightSettings
from service.mavlink.telemetry import Telemetry, Wind
from service.mission.energy import (
    Consumption,
    Energy,
    Level,
    WayHome,
    speed_over_ground,
    take_off_objection,
)

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


def up_and_down(speed: float) -> float:
    """What speeding up from a stand and braking to one cost, beside the way at full speed, in seconds."""
    return speed / (2.0 * FLIGHT.acceleration_mps2) + speed / (2.0 * FLIGHT.deceleration_mps2)


def test_the_way_home_has_its_bends_its_climb_and_its_descent() -> None:
    straight = WayHome.along(STRAIGHT, 30.0, None, FLIGHT)
    assert (straight.length_m, straight.seconds) == (800.0, pytest.approx(800 / 8 + up_and_down(8.0) + 30))
    bent = WayHome.along([(0.0, 0.0), (0.0, 300.0), (-800.0, 0.0)], 30.0, None, FLIGHT)
    assert bent.length_m == pytest.approx(300 + math.hypot(800, 300))
    assert bent.seconds == pytest.approx(bent.length_m / 8 + 2 * up_and_down(8.0) + 30)  # it stops at a bend
    low, high = (WayHome.along(STRAIGHT, height, None, FLIGHT).seconds for height in (10.0, 90.0))
    assert (low, high) == (
        pytest.approx(100 + up_and_down(8.0) + 10 + 30),
        pytest.approx(100 + up_and_down(8.0) + 90),
    )
    against = WayHome.along(STRAIGHT, 30.0, Wind(0.0, 10.0), FLIGHT)
    assert against.seconds == pytest.approx(800 / 5 + up_and_down(5.0) + 30)
    assert against.against_mps == pytest.approx(10.0)
    assert math.isinf(WayHome.along(STRAIGHT, 30.0, Wind(0.0, 20.0), FLIGHT).seconds)


def test_it_flies_home_when_the_way_needs_what_is_left_but_the_reserve() -> None:
    home = WayHome.along(STRAIGHT, 30.0, Wind(0.0, 10.0), FLIGHT)  # 197 s
    enough, low = Energy(45.0, 0.15, home), Energy(44.0, 0.15, home)
    assert enough.objection(100.0, FLIGHT) == ""
    assert low.objection(100.0, FLIGHT) == (
        "battery 44 %: the way home, 800 m against 10 m/s of wind, needs 30 % and 15 % are kept"
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


def test_a_level_that_is_not_told_any_longer_is_counted_down() -> None:
    level = Level()
    assert level.update(None, 0.1, 0.0) is None
    assert level.update(76.0, 0.1, 10.0) == 76.0
    assert level.update(None, 0.1, 110.0) == pytest.approx(66.0)
    assert level.update(None, 0.1, 1010.0) == 0.0
    assert level.update(70.0, 0.1, 1020.0) == 70.0


def test_a_level_that_stands_still_while_the_battery_is_used_is_counted_down() -> None:
    level = Level()
    told = [level.update(76.0, 0.1, float(second)) for second in range(101)]
    assert set(told) == {76.0}
    assert level.doubt == ""
    assert level.update(76.0, 0.1, 110.0) == pytest.approx(65.0)
    assert level.doubt == "stands still"
    assert level.update(None, 0.1, 210.0) == pytest.approx(
        55.0
    )  # and one that falls silent then is no better
    assert level.update(76.0, 0.1, 310.0) == pytest.approx(45.0)
    assert level.update(75.0, 0.1, 320.0) == 75.0  # it lives
    assert level.doubt == ""
    assert level.update(85.0, 0.1, 330.0) == 85.0  # the autopilot corrects itself
    said = Energy(66.0, 0.1, WayHome(0.0, 30.0, 0.0), told=False, doubt="stands still")
    assert said.warning() == "the battery's level stands still: reckoned to be 66 %"


def test_a_level_that_rises_in_flight_is_not_believed() -> None:
    """A monitor that was restarted says that the battery is full again."""
    level = Level()
    assert level.update(40.0, 0.1, 0.0) == 40.0
    assert level.update(49.0, 0.1, 10.0) == 49.0, "a battery that rests a little has more"
    assert level.update(100.0, 0.1, 60.0) == pytest.approx(44.0)
    assert level.doubt == "has risen in flight"
    assert level.update(None, 0.1, 80.0) == pytest.approx(42.0)
    assert level.update(100.0, 0.1, 110.0) == pytest.approx(39.0)
    assert level.update(38.0, 0.1, 120.0) == 38.0
    assert level.doubt == ""


def test_a_single_wrong_word_of_the_level_is_taken_back() -> None:
    """A garbled message said 5 %, and the 76 % after it were never believed again in that flight."""
    level = Level()
    assert level.update(76.0, 0.1, 0.0) == 76.0
    assert level.update(5.0, 0.1, 1.0) == 5.0  # which may be true, so it counts at once
    assert level.update(76.0, 0.1, 2.0) == 76.0
    assert level.doubt == ""
    assert level.update(75.0, 0.1, 12.0) == 75.0
    assert level.update(5.0, 0.1, 20.0) == 5.0
    assert level.update(76.0, 0.1, 40.0) < 5.0  # and not one that has stood for so long
    assert level.doubt == "has risen in flight"


def test_a_level_that_is_counted_down_leads_home_and_is_told() -> None:
    near = WayHome(0.0, 30.0, 0.0)
    reckoned = Energy(66.0, 0.1, near, told=False)
    assert reckoned.objection(100.0, FLIGHT) == ""
    assert reckoned.warning() == "the battery's level is not told any longer: reckoned to be 66 %"
    assert "reckoned" in Energy(20.0, 0.1, near, told=False).objection(100.0, FLIGHT)
    assert Energy(66.0, 0.1, near).warning() == ""


def test_an_unknown_battery_leads_home_unless_the_settings_say_otherwise() -> None:
    near = WayHome(0.0, 30.0, 0.0)
    never = Energy(None, None, near, told=False)
    assert never.objection(5.0, FLIGHT) == "", "not heard yet is not a fault"
    assert never.objection(20.0, FLIGHT) == "the battery's level is not known"
    assert never.objection(20.0, FlightSettings(allow_unknown_battery=True)) == ""
    assert never.warning() == "the battery's level is not known"


@pytest.mark.parametrize("state", ["low", "critical", "emergency", "failed", "unhealthy"])
def test_what_the_autopilot_calls_low_leads_home_whatever_the_percent(state: str) -> None:
    near = WayHome(0.0, 30.0, 0.0)
    assert state in Energy(90.0, None, near, state=state).objection(100.0, FLIGHT)
    assert Energy(90.0, None, near, state="ok").objection(100.0, FLIGHT) == ""


@pytest.mark.parametrize(
    ("battery", "words"),
    [
        (Telemetry(), "not known; flight.allow_unknown_battery"),
        (Telemetry(battery_percent=20.0), "20 % is the least"),
        (Telemetry(battery_percent=34.0), "needs about 20 % and 15 % are kept"),
        (Telemetry(battery_percent=90.0, battery_state="critical"), "calls the battery critical"),
    ],
)
def test_no_take_off_on_a_battery_that_is_unknown_or_too_low(battery: Telemetry, words: str) -> None:
    assert words in take_off_objection(battery, 240.0, FLIGHT)


def test_a_battery_that_is_enough_takes_off() -> None:
    assert take_off_objection(Telemetry(battery_percent=36.0), 240.0, FLIGHT) == ""
    assert take_off_objection(Telemetry(), 240.0, FlightSettings(allow_unknown_battery=True)) == ""


def test_the_time_left_ends_when_the_way_home_must_begin() -> None:
    home = WayHome.along(STRAIGHT, 30.0, None, FLIGHT)  # at 0.15 %/s
    left = (64.5 - 15.0) / 0.15 - home.seconds
    assert Energy(64.5, 0.15, home).seconds_left(FLIGHT) == pytest.approx(left)
    assert Energy(30.0, 0.15, home).seconds_left(FLIGHT) == 0.0
    assert Energy(64.5, None, home).seconds_left(FLIGHT) is None
    assert Energy(None, 0.15, home).seconds_left(FLIGHT) is None


def test_between_two_whole_percents_the_level_is_reckoned_down_and_never_by_more_than_one() -> None:
    used = Consumption()
    assert used.level(81.0, 0.0) == 81.0  # nothing is known yet
    for second in range(0, 100):
        used.update(float(90 - second // 10), float(second))
    assert used.percent_per_s == pytest.approx(0.1)
    assert used.level(81.0, 90.0) == pytest.approx(81.0)
    assert used.level(81.0, 95.0) == pytest.approx(80.5)
    assert used.level(81.0, 300.0) == 80.0
