"""A search as several aircraft have it: one belief, a planner each, and nobody plans what another is going to do."""

from __future__ import annotations

import asyncio

import numpy as np

from roisearch import SearchState
from service.config import Settings, each_aircraft
from service.entries import as_json, of_aircraft
from service.evidence.observe import Observation
from service.rows import CommandRow, ModeRow
from service.search import Search, begin
from tests.service.mission.flown import CELL_M, GRID

SETTINGS = Settings.model_validate(
    {"flight": {"altitude_m": 15.0}, "sensor": {"cell_m": CELL_M}, "aircraft": [{}, {}]}
)
NOW = 1000.0


def both() -> list[Search]:
    """The search as two aircraft have it."""
    (first, settings), (second, others) = each_aircraft(SETTINGS).items()
    search = Search(GRID, settings, aircraft=first)
    return [search, search.beside(second, others)]


def seen(cell: tuple[int, int]) -> Observation:
    """A look at a cell in vain."""
    return Observation(
        np.array([cell]),
        np.zeros(1, dtype=np.bool_),
        np.array([0.9]),
        np.array([0.9]),
        np.ones(1, dtype=np.bool_),
    )


def test_what_one_sees_all_believe() -> None:
    first, second = both()
    cell = first.grid.start
    before = second.belief.probability()[cell]
    first.take(seen(cell), NOW)
    assert second.belief is first.belief
    assert second.belief.probability()[cell] < before


def test_the_second_plans_with_the_looks_of_the_first_as_flown_until_they_are_given_back() -> None:
    first, second = both()
    state = SearchState(first.grid.start)

    async def decide() -> None:
        await first.decide(state, [], now=NOW)

    asyncio.run(decide())
    others = first.common.others
    planned = others.committed("1").cells
    assert len(planned) > 4
    thought = others.beside("2", second.belief, now_s=NOW)
    assert thought is not second.belief  # the belief itself is lowered by reports alone
    soon = tuple(planned[0])
    assert (
        thought.weights.reshape(GRID.frame.shape)[soon]
        < second.belief.weights.reshape(GRID.frame.shape)[soon]
    )
    first.give_back()
    assert others.beside("2", second.belief, now_s=NOW) is second.belief


def test_each_plans_with_the_field_of_view_of_its_own_sensor() -> None:
    own = {"profile": "wide-angle", "p_tp": 0.6, "p_tn": 0.8}
    tables = {"aircraft": [{}, {"sensor": own}], "flight": {"altitude_m": 15.0}, "sensor": {"cell_m": CELL_M}}
    settings = Settings.model_validate(tables)
    (first, alone), (second, other) = each_aircraft(settings).items()
    search = Search(GRID, alone, aircraft=first, common=begin(GRID, settings))
    beside = search.beside(second, other)
    assert search.fov.is_point
    assert not beside.fov.is_point

    async def decide() -> None:
        for each in (search, beside, search):
            await each.decide(SearchState(each.grid.start), [], now=NOW)

    asyncio.run(decide())
    others = search.common.others
    assert set(others.committed("1").p_tp) == {0.9}
    assert set(others.committed("2").p_tp) == {0.6}
    wide = [tuple(cell) for cell in others.committed("2").cells]
    assert len(wide) > len(set(wide)), "wide looks overlap"
    # false alarms are counted as of the detector whose hits prove least; what that is shows in no single answer
    assert search.known.alarms._p_tn == 0.8


def test_a_thought_that_is_dropped_commits_to_nothing() -> None:
    first, _ = both()

    async def drop() -> None:
        thinking = asyncio.create_task(first.decide(SearchState(first.grid.start), [], now=NOW))
        await asyncio.sleep(0)
        thinking.cancel()
        await asyncio.wait([thinking])
        planner = first._thread  # a thought that nobody waits for has no public end
        await asyncio.get_running_loop().run_in_executor(planner, lambda: None)

    asyncio.run(drop())
    assert len(first.common.others.committed("1").when) == 0


def test_one_alone_is_in_no_company() -> None:
    alone = Search(GRID, Settings.model_validate({"sensor": {"cell_m": CELL_M}}))
    asyncio.run(alone.decide(SearchState(alone.grid.start), [], now=NOW))
    assert alone.common.others.searchers == ()


def test_a_row_of_one_of_several_has_its_name_and_that_of_the_only_one_has_none() -> None:
    row = ModeRow("AUTO", commanded=True)
    assert as_json(row) == '{"mode": "AUTO", "commanded": true}'
    assert of_aircraft(row, "") is row
    named = of_aircraft(CommandRow("hold"), "south")
    assert (named.kind, named.body()) == ("command", {"command": "hold", "aircraft": "south"})
