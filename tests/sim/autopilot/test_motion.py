"""The vehicle's own physics: its limits, wind, battery, and that time and chance do not change a flight."""

from __future__ import annotations

import asyncio
import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sim.__main__ import main
from sim.autopilot.battery import Battery
from sim.autopilot.bench import pace
from sim.autopilot.core import Autopilot
from sim.autopilot.flavors import ARDUCOPTER, PX4
from sim.autopilot.geo import LocalFrame
from sim.autopilot.motion import Body, Demand, Limits, approach_speed
from sim.autopilot.settings import STEP_S, Settings
from tests.conformance.wire import codec, mav

LIMITS = [PX4.limits, ARDUCOPTER.limits]


def flying(limits: Limits) -> Body:
    """A body hovering at 30 m."""
    body = Body(limits, 0.0)
    body.up, body.on_ground = 30.0, False
    return body


@settings(max_examples=40, deadline=None)
@given(
    limits=st.sampled_from(LIMITS),
    north=st.floats(-150, 150),
    east=st.floats(-150, 150),
    up=st.floats(5, 60),
)
def test_it_arrives_without_breaking_its_limits(limits: Limits, north: float, east: float, up: float) -> None:
    body, demand = flying(limits), Demand(limits)
    demand.north, demand.east, demand.up = north, east, up
    velocity = (0.0, 0.0)
    push = (0.0, 0.0)
    for _ in range(round(80 / STEP_S)):
        body.step(demand, (body.north, body.east, body.up), (0.0, 0.0), True)
        now = (body.velocity_north, body.velocity_east)
        pull = ((now[0] - velocity[0]) / STEP_S, (now[1] - velocity[1]) / STEP_S)
        assert body.speed < 1.1 * limits.cruise
        assert math.hypot(*pull) < 1.5 * limits.accelerate  # both components at once, in a turn
        assert math.dist(pull, push) / STEP_S < 8.0 * limits.jerk  # the tilt follows with a lag
        assert -1.05 * limits.descend < body.velocity_up < 1.05 * limits.climb
        velocity, push = now, pull
    assert math.dist((body.north, body.east, body.up), (north, east, up)) < 0.5


@given(gain=st.floats(0.3, 3), braking=st.floats(0.3, 3), distance=st.floats(0, 1e4))
def test_approach_speed_never_asks_for_more_than_the_brakes_give(
    gain: float, braking: float, distance: float
) -> None:
    assert approach_speed(distance, gain, braking) ** 2 <= 2.0 * braking * distance + 1e-6


@pytest.mark.parametrize("limits", LIMITS)
def test_it_leans_against_the_wind_until_the_tilt_is_used_up(limits: Limits) -> None:
    def drift(wind: float) -> float:
        body, demand = flying(limits), Demand(limits)
        demand.north, demand.east, demand.up = 0.0, 0.0, 30.0
        for _ in range(round(60 / STEP_S)):
            body.step(demand, (body.north, body.east, body.up), (0.0, wind), True)
        return body.east

    assert abs(drift(10.0)) < 1.0
    assert drift(20.0) > 50.0


def test_battery_hovers_for_its_endurance_and_sags_with_its_charge() -> None:
    battery = Battery(600.0, 4)
    full = battery.voltage
    for _ in range(599):
        battery.draw(1.0, flying=True, speed=0.0, climb=0.0)
    assert 0.0 < battery.charge < 0.01
    assert battery.voltage < full
    battery.draw(10.0, flying=True, speed=0.0, climb=0.0)
    assert battery.charge == 0.0
    other = Battery(600.0, 4)
    other.draw(300.0, flying=True, speed=8.0, climb=2.0)
    assert other.charge < 0.5


@given(
    latitude=st.floats(-80, 80),
    longitude=st.floats(-179, 179),
    north=st.floats(-2000, 2000),
    east=st.floats(-2000, 2000),
)
def test_places_survive_the_way_to_degrees_and_back(
    latitude: float, longitude: float, north: float, east: float
) -> None:
    frame = LocalFrame(latitude, longitude)
    assert math.dist(frame.from_e7(*frame.to_e7(north, east)), (north, east)) < 0.02


def flight(flavor: str, seed: int, chunk: int, speedup: float) -> list[tuple[float, ...]]:
    """Where a mock is each second of a flight with commands at fixed vehicle times, in steps by chunks."""
    autopilot = Autopilot(
        Settings(flavor=flavor, seed=seed, speedup=speedup, wind_mps=(2.0, 1.0), gust_mps=1.5)
    )
    link, sender = autopilot.add_link(), codec()
    home = autopilot.settings.home
    takeoff = home[2] + 20.0 if flavor == "px4" else 20.0
    far = (round((home[0] + 4e-4) * 1e7), round(home[1] * 1e7), home[2] + 25.0)
    script = {
        20.0: mav.MAVLink_command_long_message(1, 1, 176, 0, 1, 4, 3, 0, 0, 0, 0),
        21.0: mav.MAVLink_command_long_message(1, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0),
        22.0: mav.MAVLink_command_long_message(1, 1, 22, 0, 0, 0, 0, 0, 0, 0, takeoff),
        50.0: mav.MAVLink_command_int_message(1, 1, 0, 192, 0, 0, -1, 1, 0, math.nan, *far),
        60.0: mav.MAVLink_command_long_message(1, 1, 20, 0, *(0.0,) * 7),
    }
    track: list[tuple[float, ...]] = []
    for second in range(130):
        if float(second) in script:
            autopilot.receive(link, script[float(second)].pack(sender))
        for _ in range(round(1.0 / STEP_S) // chunk):
            autopilot.advance(chunk)
        link.outbox.clear()
        body = autopilot.vehicle.body
        track.append((body.north, body.east, body.up, body.yaw, autopilot.vehicle.battery.charge))
    assert max(place[2] for place in track) > 18.0
    return track


@pytest.mark.parametrize("flavor", ["px4", "ardupilot"])
def test_same_seed_and_commands_give_the_same_flight_at_any_speed(flavor: str) -> None:
    slow = flight(flavor, 5, 1, 1.0)
    assert flight(flavor, 5, 1, 1.0) == slow
    assert flight(flavor, 5, 50, 100.0) == slow
    assert flight(flavor, 6, 1, 1.0) != slow


def test_sixty_mocks_in_one_process_keep_up_with_real_time() -> None:
    shares = (asyncio.run(pace(60, 2.0)).share for _ in range(10))
    assert any(share > 0.9 for share in shares)  # on a host that is busy with other things: once in ten


def test_the_benchmark_of_the_mock_tells_its_factor(capsys: pytest.CaptureFixture[str]) -> None:
    main(["bench", "autopilot", "--mocks", "2", "--seconds", "0.5", "--speedup", "5"])
    assert "2 mocks in one process: the slowest ran at" in capsys.readouterr().out
