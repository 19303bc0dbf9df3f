"""What is known of a target that walks: each word at its own time, late or not, and the same again from a journal."""

from __future__ import annotations

import asyncio
import dataclasses
import json
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from roisearch import SearchState
from service.area import Grid, build_grid, parse_area
from service.config import Settings
from service.evidence.observe import Observation
from service.known import KEPT_EVERY_S, Known, Said, Withdrawn
from service.news.bearing import FieldNews
from service.search import Search
from tests.integration.flight import FIELD


def field(target: dict[str, Any] | None) -> Grid:
    area: dict[str, Any] = json.loads(json.dumps(FIELD))
    area["features"][0]["properties"]["target"] = target
    return build_grid(parse_area(json.dumps(area).encode(), source="field"), 10.0)


WALKS = field({"moves": "walks", "speed_mps": 0.8, "stops_per_hour": 2})
STILL = field(None)
CELLS = np.argwhere(WALKS.searchable)
BEGIN = 1_700_000_000.0


HALF_OUTSIDE = dataclasses.replace(field(None), outside=0.5)


def look(number: int, *, hit: bool = False) -> Observation:
    at = CELLS[number * 7 % len(CELLS)].reshape(1, 2)
    return Observation(at, np.array([hit]), np.array([0.9]), np.array([0.95]), np.array([True]))


def told(words: list[tuple[float, Said]], grid: Grid = WALKS) -> Known:
    known = Known(grid, 0.9, 0.95)
    for time, said in words:
        known.take(said, time)
    return known


def looks(seconds: list[float]) -> list[tuple[float, Said]]:
    return [(BEGIN + time, look(number, hit=number % 9 == 4)) for number, time in enumerate(seconds)]


times = st.lists(st.integers(0, 1200), min_size=2, max_size=14, unique=True)


@given(times, st.data())
@settings(max_examples=40, deadline=None)
def test_what_comes_late_is_applied_at_its_own_time(seconds: list[int], data: st.DataObject) -> None:
    in_order = looks([float(each) for each in sorted(seconds)])
    as_it_came = data.draw(st.permutations(in_order))
    a, b = told(in_order), told(as_it_came)
    # within a tick looks are taken as they come, which rounds otherwise, and where all begins is the first word's
    if as_it_came[0] == in_order[0]:
        np.testing.assert_allclose(a.belief.probability(), b.belief.probability(), rtol=1e-9, atol=1e-15)
        np.testing.assert_allclose(a.record.pod(), b.record.pod(), rtol=1e-9, atol=1e-12)
    assert told(as_it_came).belief.digest() == b.belief.digest()


def test_a_report_that_is_minutes_late_leaves_what_it_would_have_left_in_time_to_the_last_bit() -> None:
    whole = looks([20.0 * each for each in range(1, 40)])
    late = (BEGIN + 333.0, look(5))
    in_time = told(sorted([*whole, late], key=lambda each: each[0]))
    for after in (20, 30, 39):  # from a kept state, and from the very first
        known = told([*whole[:after], late, *whole[after:]])
        assert known.belief.digest() == in_time.belief.digest()
        assert known.record.pos == pytest.approx(in_time.record.pos, abs=1e-12)
        assert known.alarms.why_not((0, 0)) == in_time.alarms.why_not((0, 0))
    assert told(whole).belief.digest() != in_time.belief.digest()
    assert told([*whole, (whole[-1][0], look(5))]).belief.digest() != in_time.belief.digest()


def test_states_kept_for_late_words_are_few() -> None:
    known = told(looks([10.0 * each for each in range(100)]))
    assert known.kept == 3
    assert known.time == BEGIN + 990.0
    assert KEPT_EVERY_S >= 10.0
    assert told(looks([1.0, 2.0, 300.0]), STILL).kept == 0


def test_time_means_nothing_where_the_target_stands_still() -> None:
    one, other = told(looks([1.0, 2.0, 900.0]), STILL), told(looks([900.0, 2.0, 1.0]), STILL)
    assert one.belief.digest() == other.belief.digest()
    assert one.time is None


