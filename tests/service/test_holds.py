"""What a mission hovers for, and when that ends."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any, cast

import pytest

from service.config import Settings
from service.mission.holds import Holds
from service.mission.mission import Mission
from service.mission.states import Event, State, next_state


class Stage:
    """As much of a mission as a hold asks of, over the real table."""

    def __init__(self, after_silence: str = "resume") -> None:
        self.settings = Settings.model_validate({"link": {"after_silence": after_silence}})
        self.state, self.why_stopped, self.searched = State.SEARCHING, "", False
        self.resend, self.stops = False, 0
        self.helm = SimpleNamespace(heard=lambda: self.hears, doubts=lambda: [], hover=self.hover)
        self.clock = SimpleNamespace(now=lambda: self.time, speedup=1.0)
        self.intake = SimpleNamespace(last_at=0.0)
        self.hears, self.time, self.low = True, 0.0, ""
        self.holds = Holds(cast(Mission, self), tick=self.tick, energy_low=lambda: self.low)

    async def hover(self, wanted: Callable[[], bool]) -> None:
        self.stops += wanted()

    async def tick(self) -> None:
        self.time += 1.0
        if self.time > 2000.0:
            raise TimeoutError("it hovers for ever")

    async def happen(self, event: Event, reason: str) -> bool:
        self.state = next_state(self.state, event)
        self.holds.entered(self.state, self.time)
        return True

    def hold(self, *causes: str) -> State:
        """Hold for some causes until that ends; the state then."""

        async def whole() -> None:
            self.holds.causes.update(causes)
            await self.happen(Event.HOLD, "for a test")
            await self.holds.wait_out()

        asyncio.run(whole())
        return self.state


@pytest.mark.parametrize(
    ("after_silence", "state"), [("resume", State.SEARCHING), ("return", State.RETURNING)]
)
def test_after_a_silence_it_does_what_the_settings_say(after_silence: str, state: State) -> None:
    assert Stage(after_silence).hold("link") == state


def test_after_a_silence_it_may_have_to_wait_for_an_operator() -> None:
    stage = Stage("hold")
    with pytest.raises(TimeoutError):
        stage.hold("link")
    assert (stage.state, stage.holds.causes) == (State.HOLDING, {"operator"})


def test_a_stop_that_may_have_been_lost_is_sent_again_once() -> None:
    stage = Stage("hold")
    stage.resend = True
    with pytest.raises(TimeoutError):
        stage.hold("link")
    assert (stage.stops, stage.resend) == (1, False)


def test_a_search_that_goes_on_may_fly_home_by_its_own_way_again() -> None:
    stage: Any = Stage()
    stage.holds.direct = True
    asyncio.run(stage.happen(Event.HOLD, "the operator asked"))
    assert stage.holds.direct
    asyncio.run(stage.happen(Event.RESUME, "the operator asked"))
    assert not stage.holds.direct


def test_a_cause_does_not_outlive_its_hold() -> None:
    """An operator holds, and then orders the return: a later hold on the way home ends by itself."""
    stage: Any = Stage()
    stage.holds.causes.add("operator")
    asyncio.run(stage.happen(Event.HOLD, "the operator asked"))
    asyncio.run(stage.happen(Event.RETURN, "the operator asked"))
    assert stage.hold("position") == State.RETURNING


def test_a_hold_for_a_fault_leads_home_in_the_end_and_at_once_without_the_energy() -> None:
    stage = Stage()
    stage.intake.last_at = -1e9
    assert stage.hold("progress") == State.RETURNING
    assert stage.why_stopped.startswith("hovered for")
    low = Stage()
    low.low = "battery at 18 %"
    assert low.hold("operator") == State.RETURNING
    assert (low.why_stopped, low.searched, low.time) == ("battery at 18 %", True, 1.0)


def test_a_silent_autopilot_is_not_sent_home_blindly() -> None:
    stage = Stage()
    stage.hears, stage.low = False, "battery at 18 %"
    with pytest.raises(TimeoutError):
        stage.hold("link")
    assert stage.state == State.HOLDING
