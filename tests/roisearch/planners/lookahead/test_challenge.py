"""Challengers of the plan: they keep the steps being flown, are worth what is said of them, and win when better."""

from __future__ import annotations

import numpy as np
import pytest

from roisearch import Belief, FieldOfView, SearchState
from roisearch.planners.lookahead import plans
from roisearch.planners.lookahead.challenge import LEAVES
from roisearch.planners.lookahead.planner import LookaheadPlanner
from roisearch.planners.lookahead.settings import LookaheadSettings
from roisearch.planners.lookahead.thinking import Thinking

from .test_planner import after, hill
from .thought import thought

POINT = FieldOfView.point()
HILLS = sum(
    height * hill((90, 90), place, width)
    for height, place, width in [
        (1.0, (12, 70), 5.0), (0.9, (70, 15), 6.0), (0.8, (75, 75), 4.0), (1.0, (40, 35), 3.0), (0.7, (15, 20), 4.0)
    ]
)  # fmt: skip


def restless(**more: int | float) -> LookaheadPlanner:
    options = {"iterations": 30, "patience": 10, "restarts": 50, "horizon": 700} | more
    return LookaheadPlanner(LookaheadSettings(**options), fov=POINT)  # type: ignore[arg-type]


def both(planner: LookaheadPlanner) -> tuple[plans.PlanTree, plans.PlanTree]:
    return planner.thinking.tree, planner.thinking.challenger.tree


def worth(planner: LookaheadPlanner, tree: plans.PlanTree) -> float:
    return plans.evaluate(planner.pose, tree, planner.thinking.desk)


@pytest.mark.parametrize(("p_tn", "horizon"), [(1.0, 600), (0.98, 300)])
def test_a_challenger_keeps_the_next_steps_and_is_worth_what_is_said_of_it(p_tn: float, horizon: int) -> None:
    belief, rng, noise = Belief(HILLS), np.random.default_rng(0), np.random.default_rng(1)
    planner, state = restless(horizon=horizon), SearchState((5, 5))
    seen = left_plan = 0
    for _ in range(700):  # the flown part of the path is forgotten once or twice
        state = after(state, planner.plan(belief, state, rng).path[0])
        plan, other = both(planner)
        now = int(plan.mark[plans.NOW])
        assert worth(planner, plan) == pytest.approx(plan.value[plans.EXPECTED], rel=1e-7)
        if planner.thinking.challenger.is_open:
            seen += 1
            leaves = planner.thinking.challenger.leaves
            assert now < leaves <= now + LEAVES[1]
            np.testing.assert_array_equal(other.path[now:leaves], plan.path[now:leaves])
            left_plan += not np.array_equal(other.path[now : now + 300], plan.path[now : now + 300])
            assert other.mark[plans.NOW] == now
            assert other.value[plans.UNDETECTED] == plan.value[plans.UNDETECTED]
            assert worth(planner, other) == pytest.approx(other.value[plans.EXPECTED], rel=1e-7)
        belief.observe([state.cell], bool(noise.random() > p_tn), 0.9, p_tn)
    assert seen > 100
    assert left_plan > 10


def test_from_one_place_the_plan_only_gets_better_and_then_rests() -> None:
    belief, rng = Belief(HILLS), np.random.default_rng(2)
    planner, state = restless(restarts=8, iterations=60), SearchState((5, 5))
    planner.plan(belief, state, rng)
    values, won = [float(planner.thinking.tree.value[plans.EXPECTED])], 0
    for _ in range(600):
        before, length = planner.thinking.tree, len(values)
        decision = planner.plan(belief, state, rng)
        values.append(float(planner.thinking.tree.value[plans.EXPECTED]))
        won += planner.thinking.tree is not before
        if decision.effort.iterations == 0:
            break
    assert 1 < length < 600
    assert won > 0
    assert (np.diff(values) <= 0.0).all()
    assert planner.thinking.challenger.lost == 8
    assert not planner.thinking.challenger.is_open


def test_nothing_before_the_held_place_is_tried() -> None:
    begun, hold = thought(HILLS, POINT, (5, 5), horizon=700), 150
    tree = begun.tree
    first = tree.path[:hold].copy()
    before = float(tree.value[plans.EXPECTED])
    better = [plans.iterate(begun.pose, tree, begun.desk, hold) for _ in range(300)]
    assert any(better)
    assert tree.value[plans.EXPECTED] < before
    np.testing.assert_array_equal(tree.path[:hold], first)
    held = tree.stats[: tree.mark[plans.NODES]][tree.at[: tree.mark[plans.NODES]] < hold]
    assert held[:, :-1, plans.N_A].sum() == 0


def test_a_hit_forgets_the_challenger() -> None:
    belief, rng, state = Belief(HILLS), np.random.default_rng(4), SearchState((5, 5))
    planner = restless()
    for _ in range(200):
        state = after(state, planner.plan(belief, state, rng).path[0])
        belief.observe([state.cell], False, 0.9, 0.98)
        if planner.thinking.challenger.is_open:
            break
    assert planner.thinking.challenger.is_open
    planner.thinking.challenger.lost = 3
    belief.observe([state.cell], True, 0.9, 0.98)
    assert planner.plan(belief, state, rng, deadline_s=0.0).effort.iterations == 0
    assert not planner.thinking.challenger.is_open
    assert planner.thinking.challenger.lost == 0


def test_who_wins_keeps_what_was_thought_of_the_other_actions() -> None:
    belief, rng, state = Belief(HILLS), np.random.default_rng(2), SearchState((5, 5))
    planner = restless(restarts=20, iterations=10)
    planner.plan(belief, state, rng)
    for _ in range(600):
        before, visits = planner.thinking.tree, planner.thinking.tree.stats[0, :, plans.N_A].copy()
        planner.plan(belief, state, rng)
        if planner.thinking.tree is not before:
            break
    assert planner.thinking.tree is not before
    assert visits[4:-1].sum() > 0
    assert (planner.thinking.tree.stats[0, :, plans.N_A] >= visits).all()


@pytest.mark.parametrize("fov", [POINT, FieldOfView.donut()])
def test_who_wins_is_thought_about_further(fov: FieldOfView) -> None:
    begun = thought(HILLS, fov, (5, 5), patience=10, horizon=200)
    thinking = Thinking(begun.tree, begun.desk, begun.settings, anneals=fov.is_point)
    thinking.stale, thinking.rough = 10, False
    thinking.iterate(begun.pose)
    winner = thinking.challenger.tree
    winner.value[plans.EXPECTED] *= 0.5
    while thinking.challenger.is_open:
        thinking.iterate(begun.pose)
    assert thinking.tree is winner
    assert (thinking.stale, thinking.rough) == ((10, True) if fov.is_point else (0, False))
