"""The planners that look one trip ahead agree with their obvious twins."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given, settings

from roisearch import Belief, Decision, FieldOfView, SearchState, make_planner
from roisearch.decision import AHEAD
from roisearch.fov import HEADINGS, MOVES
from tests.roisearch import naive
from tests.roisearch.strategies import World, worlds

POINT = (FieldOfView.point(),)


def decide(name: str, world: World, **options: object) -> Decision:
    planner = make_planner(name, fov=world.fov, flyable=world.flyable, **options)
    return planner.plan(Belief(world.prior), SearchState(world.start), np.random.default_rng(0))


def last_look(world: World, decision: Decision) -> set[tuple[int, int]]:
    """What is seen at the end of the path."""
    before, end = ([world.start, *decision.path])[-2:]
    heading = HEADINGS[MOVES.index((end[0] - before[0], end[1] - before[1]))]
    return {(int(r), int(c)) for r, c in world.fov.cells(end, heading, world.prior.shape)}


@given(worlds())
@settings(max_examples=50, deadline=None)
def test_index_goes_to_the_best_mass_for_its_distance(world: World) -> None:
    best = naive.index_score(world.prior, world.start, world.flyable, world.fov, 2.5)
    assume(best > 0.0)
    decision = decide("index", world)
    assert decision.value == pytest.approx(best, rel=1e-9)
    assume(len(decision.path) < AHEAD)
    scores = [world.prior[cell] ** 2.5 / len(decision.path) for cell in last_look(world, decision)]
    assert max(scores) == pytest.approx(best, rel=1e-9)


@given(worlds(sensors=POINT))
@settings(max_examples=50, deadline=None)
def test_greedy_goes_to_the_most_probable_cell_within_its_horizon(world: World) -> None:
    decision = decide("greedy", world, horizon=4)
    best, steps = naive.greedy_value(world.prior / world.prior.sum(), world.start, world.flyable, 4)
    assert decision.value == pytest.approx(best, rel=1e-9)
    assert len(decision.path) == steps


def test_direct_policy_search_without_chance_is_one_greedy_walk() -> None:
    prior = np.arange(1.0, 26.0).reshape(5, 5)
    world = World(prior / prior.sum(), np.ones((5, 5), dtype=bool), (0, 0), FieldOfView.point())
    path = decide("direct-policy-search", world, epsilon=0.0, horizon=8, rollouts=1).path
    assert path == ((1, 0), (2, 0), (3, 0), (4, 0), (4, 1), (4, 2), (4, 3), (4, 4))


def test_coverage_enters_every_cell_once_on_open_ground() -> None:
    planner = make_planner("coverage", fov=FieldOfView.point())
    belief, cell = Belief(np.ones((6, 7))), (0, 0)
    entered = [cell]
    for _ in range(41):
        cell = planner.plan(belief, SearchState(cell), np.random.default_rng(0)).path[0]
        entered.append(cell)
    assert len(set(entered)) == 42


def test_spiral_rings_grow_around_the_peak() -> None:
    prior = np.ones((9, 9))
    prior[4, 4] = 2.0
    planner = make_planner("spiral", fov=FieldOfView.point())
    belief, cell = Belief(prior), (4, 4)
    rings = []
    for _ in range(80):
        cell = planner.plan(belief, SearchState(cell), np.random.default_rng(0)).path[0]
        rings.append(max(abs(cell[0] - 4), abs(cell[1] - 4)))
    assert rings == sorted(rings)
    assert rings[-1] == 4


def test_patterns_turn_to_a_cell_that_became_likely() -> None:
    planner = make_planner("coverage", fov=FieldOfView.point())
    belief = Belief(np.ones((6, 6)))
    belief.observe([(5, 5), (5, 5)], [True, True], 0.9, 0.9)
    decision = planner.plan(belief, SearchState((0, 0)), np.random.default_rng(0))
    assert decision.action == "look again"
    assert decision.path[-1] == (5, 5)
