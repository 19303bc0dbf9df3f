"""A detector that is worse than the settings say finds nothing without a person."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from roisearch import SearchState
from roisearch.directions import direction_between
from service.area import build_grid, read_area
from service.config import Settings
from service.evidence.alarms import Alarms
from service.evidence.observe import Observation
from service.evidence.verdict import verdict_on
from service.known import Judgement
from service.search import Search
from tests.integration.flight import write_area
from tests.service.mission.flown import GRID
from tests.service.test_search import search as planned

PLACE = (5, 5)


def look(cell: tuple[int, int], *, hit: bool, first: bool = True, p_tn: float = 0.9) -> Observation:
    return Observation(
        np.array([cell]), np.array([hit]), np.array([0.9]), np.array([p_tn]), np.array([first])
    )


def seen(share: float, cells: int, seed: int = 1) -> Alarms:
    """Cells far from the place, of which a share has a hit."""
    alarms, rng = Alarms(0.9, 0.9), np.random.default_rng(seed)
    for number in range(cells):
        alarms.add(look((20 + number // 40, number % 40), hit=bool(rng.random() < share)))
    return alarms


def test_a_detector_that_sees_the_target_everywhere_is_not_trusted_after_a_few_cells() -> None:
    assert "in 6 of 6 cells elsewhere" in seen(1.0, 6).why_not(PLACE)
    assert "in 2 of 2 cells elsewhere" in seen(1.0, 2).why_not(PLACE)
    assert "a person has to confirm" in seen(0.4, 60).why_not(PLACE)


def test_a_detector_that_is_as_good_as_it_is_said_to_be_is_trusted() -> None:
    doubts = [bool(seen(0.1, cells, seed).why_not(PLACE)) for seed in range(100) for cells in (5, 50, 200)]
    assert sum(doubts) <= 0.02 * len(doubts)
    assert seen(0.0, 50).why_not(PLACE) == ""


def test_a_share_that_is_unlikely_by_chance_and_not_far_from_what_is_said_is_no_doubt() -> None:
    """It waited for a person for fifty batteries: 16 of 807 cells, for 8."""
    alarms = Alarms(0.9, 0.99)
    for number in range(807):
        alarms.add(look((20 + number // 40, number % 40), hit=number % 50 == 0 and number < 800, p_tn=0.99))
    assert alarms.why_not(PLACE) == ""
    for number in range(20):
        alarms.add(look((60, number), hit=True, p_tn=0.99))
    assert "in 36 of 827 cells elsewhere, where p_tn = 0.99 lets expect 8" in alarms.why_not(PLACE)


def test_hits_at_the_place_itself_and_again_on_the_same_stone_are_no_false_alarms_more() -> None:
    alarms = seen(0.0, 30)
    for cell in ((4, 4), (5, 5), (6, 6)):
        alarms.add(look(cell, hit=True))
    for _ in range(50):
        alarms.add(look((30, 30), hit=True))
    assert alarms.why_not(PLACE) == ""
    assert Alarms(0.9, 0.9).why_not(PLACE) == ""


def test_a_miss_that_turns_into_a_hit_in_its_first_pass_counts_and_a_later_pass_does_not() -> None:
    later, turned = Alarms(0.9, 0.9), Alarms(0.9, 0.9)
    for number in range(8):
        for alarms in (later, turned):
            alarms.add(look((20, number), hit=False))
        later.add(look((20, number), hit=True))
        turned.add(look((20, number), hit=True, first=False))
    assert later.why_not(PLACE) == ""
    assert turned.why_not(PLACE)


@pytest.fixture
def search(tmp_path: Path) -> Search:
    settings = Settings.model_validate({"sensor": {"cell_m": 10.0}, "search": {"planner": "index"}})
    return Search(build_grid(read_area(write_area(tmp_path)), 10.0), settings)


def test_what_a_detector_finds_that_cries_everywhere_waits_for_a_person(search: Search) -> None:
    certain = look((3, 3), hit=True, p_tn=1.0 - 1e-9)
    for col in range(8):
        search.take(look((10, col), hit=True))
    search.take(certain)
    assert search.place.probability > search.settings.search.found_at
    assert search.found() is None
    assert "a person has to confirm" in search.doubt()
    verdict = verdict_on((3, 3), search.grid.frame.shape, 0.99, confirmed=True)
    search.take(Judgement((3, 3), verdict, confirmed=True))
    assert search.found() is not None
    assert search.doubt() == ""


def test_a_detector_that_cries_in_every_frame_finds_nothing_by_itself() -> None:
    """It made a place sure when three cells elsewhere had been seen, after 106 s."""
    built, rng = planned(iterations=3), np.random.default_rng(3)
    state, sure = SearchState(GRID.start), 0
    for _ in range(60):
        cell = built.planner.plan(built.belief, state, rng).path[0]  # no clock: the same path each time
        state = SearchState(cell, direction_between(state.cell, cell))
        built.take(look(cell, hit=True))
        sure += built.place.probability > built.settings.search.found_at
        assert built.found() is None
    assert sure


def test_the_same_find_by_a_trusted_detector_is_found(search: Search) -> None:
    for col in range(8):
        search.take(look((10, col), hit=False))
    search.take(look((3, 3), hit=True, p_tn=1.0 - 1e-9))
    assert search.found() is not None
