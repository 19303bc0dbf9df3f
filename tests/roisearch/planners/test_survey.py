"""Lawnmowers cover what is wanted in any shape; the survey goes back to what is reported and resumes after."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.typing import NDArray

from roisearch import Belief, FieldOfView, Motion, SearchState, make_planner
from roisearch.directions import direction_between, direction_index, moves_allowed
from roisearch.planners.lanes import CORNERS, lanes_over, lawnmower, lawnmowers
from roisearch.planners.ways import Ways
from roisearch.watch import LOOKED

MASKS = hnp.arrays(np.bool_, hnp.array_shapes(min_dims=2, max_dims=2, max_side=9))
MOTION = Motion(cell_m=25.0)


@settings(deadline=None, max_examples=80)
@given(MASKS, st.booleans(), st.sampled_from(CORNERS))
def test_a_lawnmower_enters_every_wanted_cell_once(
    wanted: NDArray[np.bool_], turned: bool, corner: tuple[bool, bool]
) -> None:
    order = lawnmower(wanted, np.ones_like(wanted), turned, corner)
    assert sorted(order.tolist()) == np.flatnonzero(wanted).tolist()


@settings(deadline=None, max_examples=80)
@given(MASKS, st.sampled_from([2, 3, 5]), st.data())
def test_with_a_wide_view_all_that_is_wanted_is_seen_from_the_lanes(
    flyable: NDArray[np.bool_], swath: int, data: st.DataObject
) -> None:
    """Where the middle of a swath was not flyable, what lies beside it was never seen."""
    wanted = data.draw(hnp.arrays(np.bool_, flyable.shape))
    flown, half = lanes_over(wanted, flyable, swath), (swath - 1) // 2
    assert not (flown & ~flyable).any()
    for row, col in np.argwhere(wanted).tolist():
        near = slice(max(0, row - (swath - 1 - half)), row + half + 1)
        assert flown[near, col].any() or not flyable[near, col].any()


@pytest.mark.parametrize("swath", [1, 2, 3, 4, 5])
def test_over_open_ground_there_is_a_lane_a_swath(swath: int) -> None:
    everywhere = np.ones((12, 4), dtype=bool)
    assert lanes_over(everywhere, everywhere, swath).any(axis=1).sum() == -(-12 // swath)


def test_lanes_of_an_open_area_follow_each_other_without_a_jump() -> None:
    for order in lawnmowers(np.ones((6, 9), dtype=bool), np.ones((6, 9), dtype=bool)):
        rows, cols = np.divmod(order, 9)
        assert (np.abs(np.diff(rows)) + np.abs(np.diff(cols)) == 1).all()


def test_the_arm_of_a_concave_area_is_finished_before_the_other_is_begun() -> None:
    horseshoe = np.ones((8, 9), dtype=bool)
    horseshoe[:6, 3:6] = False
    order = lawnmower(horseshoe, horseshoe, False, (False, False))
    rows, cols = np.divmod(order, 9)
    jumps = np.maximum(np.abs(np.diff(rows)), np.abs(np.diff(cols))) > 1
    assert jumps.sum() <= 1
    assert (cols[:18] < 3).all()


@settings(deadline=None, max_examples=40)
@given(MASKS, st.data())
def test_ways_keep_to_flyable_ground_and_cut_no_corner(
    flyable: NDArray[np.bool_], data: st.DataObject
) -> None:
    cells = np.flatnonzero(flyable).tolist()
    if not cells:
        return
    here, there = data.draw(st.sampled_from(cells)), data.draw(st.sampled_from(cells))
    ways = Ways(flyable, diagonal=True)
    path = [here, *ways.way(here, there)]
    allowed = moves_allowed(flyable)
    cols = flyable.shape[1]
    for a, b in itertools.pairwise(path):
        direction = direction_between(divmod(a, cols), divmod(b, cols))
        assert allowed[divmod(a, cols)] >> direction_index(direction) & 1
    if path[-1] != there:
        assert not ways.is_open


def flown(prior: NDArray[np.float64], steps: int, hits: dict[int, tuple[int, int]]) -> list[tuple[int, int]]:
    """The cells that `survey` enters; at a step in `hits`, that cell is reported if it is seen."""
    fov = FieldOfView.point(0.9, 0.99)
    planner, belief = make_planner("survey", fov=fov, motion=MOTION), Belief(prior)
    state, path = SearchState((0, 0)), []
    for step in range(steps):
        cell = planner.plan(belief, state, np.random.default_rng(0)).path[0]
        state = SearchState(cell, direction_between(state.cell, cell), 8.0)
        path.append(cell)
        belief.observe([cell], hits.get(step) == cell, 0.9, 0.99)
    return path


def test_the_lines_run_along_the_longer_side() -> None:
    path = flown(np.ones((4, 12)), 11, {})
    assert path == [(0, col) for col in range(1, 12)]


@pytest.mark.parametrize("heed", [2, 3, 5])
def test_it_goes_on_after_as_much_of_its_path_as_was_flown(heed: int) -> None:
    undisturbed = flown(np.ones((5, 8)), 30, {})
    fov = FieldOfView.point(0.9, 0.99)
    planner, belief = make_planner("survey", fov=fov, motion=MOTION), Belief(np.ones((5, 8)))
    state, path = SearchState((0, 0)), []
    while len(path) < 30:
        for cell in planner.plan(belief, state, np.random.default_rng(0)).path[:heed]:
            state = SearchState(cell, direction_between(state.cell, cell), 8.0)
            path.append(cell)
            belief.observe([cell], False, 0.9, 0.99)
    assert path[:30] == undisturbed


def test_it_goes_back_to_what_is_reported_and_resumes() -> None:
    undisturbed = flown(np.ones((5, 8)), 20, {})
    reported = undisturbed[9]
    path = flown(np.ones((5, 8)), 40, {9: reported})
    assert path[:10] == undisturbed[:10]
    assert path[11] == reported  # at once
    assert path[13] == reported  # until two misses outweigh the hit
    assert path.count(reported) == 3
    rest = path[14:]
    assert set(undisturbed[10:]) <= set(rest)


def test_a_survey_that_takes_over_knows_what_was_reported_before() -> None:
    """On the next battery, or over other ground, it left the reported place out: that had been looked at."""
    fov = FieldOfView.point(0.9, 0.99)
    belief, rng = Belief(np.ones((12, 12))), np.random.default_rng(0)
    belief.follow(LOOKED)
    belief.observe([(5, 5)], True, 0.9, 0.99)
    planner, path = make_planner("survey", fov=fov, motion=MOTION), []
    state = SearchState((0, 0), "east")
    for _ in range(12):
        decision = planner.plan(belief, state, rng)
        path.append(decision.path[0])
        state = SearchState(path[-1], direction_between(state.cell, path[-1]))
        belief.observe([path[-1]], path[-1] == (5, 5), 0.9, 0.99)
    assert (5, 5) in path[:5]


def test_a_survey_that_takes_over_goes_on_where_the_last_one_stopped() -> None:
    fov = FieldOfView.point(0.9, 0.99)
    prior = np.ones((12, 12))
    prior[:6] = 20.0  # where it is searched, more is left than where it is not
    belief, rng, state = Belief(prior), np.random.default_rng(0), SearchState((0, 0), "east")
    first = make_planner("survey", fov=fov, motion=MOTION)
    for _ in range(70):
        cell = first.plan(belief, state, rng).path[0]
        state = SearchState(cell, direction_between(state.cell, cell))
        belief.observe([cell], False, 0.9, 0.99)
    seen, state = belief.follow(LOOKED).looked(), SearchState((0, 0), "east")
    second, fresh = make_planner("survey", fov=fov, motion=MOTION), 0
    for _ in range(70):
        cell = second.plan(belief, state, rng).path[0]
        fresh += not seen[cell[0] * 12 + cell[1]]
        state = SearchState(cell, direction_between(state.cell, cell))
    assert fresh > 50  # the rest is the way there
