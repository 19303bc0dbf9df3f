"""What a mission watches ten times a second, whatever it is doing, and what it does about it."""

from __future__ import annotations

import asyncio
from types import SimpleNamespace
from typing import Any, cast

import pytest

from service.evidence.intake import JournalLost
from service.mission.mission import Mission
from service.mission.states import Event, State


class Watched:
    """As much of a mission as its guard asks of; the third wait ends the test."""

    def __init__(self, state: State = State.SEARCHING) -> None:
        self.did: list[Any] = []
        self.state, self.why_stopped = state, ""
        self.journal = SimpleNamespace(failed=None, path="journal.sqlite")
        self.homeward = SimpleNamespace(update=lambda: self.did.append("energy"))
        self.wind = self.strayed = self.low = ""
        self._energy_low = lambda: self.low
        self.trouble: Any = None
        self.helm = SimpleNamespace(
            trouble=lambda moving: self.trouble,
            too_windy=lambda: self.wind,
            strayed=lambda: self.strayed,
        )
        self.clock = SimpleNamespace(sleep=self.sleep)
        self._journal_lost = lambda error: Mission._journal_lost(cast(Mission, self), error)

    async def sleep(self, seconds: float) -> None:
        raise asyncio.CancelledError

    async def hold(self, cause: str, reason: str) -> None:
        self.did.append(("hold", cause, reason))

    async def happen(self, event: Event, reason: str) -> None:
        self.did.append((event, reason))

    async def _stop_searching(self, event: Event) -> None:
        self.did.append((event, self.why_stopped))

    def looked_at_once(self) -> list[Any]:
        """What one round of the guard does."""
        with pytest.raises(asyncio.CancelledError):
            asyncio.run(Mission._guard(cast(Mission, self)))
        return self.did


def test_all_well_and_nothing_is_done_but_to_count_the_energy() -> None:
    assert Watched().looked_at_once() == ["energy"]


def test_a_journal_that_failed_for_somebody_else_ends_the_mission_at_once() -> None:
    mission = Watched()
    mission.journal.failed = OSError("no space left on device")
    with pytest.raises(JournalLost, match=r"journal\.sqlite cannot be written: no space left"):
        asyncio.run(Mission._guard(cast(Mission, mission)))
    assert mission.did == []


@pytest.mark.parametrize("state", list(State))
def test_a_doubtful_position_holds_what_moves_and_nothing_else(state: State) -> None:
    mission = Watched(state)
    mission.trouble = SimpleNamespace(cause="position", reason="the GPS has no 3D fix")
    moving = {State.SEARCHING, State.CONFIRMING, State.RETURNING, State.HOLDING}
    held = ("hold", "position", "the GPS has no 3D fix") in mission.looked_at_once()
    assert held == (state in moving)


@pytest.mark.parametrize("state", list(State))
def test_the_energy_for_the_way_home_is_asked_for_on_every_leg_of_a_search(state: State) -> None:
    mission = Watched(state)
    mission.low = "the way home needs 31 %"
    searching = state in {State.SEARCHING, State.CONFIRMING}
    assert ((Event.ENERGY_LOW, mission.low) in mission.looked_at_once()) == searching


@pytest.mark.parametrize("why", ["a wind of 14 m/s", "the aircraft is outside the area"])
@pytest.mark.parametrize("state", list(State))
def test_wind_and_straying_lead_home_from_a_search_and_from_nothing_else(state: State, why: str) -> None:
    mission = Watched(state)
    if "wind" in why:
        mission.wind = why
    else:
        mission.strayed = why
    searching = state in {State.SEARCHING, State.CONFIRMING}
    assert ((Event.RETURN, why) in mission.looked_at_once()) == searching
    assert mission.why_stopped == (why if searching else "")