def test_a_word_that_is_taken_back_leaves_no_trace_of_a_walk_either() -> None:
    news = FieldNews("a", "searched", "", (47.05, 8.3), CELLS[:50], np.full(50, 0.8))
    words = looks([10.0, 60.0, 110.0])
    with_it = told([*words[:2], (BEGIN + 80.0, news), words[2]])
    assert with_it.belief.digest() != told(words).belief.digest()
    with_it.take(Withdrawn("a"), BEGIN + 110.0)
    assert with_it.belief.digest() == told(words).belief.digest()


def test_searched_ground_fills_up_again_and_pod_falls_while_pos_stays() -> None:
    known = told([(BEGIN, look(3))])
    cell = tuple(look(3).cells[0])
    pod, pos, there = known.record.pod()[cell], known.record.pos, known.belief.mass_at([cell])[0]
    known.take(look(40), BEGIN + 300.0)
    assert known.record.pod()[cell] < 0.7 * pod
    assert pos <= known.record.pos < pos + 0.05
    assert known.belief.mass_at([cell])[0] > there


@pytest.mark.parametrize("grid", [WALKS, STILL])
def test_a_copy_goes_its_own_way(grid: Grid) -> None:
    known = told(looks([10.0, 60.0]), grid)
    before, twin = known.belief.digest(), known.copy()
    twin.take(look(8), BEGIN + 200.0)
    twin.take(look(9), BEGIN + 15.0)
    assert known.belief.digest() == before
    known.take(look(8), BEGIN + 200.0)
    known.take(look(9), BEGIN + 15.0)
    assert known.belief.digest() == twin.belief.digest()


def test_a_decision_is_made_for_where_the_target_may_be_by_then() -> None:
    search = Search(WALKS, Settings.model_validate({"sensor": {"cell_m": 10}}))
    planned: list[float] = []
    plan = search.planner.plan

    def noting(belief: Any, *rest: Any, **more: Any) -> Any:
        planned.append(float(belief.probability().max()))
        return plan(belief, *rest, **more)

    search.planner.plan = noting  # type: ignore[method-assign]
    search.take(look(0), BEGIN)
    before = search.belief.digest()
    for now in (BEGIN, BEGIN + 600.0, BEGIN - 5.0):
        asyncio.run(search.decide(SearchState(WALKS.start), [], now=now))
    assert planned[1] < 0.8 * planned[0] == 0.8 * planned[2]
    assert search.belief.digest() == before  # only a word of its time moves what is believed


def clue(number: int, factor: float, cells: list[int]) -> FieldNews:
    """A clue over some of the cells that are searched."""
    at = np.argwhere(HALF_OUTSIDE.searchable).astype(np.int64)[cells]
    return FieldNews(f"clue {number}", "clue", "", (47.0, 8.3), at, np.full(len(at), factor))


@settings(max_examples=30)
@given(
    st.lists(st.sampled_from([1e-3, 0.2, 5.0, 1e3]), min_size=1, max_size=6),
    st.integers(1, 60),
    st.sampled_from([1, 5, 10_000]),
)
def test_however_many_clues_leave_a_belief_that_is_one(factors: list[float], times: int, count: int) -> None:
    cells = list(range(int(HALF_OUTSIDE.searchable.sum())))[:count]
    known = Known(HALF_OUTSIDE, 0.9, 0.97)
    for number, factor in enumerate(factors * times):
        said = clue(number, factor, cells)
        known._field.append(said)  # not taken one after the other, as each has all of them reckoned anew
    known.take(clue(-1, factors[0], cells), 1000.0)
    there, outside = known.belief.probability(), known.belief.outside
    assert np.isfinite(there).all()
    assert float(there.sum()) + outside == pytest.approx(1.0)
    assert (there[HALF_OUTSIDE.searchable & (HALF_OUTSIDE.prior > 0.0)] > 0.0).all()
    odds = np.clip(np.log(factors).sum() * times + np.log(factors[0]), -25.0, 25.0)
    if count == 10_000:  # all that is searched
        assert outside == pytest.approx(1.0 / (1.0 + np.exp(odds)), rel=1e-6, abs=1e-10)
