"""Annealing the order of looks: sums against a plain walk along the row, and what becomes of a plan."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from roisearch import Belief, FieldOfView, SearchState
from roisearch.planners.lookahead import order, plans
from roisearch.planners.lookahead.anneal import Annealer, make_looks
from roisearch.planners.lookahead.order import Looks
from roisearch.planners.lookahead.planner import LookaheadPlanner
from roisearch.planners.lookahead.settings import LookaheadSettings
from roisearch.planners.lookahead.thinking import AHEAD, SOON
from sim.scenario import paper_prior

from .test_planner import after, hill
from .thought import Thought, thought

POINT = FieldOfView.point()
PRIOR = paper_prior(np.random.default_rng(1001))
WALLS = np.ones(PRIOR.shape, dtype=bool)
WALLS[60:140, 100] = WALLS[100, 20:90] = False
HORIZON = 2500
MAPS = {"open": None, "walls": WALLS}
HOLD = 40


def begun(name: str) -> Thought:
    """A plan of HORIZON steps by the rollout's rule."""
    return thought(PRIOR, POINT, (5, 5), MAPS[name], horizon=HORIZON)


@cache
def begun_once(name: str) -> Thought:
    return begun(name)


def row_of(plan: Thought) -> tuple[Looks, int, float]:
    """The plan's looks from HOLD on."""
    looks = make_looks(plan.chart, HORIZON + 2)
    n, whole = order.line_up(plan.pose, plan.tree, plan.desk, HOLD, looks)
    return looks, n, whole


def steps_between(a: int, b: int, looks: Looks) -> int:
    """By walking the two ways with one bend."""
    start, end = (looks.row[a], looks.col[a]), (looks.row[b], looks.col[b])
    if start == end:
        return 2
    steps = abs(end[0] - start[0]) + abs(end[1] - start[1])
    if looks.is_open:
        return int(steps)
    open_cells = looks.legal.reshape(looks.rows, looks.cols) > 0
    rows = slice(min(start[0], end[0]), max(start[0], end[0]) + 1)
    cols = slice(min(start[1], end[1]), max(start[1], end[1]) + 1)
    one = open_cells[rows, start[1]].all() and open_cells[end[0], cols].all()
    other = open_cells[start[0], cols].all() and open_cells[rows, end[1]].all()
    return int(steps) if steps <= order.WAY and (one or other) else order.FAR


def expected_time(looks: Looks, n: int, whole: float) -> float:
    """Of the row, look by look; what is not detected waits until the end."""
    step, total, left = 0, 0.0, whole
    for place in range(1, n):
        step += steps_between(place - 1, place, looks)
        total += looks.worth[place] * step
        left -= looks.worth[place]
    return float(total + left * step)


@given(
    st.sampled_from(sorted(MAPS)),
    st.lists(st.tuples(st.integers(0, 3), *[st.integers(0, 10**6)] * 3), max_size=6),
)
@settings(max_examples=30, deadline=None)
def test_the_sums_tell_what_a_move_changes(name: str, moves: list[tuple[int, int, int, int]]) -> None:
    looks, n, whole = row_of(begun_once(name))
    before = expected_time(looks, n, whole)
    for kind, a, b, c in moves:
        first = 1 + a % (n - 2)
        if kind == 0:
            last, to, turned = first + b % (n - first), first - 1, True
            told = order.delay_of_turn(first, last, n, whole, looks)
        else:
            last = min(n - 2, first + b % 60)
            to = c % n
            if first - 1 <= to <= last:
                continue
            turned = kind == 2
            told = order.delay_of_shift(first, last, to, turned, n, whole, looks)
        order.rearrange(first, last, to, turned, n, looks)
        now = expected_time(looks, n, whole)
        assert told == pytest.approx(now - before, rel=1e-9, abs=1e-9 * before)
        before = now
    step = np.concatenate([[0], np.cumsum([steps_between(i - 1, i, looks) for i in range(1, n)])])
    np.testing.assert_allclose(looks.step[:n], step)
    np.testing.assert_allclose(looks.worths[:n], np.cumsum(looks.worth[:n]), rtol=1e-9)
    np.testing.assert_allclose(looks.moments[:n], np.cumsum(looks.worth[:n] * step), rtol=1e-9)
    assert sorted(looks.number[:n]) == list(range(n))
    np.testing.assert_array_equal(looks.place[looks.number[:n]], np.arange(n))


def test_a_row_is_the_plan_with_what_each_look_detects() -> None:
    plan = begun_once("open")
    looks, n, whole = row_of(plan)
    mass, tree = plan.chart.mass.copy(), plan.tree
    for cell in tree.path[:HOLD]:
        mass[cell] *= 1.0 - 0.9
    assert whole == pytest.approx(mass.sum(), rel=1e-9)
    for place, cell in enumerate(tree.path[HOLD : tree.mark[plans.LENGTH]], start=1):
        assert (looks.row[place], looks.col[place]) == divmod(cell, looks.cols)
        assert looks.worth[place] == pytest.approx(0.9 * mass[cell])
        mass[cell] *= 1.0 - 0.9
    assert place == n - 1


def test_neighbours_are_the_looks_around() -> None:
    looks, n, _ = row_of(begun_once("walls"))
    apart = np.maximum(
        np.abs(looks.row[:n, None] - looks.row[None, :n]), np.abs(looks.col[:n, None] - looks.col[None, :n])
    )
    for look in range(n):
        near = looks.near[look, : looks.nears[look]].tolist()
        around = set(np.flatnonzero(apart[look] <= 1).tolist()) - {0, look}
        assert set(near) == around if len(around) < order.NEAR else set(near) < around
        steps = [abs(looks.row[i] - looks.row[look]) + abs(looks.col[i] - looks.col[look]) for i in near]
        assert [s == 1 for s in steps] == [i < looks.besides[look] for i in range(len(near))]
    assert not looks.last.any()


