"""The compiled search decides exactly as its twin in plain Python, over all models, sensors and obstacles."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from roisearch import Belief, FieldOfView, SearchState, make_planner, segment_regions
from roisearch.fov import HEADINGS, MOVES
from roisearch.planners.puct.presets import settings_for
from sim.twin import TwinBelief, TwinPlanner
from tests.roisearch.naive import distances
from tests.roisearch.strategies import World, worlds

MODELS = ("puct", "puct-regions", "puct-regions-lite")


def assert_same_decisions(name: str, preset: str, world: World, steps: int, **options: Any) -> None:
    options = {"iterations": 15, "rollout": 12, "goal": "peak", "commit": "never", **options}
    flyable = np.zeros_like(world.flyable)
    for cell in distances(world.start, world.flyable):
        flyable[cell] = True
    regions = segment_regions(world.prior)
    planner = make_planner(name, fov=world.fov, preset=preset, regions=regions, flyable=flyable, **options)
    twin = TwinPlanner(settings_for(name, preset, options), world.fov, regions, flyable)
    belief, twin_belief = Belief(world.prior, outside=0.1), TwinBelief(world.prior, outside=0.1)
    rng, twin_rng, world_rng = (np.random.default_rng(seed) for seed in (7, 7, 8))
    cell, heading = world.start, "north"
    for _ in range(steps):
        decision = planner.plan(belief, SearchState(cell, heading), rng)
        expected = twin.plan(twin_belief, cell, heading, twin_rng.bit_generator.random_raw())
        assert (decision.action, list(decision.path)) == expected
        near = decision.path[0]
        heading = HEADINGS[MOVES.index((near[0] - cell[0], near[1] - cell[1]))]
        cell = near
        seen = [(int(r), int(c)) for r, c in world.fov.cells(cell, heading, world.prior.shape)]
        if seen:
            hits = (world_rng.random(len(seen)) < 0.05).tolist()
            belief.observe(seen, hits, 0.9, 0.8)
            twin_belief.observe(seen, hits, [0.9] * len(seen), [0.8] * len(seen))
        assert belief.total == twin_belief.total


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("preset", ["paper", "reference", "default"])
@given(world=worlds())
@settings(max_examples=8, deadline=None)
def test_search_decides_as_its_plain_twin(name: str, preset: str, world: World) -> None:
    if (name, preset) == ("puct-regions-lite", "default"):
        name = "puct-regions"  # the default of lite is another solver, and has twins of its own
    assert_same_decisions(name, preset, world, 4)


@given(
    world=worlds(),
    backup=st.sampled_from(["mean", "max"]),
    choose=st.sampled_from(["visits", "value"]),
    prior=st.sampled_from(["uniform", "rewards", "index"]),
    rollout_policy=st.sampled_from(["random", "repeat", "steepest"]),
    option_reward=st.sampled_from(["density", "trip"]),
    fades=st.booleans(),
    elsewhere=st.booleans(),
    depth=st.integers(1, 5),
)
@settings(max_examples=40, deadline=None)
def test_every_setting_means_the_same_to_the_twin(world: World, **options: Any) -> None:
    assert_same_decisions("puct-regions-lite", "paper", world, 2, **options)


def test_a_deadline_stops_the_search_early_and_it_still_decides() -> None:
    planner = make_planner("puct-regions", fov=FieldOfView.point(), iterations=None)
    belief = Belief(np.random.default_rng(0).random((30, 30)))
    short = planner.plan(belief, SearchState((3, 3)), np.random.default_rng(0), deadline_s=0.0)
    long = planner.plan(belief, SearchState((3, 3)), np.random.default_rng(0), deadline_s=0.1)
    assert 0 < short.effort.iterations < long.effort.iterations
    assert len(short.path) > 0


def test_a_planner_without_iterations_asks_for_a_deadline() -> None:
    planner = make_planner("puct", fov=FieldOfView.point(), iterations=None)
    with pytest.raises(ValueError, match="deadline"):
        planner.plan(Belief(np.ones((5, 5))), SearchState((2, 2)), np.random.default_rng(0))


def test_alternatives_name_every_option_and_its_region() -> None:
    down, right = np.mgrid[0:30, 0:40]
    prior = np.exp(-((down - 8) ** 2 + (right - 8) ** 2) / 8) + np.exp(
        -((down - 20) ** 2 + (right - 30) ** 2) / 8
    )
    planner = make_planner("puct-regions-lite", fov=FieldOfView.point(), preset="paper")
    decision = planner.plan(Belief(prior), SearchState((15, 15)), np.random.default_rng(0))
    named = {one.action: one.region for one in decision.alternatives}
    assert named == {"north": None, "east": None, "south": None, "west": None, "region 1": 1, "region 2": 2}
    assert sum(one.visits for one in decision.alternatives) == decision.effort.iterations == 40


def test_a_committed_trip_is_flown_to_its_end_unless_a_hit_arrives() -> None:
    down, right = np.mgrid[0:30, 0:40]
    belief = Belief(np.exp(-((down - 20) ** 2 + (right - 30) ** 2) / 8) + 1e-9)
    planner = make_planner("puct-regions", fov=FieldOfView.point(), preset="paper", elsewhere=False)
    rng = np.random.default_rng(0)
    cell, first = (2, 2), planner.plan(belief, SearchState((2, 2)), rng)
    while not first.action.startswith("region"):
        cell = first.path[0]
        first = planner.plan(belief, SearchState(cell), rng)
    second = planner.plan(belief, SearchState(first.path[0]), rng)
    assert second.path == first.path[1:]
    assert second.effort.iterations == 0
    belief.observe([first.path[1]], [True], 0.9, 0.9)
    assert planner.plan(belief, SearchState(first.path[1]), rng).effort.iterations == 40
