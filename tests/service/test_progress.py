"""What a person at the terminal sees: a table that is of now, also at the end, and lines where output is kept."""

from __future__ import annotations

import asyncio
import io
import re
from typing import Any, cast

import pytest
from rich.console import Console

from service.mission.states import State
from service.progress import facts, line, show
from service.view.next import next_state
from service.view.state import RunState

ROI = "ROI 1: 99 % of the mass, here"


def state(now: State, **values: Any) -> RunState:
    """A state as far as the terminal tells of it."""
    place = {"lat": 56.6, "lon": -4.7, "probability": 0.9997, "written": "56.600000, -4.700000"}
    known = {
        "state": now, "pos": 0.9997, "place": place, "steps": 55, "flight_time_s": 278.0, "flight_left_s": 600.0,
        "battery_percent": 57.0, "reason": ROI, "next": next_state(now, [], [], []), "aircraft": [{}],
    }  # fmt: skip
    return cast(RunState, {**known, **values})


def test_the_table_that_stays_in_the_terminal_is_of_the_end() -> None:
    told = io.StringIO()
    console = Console(file=told, force_terminal=True, width=100)
    now = [state(State.RETURNING)]

    async def fly() -> None:
        shown = asyncio.create_task(show(console, lambda: now[0]))
        await asyncio.sleep(0.3)
        now[0] = state(State.DONE)  # and over at once, before the table is drawn again
        shown.cancel()
        await asyncio.gather(shown, return_exceptions=True)

    asyncio.run(fly())
    states = re.findall(r"RETURNING|DONE", told.getvalue())
    assert (states[0], states[-1]) == ("RETURNING", "DONE")


@pytest.mark.parametrize("now", list(State))
def test_where_it_goes_is_told_while_it_searches_only(now: State) -> None:
    told = dict(facts(state(now)))
    flies = now in (State.SEARCHING, State.CONFIRMING)
    assert (told["next"] == ROI) == (ROI in line(state(now))) == flies
    assert told["next"]


def test_nothing_at_the_terminal_is_a_hundred_per_cent_that_is_less() -> None:
    told = dict(facts(state(State.DONE)))
    assert told["probability of success so far"] == "over 99.9 %"
    assert told["most likely place"] == "over 99.9 % at 56.600000, -4.700000"
    assert "100" not in line(state(State.DONE))
