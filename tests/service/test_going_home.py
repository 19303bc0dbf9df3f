"""The way home: ours around the exclusions, then the autopilot's own."""

from __future__ import annotations

import asyncio
from types import SimpleNamespace
from typing import Any, cast

import pytest

from service.mission.mission import HOME_AGAIN_S, Mission
from service.mission.states import Event, State


class Homebound:
    """As much of a mission as flying home asks of. The autopilot hears the `heard`-th order and lands."""

    def __init__(self, heard: int = 1) -> None:
        self.did: list[str] = []
        self.state = State.RETURNING
        self.helm = SimpleNamespace(
            route=lambda home: [(1.0, 1.0), home],
            home=lambda: (0.0, 0.0),
            rest=lambda: self.did.append("rest"),
        )
        self.holds = SimpleNamespace(direct=False)
        self.time = 0.0
        self.clock = SimpleNamespace(now=lambda: self.time, sleep=self.sleep)
        self.autopilot_returns = False
        self.telemetry = SimpleNamespace(guided=True, armed=True)
        self.vehicle: Any = SimpleNamespace(telemetry=self.telemetry, return_to_launch=None)
        self.heard = heard

    async def sleep(self, seconds: float) -> None:
        self.time += seconds
        if self.did.count("return to launch") >= self.heard:
            self.telemetry.guided = False
            self.telemetry.armed = self.time < self.heard * HOME_AGAIN_S + 20.0

    async def _fly_to(self, point: tuple[float, float]) -> bool:
        self.did.append(f"fly to {point}")
        return True

    async def _command(self, name: str, action: object) -> None:
        self.did.append(name)

    async def happen(self, event: Event, reason: str) -> None:
        self.state = State.DONE

    def flown(self) -> list[str]:
        """What was done on the way."""
        asyncio.run(Mission._go_home(cast(Mission, self)))
        return self.did


def test_no_waypoint_of_ours_is_watched_while_the_autopilot_lands() -> None:
    """Landed in the guided mode, the aircraft comes no nearer to it, and that is no fault."""
    assert Homebound().flown() == ["fly to (1.0, 1.0)", "rest", "return to launch"]


def test_a_return_to_launch_that_is_not_flown_is_ordered_again_and_one_that_is_flown_is_not() -> None:
    homebound = Homebound(heard=3)
    assert homebound.flown().count("return to launch") == 3
    assert homebound.time > 2 * HOME_AGAIN_S


def test_an_aircraft_that_is_down_is_not_ordered_home() -> None:
    homebound = Homebound()
    homebound.telemetry.guided = homebound.telemetry.armed = False
    assert homebound.flown() == ["rest"]


@pytest.mark.parametrize("after", [State.RETURNING, State.HOLDING, State.ABORTED])
def test_an_order_that_the_state_does_not_outlast_is_not_sent(after: State) -> None:
    sent = []

    async def write(kind: str, body: object) -> None:
        mission.state = after

    async def act() -> None:
        sent.append("return to launch")

    mission: Any = SimpleNamespace(state=State.RETURNING, _write=write)
    asyncio.run(Mission._command(mission, "return to launch", act))
    assert bool(sent) == (after == State.RETURNING)
