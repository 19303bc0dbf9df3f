"""Whatever the vehicle does not tell: the mission goes on being asked, and a hold stops the aircraft."""

from __future__ import annotations

import math
from dataclasses import fields
from typing import Any

import pytest

from service.mavlink import gates
from service.mavlink.settings import MavlinkSettings
from service.mavlink.telemetry import Telemetry, stopping_point
from service.mission.effects import Brake, EnterGuided, SendWaypoint, Stop, Think
from service.mission.news import Order
from service.mission.states import State
from tests.service.mission.flown import Talk, reached, searching

ALL_TOLD: dict[str, Any] = {
    "velocity_ned_mps": (3.0, 4.0, 0.0),
    "boot_time_s": 100.0,
    "roll_deg": 0.0,
    "pitch_deg": 0.0,
    "yaw_deg": 0.0,
    "battery_state": "ok",
    "estimator_ok": True,
    "sticks": 0.0,
    "ready_to_arm": True,
}
NOT_OURS = {
    "heartbeat_time",
    "mode",
    "guided",
    "armed",
    "in_control",
}  # without which nothing is to be stopped
UNKNOWN: dict[str, Any] = {
    each.name: getattr(Telemetry(), each.name) for each in fields(Telemetry) if each.name not in NOT_OURS
}
IN_THE_AIR = [State.SEARCHING, State.CONFIRMING, State.FOUND, State.RETURNING, State.HOLDING]


def stopped(talk: Talk) -> None:
    """Hold is ordered, and what follows from it would be sent."""
    talk.wanted.clear()
    talk.on(Order("hold"))
    if isinstance(talk.core.doing, EnterGuided):
        talk.done()
    t = talk.seen.telemetry
    assert talk.state == State.HOLDING
    stop = [each for each in talk.wanted if isinstance(each, Stop | Brake)][-1]
    if isinstance(stop, Stop):
        settings = MavlinkSettings()
        assert t.position_known
        assert gates.why_not_flying(t, settings, now=talk.now) is None
        assert gates.why_not_there(t, settings, stopping_point(t, 5.0)) is None


@pytest.mark.parametrize("state", IN_THE_AIR)
@pytest.mark.parametrize("field", UNKNOWN)
def test_a_hold_stops_an_aircraft_whatever_it_does_not_tell(field: str, state: State) -> None:
    talk = reached(state, **ALL_TOLD)
    talk.shows(**{field: UNKNOWN[field]})
    if field == "position_time":
        talk.silent.add("position")
    talk.tick()
    stopped(talk)


@pytest.mark.parametrize("velocity", [(math.nan, 0.0, 0.0), (0.0, math.nan, 0.0), (3.0, 4.0, math.nan)])
def test_a_velocity_of_which_a_part_is_not_told_does_not_keep_a_hold_from_going_out(
    velocity: tuple[float, float, float],
) -> None:
    talk = searching(velocity_ned_mps=velocity)
    stopped(talk)


def test_a_position_that_stays_away_for_a_moment_does_not_keep_a_hold_from_going_out() -> None:
    talk = searching(**ALL_TOLD)
    talk.shows(old=frozenset({"GLOBAL_POSITION_INT"}), velocity_ned_mps=UNKNOWN["velocity_ned_mps"])
    talk.on(Order("hold"))
    assert Brake() in talk.wanted


@pytest.mark.parametrize("heading", [0.0, math.nan])
def test_a_search_goes_on_without_a_velocity_and_a_heading(heading: float) -> None:
    talk = searching(velocity_ned_mps=UNKNOWN["velocity_ned_mps"], heading_deg=heading)
    talk.tick()
    think = [each for each in talk.wanted if isinstance(each, Think)][-1]
    assert (think.speed_mps, think.heading) == (0.0, "north")
    row, col = think.cell
    talk.decides((row - 1, col))
    talk.tick()
    assert isinstance(talk.doing(), SendWaypoint)
