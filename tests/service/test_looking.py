"""What a look is worth: cells of which none ever counts are given up, and what walks is looked at again at once."""

from __future__ import annotations

import asyncio
from dataclasses import replace

import numpy as np
import pytest

from roisearch import SearchState
from service.area.model import TargetMotion
from service.config import Settings
from service.evidence.observe import Observation, Sighting
from service.geometry import Cell
from service.looking import likely, passed, pays_to_hover, place_in_sight, worth_a_look
from service.search import Search
from tests.service.mission.flown import CELL_M, GRID
from tests.service.test_search import search


def hardly_a_look(cell: Cell) -> Observation:
    """A look at a cell that counts, and changes next to nothing."""
    vain, one = np.zeros(1, dtype=np.bool_), np.ones(1, dtype=np.bool_)
    return Observation(np.array([cell]), vain, np.full(1, 1e-6), np.full(1, 1.0 - 1e-9), one)


def flown_in_vain(built: Search, cell: Cell) -> list[str]:
    """What is said while it flies over a cell, of which no look counts, and its neighbour, of which all do."""
    said, beside = [], (cell[0], cell[1] + 1)
    for number in range(40):
        said.append(passed(built, cell, "north", 30.0 * number))
        said.append(passed(built, beside, "south", 30.0 * number + 15.0))
        built.take(hardly_a_look(beside))
    return [each for each in said if each]


def test_a_cell_of_which_no_look_counts_is_not_flown_to_for_ever() -> None:
    """The most likely cell under a cliff: seen to be circled over for five hours."""
    built = search()
    cell = built.place.cell
    before, enough = built.planner, built.enough
    (told,) = flown_in_vain(built, cell)
    assert "needs a ground team" in told
    assert built.planner is not before
    assert built.visibility is not None
    assert built.visibility[cell] == 0.0
    assert built.enough == pytest.approx(enough - built.settings.search.stop_at_pos * GRID.prior[cell])
    assert not place_in_sight(built)
    assert not worth_a_look(built, [cell])
    decision = asyncio.run(built.decide(SearchState(GRID.start), ()))
    assert decision.path
    seen = built.planner
    built.take(hardly_a_look(cell))
    assert built.planner is not seen
    assert built.visibility[cell] == 1.0
    assert built.enough == pytest.approx(enough)


def test_what_one_aircraft_gives_up_the_others_do_not_fly_to_either() -> None:
    first = search()
    second = first.beside("second", first.settings)
    cell = first.place.cell
    before = second.planner
    assert flown_in_vain(first, cell)
    assert second.planner is not before
    assert second.enough == first.enough < search().enough


def test_a_look_is_worth_it_by_the_probability_however_much_was_looked_at_in_vain() -> None:
    built = search()
    cells = np.argwhere(GRID.searchable)
    most = cells[np.argsort(built.belief.mass_at(cells))][len(cells) // 10 :]
    for _ in range(2):
        built.belief.observe(most, np.zeros(len(most), dtype=bool), 0.8, 0.99)
    assert built.belief.total < 0.3
    right = built.belief.probability()[cells[:, 0], cells[:, 1]] >= 1.0 / len(cells)
    np.testing.assert_array_equal(likely(built, cells), right)


def reported(built: Search, cell: Cell) -> None:
    """Something was reported at a cell."""
    lat, lon = built.grid.frame.to_latlon([cell])[0].tolist()
    one = np.ones(1, dtype=np.bool_)
    seen = (Sighting(lat, lon, None),)
    built.take(Observation(np.array([cell]), one, np.full(1, 0.9), np.full(1, 0.9), one, seen))


@pytest.mark.parametrize("walks", [True, False])
def test_it_pays_to_hover_at_once_where_something_was_seen_of_a_target_that_walks(walks: bool) -> None:
    settings = Settings.model_validate(
        {"sensor": {"cell_m": CELL_M, "hover_look_s": 8.0}, "search": {"iterations": 3, "looks_ahead": 500}}
    )
    built = Search(replace(GRID, target=TargetMotion(speed_mps=0.5)) if walks else GRID, settings)
    here, there = GRID.start, built.place.cell
    built.warm_up()
    assert not pays_to_hover(built, [here, there]), "nothing was decided yet, nor seen"
    asyncio.run(built.decide(SearchState(here), ()))
    reported(built, there)
    assert not pays_to_hover(built, [there]), "7 % of 200 s are not worth the 19 that it takes"
    reported(built, there)
    assert pays_to_hover(built, [here, there]) == walks
    assert not pays_to_hover(built, [here])
    assert not pays_to_hover(built, [])
    if walks:  # after looks in vain it is not worth the time any more
        vain, one = np.zeros(1, dtype=np.bool_), np.ones(1, dtype=np.bool_)
        for _ in range(4):
            built.take(Observation(np.array([there]), vain, np.full(1, 0.9), np.full(1, 0.9), one))
        assert not pays_to_hover(built, [there])
