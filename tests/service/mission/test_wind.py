"""The wind as it is reckoned from the lean of the mock autopilot's body, whose drag is its own."""

from __future__ import annotations

import math
import random
from collections.abc import Iterator
from dataclasses import replace

import pytest

from service.config import FlightSettings
from service.mavlink.telemetry import Telemetry, Wind
from service.mission.wind import WindFelt, pull_of
from sim.autopilot.ardupilot import ArduCopter
from sim.autopilot.motion import Body, Demand
from sim.autopilot.px4 import Px4
from sim.autopilot.sensors import Wander
from sim.autopilot.settings import STEP_S

FLIGHT = FlightSettings(speed_mps=8.0, max_airspeed_mps=15.0)
FLAVOURS = {"px4": Px4, "ardupilot": ArduCopter}
SHORT = [(0.0, 25.0), (25.0, 25.0), (25.0, 50.0), (50.0, 50.0), (50.0, 25.0), (75.0, 25.0), (75.0, 0.0)] * 4
LONG = [(200.0, 0.0), (200.0, 60.0), (0.0, 60.0), (0.0, 0.0)] * 2


def flown(
    legs: list[tuple[float, float]], wind: tuple[float, float], flavour: str, *, gust: float = 0.0
) -> Iterator[tuple[Telemetry, bool, float]]:
    """Telemetry ten times a second over legs (north, east, in metres) in a wind (north, east)."""
    body, chance = Body(FLAVOURS[flavour].flavor.limits, 0.0), random.Random(1)
    gusts = (Wander(gust, 3.0, chance), Wander(gust, 3.0, chance))
    body.up, body.on_ground = 30.0, False
    demand, now, air = Demand(body.limits), 1000.0, wind
    demand.up, demand.speed = 30.0, FLIGHT.speed_mps
    for north, east in legs:
        demand.north, demand.east = north, east
        for step in range(3000):
            away = math.hypot(north - body.north, east - body.east)
            if away < 1.5:
                break
            if away > 2.0:
                demand.yaw = math.degrees(math.atan2(east - body.east, north - body.north)) % 360.0
            if step % 50 == 0 and gust:
                air = wind[0] + gusts[0].draw(), wind[1] + gusts[1].draw()
            body.step(demand, (body.north, body.east, body.up), air, True)
            now += STEP_S
            if round(now / STEP_S) % 5 == 0:
                yield _told(body, now), away > 15.0, now


def _told(body: Body, now: float) -> Telemetry:
    yaw, (north, east) = math.radians(body.yaw), body.tilt
    ahead, right = north * math.cos(yaw) + east * math.sin(yaw), east * math.cos(yaw) - north * math.sin(yaw)
    return Telemetry(
        position_time=now,
        velocity_ned_mps=(body.velocity_north, body.velocity_east, 0.0),
        roll_deg=math.degrees(math.atan(right / 9.81)),
        pitch_deg=-math.degrees(math.atan(ahead / 9.81)),
        yaw_deg=body.yaw,
    )


def felt(flying: Iterator[tuple[Telemetry, bool, float]]) -> list[Wind | None]:
    """What is reckoned at each moment."""
    wind = WindFelt(FLIGHT)
    return [wind.update(t, under_way, now) for t, under_way, now in flying]


@pytest.mark.parametrize("flavour", FLAVOURS)
@pytest.mark.parametrize("legs", [SHORT, LONG], ids=["short", "long"])
def test_no_wind_is_felt_in_a_calm_however_short_the_legs_are(
    legs: list[tuple[float, float]], flavour: str
) -> None:
    said = felt(flown(legs, (0.0, 0.0), flavour))
    assert said[-1] is not None  # it is known that there is none
    assert max(wind.speed_mps for wind in said if wind is not None) < 1.5


@pytest.mark.parametrize("flavour", FLAVOURS)
@pytest.mark.parametrize("wind", [(0.0, 4.0), (-8.0, 0.0), (6.0, -9.0), (0.0, 13.0)])
@pytest.mark.parametrize("gust", [0.0, 1.5])
def test_a_wind_is_reckoned_from_the_lean(wind: tuple[float, float], gust: float, flavour: str) -> None:
    said = felt(flown(SHORT, wind, flavour, gust=gust))
    assert said[-1] is not None
    off = math.hypot(said[-1].north_mps - wind[0], said[-1].east_mps - wind[1])
    assert off < 1.0 + 0.15 * math.hypot(*wind) + gust, said[-1]


def test_what_is_told_goes_first() -> None:
    (t, under_way, now), *_ = flown(LONG, (0.0, 5.0), "px4")
    assert WindFelt(FLIGHT).update(replace(t, wind=Wind(1.0, 2.0)), under_way, now) == Wind(1.0, 2.0)


def test_without_an_attitude_or_a_way_through_the_air_nothing_is_known() -> None:
    blind = ((replace(t, roll_deg=math.nan), way, now) for t, way, now in flown(SHORT, (0.0, 8.0), "px4"))
    assert set(felt(blind)) == {None}
    hovering = [
        (
            Telemetry(
                position_time=float(i),
                velocity_ned_mps=(0.0, 0.0, 0.0),
                roll_deg=10.0,
                pitch_deg=0.0,
                yaw_deg=0.0,
            )
        )
        for i in range(100)
    ]
    assert set(felt((t, False, t.position_time) for t in hovering)) == {None}


def test_an_aircraft_at_its_limit_feels_the_wind_against_it_without_a_turn() -> None:
    wind = WindFelt(FLIGHT)
    against = Telemetry(velocity_ned_mps=(5.0, 0.0, 0.0), roll_deg=0.0, pitch_deg=-30.0, yaw_deg=0.0)
    said = [wind.update(replace(against, position_time=0.1 * i), True, 0.1 * i) for i in range(60)]
    assert said[0] is None
    assert said[-1] == Wind(-10.0, 0.0)
    assert wind.update(replace(against, position_time=400.0), False, 400.0) is None  # long ago


def test_an_aircraft_that_is_slow_and_level_feels_no_wind() -> None:
    wind = WindFelt(FLIGHT)
    level = Telemetry(velocity_ned_mps=(5.0, 0.0, 0.0), roll_deg=0.0, pitch_deg=-3.0, yaw_deg=0.0)
    for i in range(600):
        assert wind.update(replace(level, position_time=0.1 * i), True, 0.1 * i) is None


def test_a_lean_pulls_where_it_leans() -> None:
    north = pull_of(Telemetry(roll_deg=0.0, pitch_deg=-45.0, yaw_deg=0.0))
    east = pull_of(Telemetry(roll_deg=45.0, pitch_deg=0.0, yaw_deg=0.0))
    turned = pull_of(Telemetry(roll_deg=0.0, pitch_deg=-45.0, yaw_deg=90.0))
    assert north == pytest.approx((9.81, 0.0))
    assert east == pytest.approx((0.0, 9.81))
    assert turned == pytest.approx((0.0, 9.81))
    assert pull_of(Telemetry(roll_deg=0.0, pitch_deg=0.0)) is None