@pytest.mark.parametrize("name", sorted(MAPS))
def test_annealing_shortens_the_expected_time_by_what_it_says(name: str) -> None:
    looks, n, whole = row_of(begun_once(name))
    before = expected_time(looks, n, whole)
    delay = order.anneal(n, whole, looks, np.array([7], dtype=np.uint64), 400_000, 0.05, 0.001)
    assert delay < -0.003 * before
    assert expected_time(looks, n, whole) == pytest.approx(before + delay, rel=1e-9)


@pytest.mark.parametrize("name", sorted(MAPS))
def test_what_is_proposed_is_likely_to_be_taken(name: str) -> None:
    """Moves of any kind are legal, and told rightly: joins at the wrong ends would only gain less in the same time."""
    gains = []
    for seed in range(20):
        looks, n, whole = row_of(begun_once(name))
        before = expected_time(looks, n, whole)
        gains.append(
            -order.anneal(n, whole, looks, np.array([seed], dtype=np.uint64), 400_000, 0.05, 0.001) / before
        )
    assert np.mean(gains) > 0.008


def test_a_hot_row_gets_worse_and_a_cold_one_never() -> None:
    looks, n, whole = row_of(begun_once("open"))
    random = np.array([7], dtype=np.uint64)
    before = expected_time(looks, n, whole)
    assert order.anneal(n, whole, looks, random, 30_000, 20.0, 10.0) > 0.0
    worst = expected_time(looks, n, whole)
    assert worst > before
    assert all(order.anneal(n, whole, looks, random, 2_000, 1e-12, 1e-12) <= 0.0 for _ in range(50))
    assert expected_time(looks, n, whole) < worst


def test_where_nothing_is_left_to_detect_no_delay_is_cheap() -> None:
    looks, n, _ = row_of(begun_once("open"))
    whole = float(looks.worths[n - 1]) * (1.0 - 1e-12)  # as rounding may leave it for a perfect detector
    random = np.array([7], dtype=np.uint64)
    assert all(order.anneal(n, whole, looks, random, 2_000, 1e-12, 1e-12) <= 0.0 for _ in range(50))


@pytest.mark.parametrize("name", sorted(MAPS))
def test_a_laid_row_is_flyable_and_worth_at_least_what_its_sums_say(name: str) -> None:
    plan = begun(name)
    tree, annealer = plan.tree, Annealer(HORIZON, plan.desk)
    held, before = tree.path[:HOLD].copy(), float(tree.value[plans.EXPECTED])
    annealer.begin(plan.pose, tree, HOLD, 40, 0.05)
    while not annealer.go_on(tree):
        assert annealer.is_open
    assert annealer.end(plan.pose, tree)
    assert not annealer.is_open
    assert tree.value[plans.EXPECTED] < 0.998 * before
    assert plans.evaluate(plan.pose, tree, plan.desk) == pytest.approx(tree.value[plans.EXPECTED], rel=1e-9)
    np.testing.assert_array_equal(tree.path[:HOLD], held)
    assert tree.mark[plans.LENGTH] == HORIZON
    cells = np.stack(np.divmod(np.concatenate([[5 * 200 + 5], tree.path[:HORIZON]]), 200), axis=1)
    assert (np.abs(np.diff(cells, axis=0)).sum(axis=1) == 1).all()
    if name == "walls":
        assert WALLS[cells[:, 0], cells[:, 1]].all()


def test_a_row_that_is_no_better_leaves_the_plan_alone() -> None:
    plan = begun("open")
    tree = plan.tree
    path, value = tree.path.copy(), tree.value.copy()
    looks, n, whole = row_of(plan)
    order.anneal(n, whole, looks, plan.desk.random, 20_000, 20.0, 20.0)
    assert not order.lay(plan.pose, n, looks, tree, plan.desk, HOLD)
    np.testing.assert_array_equal(tree.path, path)
    np.testing.assert_array_equal(tree.value, value)


def test_rounds_begin_further_and_further_ahead_and_are_over_when_the_drone_is_there() -> None:
    belief, rng, state = Belief(PRIOR), np.random.default_rng(0), SearchState((5, 5))
    planner = LookaheadPlanner(LookaheadSettings(iterations=3, patience=1, horizon=700), fov=POINT)
    ahead: dict[int, int] = {}
    made: dict[int, int] = {}
    for _ in range(2 * AHEAD):
        state = after(state, planner.plan(belief, state, rng).path[0])
        belief.observe([state.cell], False, 0.9, 1.0)
        thinking = planner.thinking
        annealer = thinking.annealer
        assert annealer is not None
        if thinking.rough and annealer.is_open:
            ahead.setdefault(annealer.hold, annealer.hold - int(planner.thinking.tree.mark[plans.NOW]))
            made[annealer.hold] = annealer.made
        if made and not thinking.rough:
            break
    assert not planner.thinking.rough
    assert list(ahead.values()) == [SOON, 2 * SOON, 4 * SOON]
    for steps, iterations in zip(ahead.values(), made.values(), strict=True):
        assert 3 * steps - 9 < iterations < 3 * steps  # far from the most that a round may have


def test_a_wider_view_is_not_annealed() -> None:
    planner = LookaheadPlanner(
        LookaheadSettings(iterations=30, patience=5, horizon=200), fov=FieldOfView.donut()
    )
    planner.plan(Belief(hill((40, 40), (20, 25), 4.0)), SearchState((5, 5)), np.random.default_rng(0))
    assert planner.thinking.annealer is None
    assert not planner.thinking.rough
