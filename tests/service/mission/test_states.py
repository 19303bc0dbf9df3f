"""The state machine's table: what must always and what must never happen."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from service.mission.states import FINAL, MAY_MOVE, TABLE, Event, State, diagram, next_state


def test_an_event_that_is_not_in_the_table_changes_nothing() -> None:
    for state in State:
        for event in Event:
            if (state, event) not in TABLE:
                assert next_state(state, event) == state


@pytest.mark.parametrize("state", sorted(set(State) - FINAL - {State.GROUNDED}))
def test_a_pilot_takes_the_aircraft_out_of_every_state_that_is_not_final(state: State) -> None:
    assert next_state(state, Event.PILOT) == State.YIELDED


def test_a_grounded_aircraft_is_the_pilots_anyway() -> None:
    assert State.GROUNDED not in MAY_MOVE
    assert next_state(State.GROUNDED, Event.PILOT) == State.GROUNDED


def test_only_an_operator_gets_out_of_yielded() -> None:
    ways_out = {event for (state, event) in TABLE if state == State.YIELDED}
    orders = {Event.RESUME, Event.CLIMB, Event.RETURN, Event.FINISH, Event.ABORT}
    assert ways_out == {*orders, Event.LANDED, Event.DOWN}
    assert State.YIELDED not in MAY_MOVE


def test_every_state_can_be_reached_and_every_unfinished_one_left() -> None:
    reached = {State.WAITING}
    while new := {to for (state, _), to in TABLE.items() if state in reached} - reached:
        reached |= new
    assert reached == set(State)
    for state in set(State) - FINAL:
        assert any(to in FINAL or to != state for (at, _), to in TABLE.items() if at == state)
    assert not [pair for pair in TABLE if pair[0] in FINAL]


def test_abort_ends_every_unfinished_state() -> None:
    for state in set(State) - FINAL:
        assert next_state(state, Event.ABORT) == State.ABORTED


def test_the_readme_shows_the_diagram_of_the_table() -> None:
    readme = (Path(__file__).parents[3] / "service" / "README.md").read_text(encoding="utf-8")
    section = readme.split("## How a mission goes")[1].split("\n## ")[0]
    assert section.split("```mermaid\n")[1].split("```")[0] == diagram()


def test_every_guarantee_in_the_readme_names_a_test_that_there_is() -> None:
    root = Path(__file__).parents[3]
    section = (
        (root / "service" / "README.md").read_text(encoding="utf-8").split("**The pilot always wins.**")[1]
    )
    rows = section.split("\n## ")[0].split("| --- | --- |\n")[1].split("\n\n")[0].splitlines()
    one = r"`[\w/]+\.py`: `\w+`(?:, `\w+`)*"
    assert [row for row in rows if not re.search(rf"\| {one}(?:; {one})* \|$", row)] == []
    named = re.findall(r"`([\w/]+\.py)`: (`\w+`(?:, `\w+`)*)", "\n".join(rows))
    assert len(named) > 10
    for file, names in named:
        places = [root / "tests" / file, root / "tests" / "service" / file]
        (there,) = [place for place in places if place.is_file()]
        text = there.read_text(encoding="utf-8")
        assert [name for name in re.findall(r"\w+", names) if f"def test_{name}(" not in text] == [], file


def test_the_diagram_has_an_arrow_for_every_entry_of_the_table_but_abort() -> None:
    arrows = {}
    for line in diagram().splitlines():
        if ": " in line:
            pair, events = line.strip().split(": ")
            state, to = pair.split(" --> ")
            arrows.update({(state, event): to for event in events.split(", ")})
    assert arrows == {pair: to for pair, to in TABLE.items() if pair[1] != Event.ABORT}
