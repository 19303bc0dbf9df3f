"""What happens at every change of state: it is written down, told to the pilot, and old orders are withdrawn."""

from __future__ import annotations

import asyncio
from types import SimpleNamespace
from typing import Any, cast

import pytest

from service.mission.mission import Mission
from service.mission.states import TABLE, Event, State


class Changing:
    """As much of a mission as a change of its state asks of; `did` tells in which order things happened."""

    def __init__(self, state: State) -> None:
        self.did: list[Any] = []
        self.state, self.why_here = state, ""
        self.why_stopped, self.searched, self.autopilot_returns = "the operator asked to return", True, True
        self.holds = SimpleNamespace(entered=lambda state, now: None)
        self.clock = SimpleNamespace(now=lambda: 0.0)
        self.helm = SimpleNamespace(rest=lambda: self.did.append("rest"))
        self.flight = SimpleNamespace(ended=None)
        self.vehicle = SimpleNamespace(
            release_control=lambda reason: self.did.append("released"),
            status_text=lambda text: self.did.append(text),
        )
        self._changed = asyncio.Event()

    def _drop_thought(self) -> None:
        self.did.append("thought dropped")

    async def _write(self, kind: str, body: dict[str, object]) -> None:
        self.did.append((kind, body))


def change(state: State, event: Event) -> list[Any]:
    """What was done at this event."""
    return changed(state, event).did


def changed(state: State, event: Event) -> Changing:
    """The mission after this event."""
    mission = Changing(state)
    asyncio.run(Mission.happen(cast(Mission, mission), event, "for a test"))
    return mission


@pytest.mark.parametrize(("state", "event", "after"), [(*key, after) for key, after in TABLE.items()])
def test_every_change_is_written_down_and_then_told_to_the_pilot(
    state: State, event: Event, after: State
) -> None:
    did = change(state, event)
    body = {"from": state, "event": event, "to": after, "reason": "for a test"}
    assert did[-2:] == [("transition", body), f"search {after}: for a test"]


@pytest.mark.parametrize(("state", "event", "after"), [(*key, after) for key, after in TABLE.items()])
def test_no_waypoint_outlives_the_state_that_wanted_it(state: State, event: Event, after: State) -> None:
    flying = {State.SEARCHING, State.CONFIRMING}
    did = change(state, event)
    assert ("rest" in did) == (not {state, after} <= flying)
    assert ("released" in did) == (after == State.YIELDED)
    assert "thought dropped" in did


@pytest.mark.parametrize(("state", "event", "after"), [(*key, after) for key, after in TABLE.items()])
def test_why_a_search_stopped_is_forgotten_when_it_goes_on(state: State, event: Event, after: State) -> None:
    flying = {State.SEARCHING, State.CONFIRMING}
    mission = changed(state, event)
    goes_on = after in flying and state not in flying
    assert (mission.why_stopped == "", mission.searched is False) == (goes_on, goes_on)
    assert not mission.autopilot_returns


def test_an_event_that_changes_nothing_does_nothing() -> None:
    assert change(State.HOLDING, Event.HOLD) == []
