"""Getting an aircraft into the air, or not: what is asked for last may end it between any two steps."""

from __future__ import annotations

import asyncio
from types import SimpleNamespace
from typing import cast

import pytest

from service.config import Settings
from service.mission.departure import Departure
from service.mission.mission import Mission
from service.mission.states import Event, State, next_state

STEPS = ["connected", "ready", "guided", "armed", "in the air"]


class Preparing:
    """As much of a mission as getting ready asks of, over the real table. `at` (a step) the operator aborts or, in
    flight, the pilot takes over."""

    def __init__(
        self, at: str = "", *, event: Event = Event.ABORT, was_returning: dict[str, str] | None = None
    ) -> None:
        self.did: list[str] = []
        self.at, self.event = at, event
        self.settings = Settings()
        self.state, self.found, self.why_stopped, self.searched = State.WAITING, None, "", False
        self.may_take_off = True
        self.departure = Departure(cast(Mission, self), write=self._write)
        self.departure.was_returning = was_returning
        self.clock = SimpleNamespace(now=lambda: 1.0, speedup=100.0, sleep=lambda s: asyncio.sleep(s / 100.0))
        self.flight = SimpleNamespace(began=0.0)
        self.down, self.hovers = True, False
        self.helm = SimpleNamespace(
            begin=lambda: None, on_ground=lambda: self.down, hovering=lambda: self.hovers
        )
        self.search = SimpleNamespace(found=lambda: None)
        self.vehicle = SimpleNamespace(
            telemetry=SimpleNamespace(autopilot="px4"),
            connect=lambda patience: self.step("connected"),
            wait_until=lambda condition, patience: asyncio.sleep(0),
            wait_ready=lambda patience: self.step("ready"),
            enter_guided=lambda: self.step("guided"),
            arm=lambda: self.step("armed"),
            take_off=lambda height: self.step("in the air"),
        )

    async def step(self, name: str) -> None:
        if name == self.at:
            await self.happen(self.event, "for a test")
            await asyncio.sleep(0.05)  # the step goes on, and takes long
        self.did.append(name)

    async def happen(self, event: Event, reason: str) -> bool:
        before, self.state = self.state, next_state(self.state, event)
        return before != self.state

    async def _write(self, kind: str, body: object) -> None:
        pass

    def readied(self) -> State:
        """The state after getting ready."""
        asyncio.run(asyncio.wait_for(self.departure.get_ready(), 5.0))
        return self.state


def test_it_takes_off_step_by_step() -> None:
    mission = Preparing()
    assert mission.readied() == State.SEARCHING
    assert mission.did == STEPS


@pytest.mark.parametrize("at", STEPS)
def test_after_an_abort_no_further_step_is_taken(at: str) -> None:
    mission = Preparing(at)
    assert mission.readied() == State.ABORTED
    assert mission.did in (STEPS[: STEPS.index(at)], STEPS[: STEPS.index(at) + 1])


@pytest.mark.parametrize("event", [Event.PILOT, Event.RETURN])
@pytest.mark.parametrize("at", STEPS[2:])
def test_a_pilot_or_an_order_to_return_ends_the_take_off_between_its_steps(at: str, event: Event) -> None:
    mission = Preparing(at, event=event)
    assert mission.readied() == {Event.PILOT: State.YIELDED, Event.RETURN: State.RETURNING}[event]
    assert mission.did == STEPS[: STEPS.index(at)]  # what took long was broken off


LAST = {"from": "SEARCHING", "event": "searched", "to": "RETURNING", "reason": "searched to POS 97.0%"}


def test_a_run_that_was_on_its_way_home_does_not_take_off_again() -> None:
    mission = Preparing(was_returning=LAST)
    assert mission.readied() == State.RETURNING
    assert mission.did == ["connected"]
    assert (mission.why_stopped, mission.searched) == (LAST["reason"], True)


@pytest.mark.parametrize("ours", [True, False])
def test_a_run_that_was_on_its_way_home_goes_on_home_or_waits_for_who_flies(ours: bool) -> None:
    mission = Preparing(was_returning=LAST)
    mission.down, mission.hovers = False, ours

    async def land_later() -> None:
        await asyncio.sleep(0.05)
        mission.down = True

    async def both() -> None:
        await asyncio.gather(mission.departure.get_ready(), land_later())

    asyncio.run(both())
    assert mission.state == State.RETURNING
    assert mission.did == (["connected", "guided"] if ours else ["connected"])


def test_an_order_to_return_changes_nothing_before_the_flight() -> None:
    """Whoever has the aircraft then keeps it."""
    assert next_state(State.READY, Event.RETURN) == State.READY
