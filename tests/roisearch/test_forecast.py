"""The expected course of a search: what it says is what a flight that sees nothing gains."""

from __future__ import annotations

import numpy as np
import pytest

from roisearch import Belief, FieldOfView, SearchState, make_planner
from roisearch.bounds import release
from roisearch.detection import DetectionRecord
from roisearch.forecast import Standing, expected_pos, steps_until

PRIOR = np.random.default_rng(3).random((8, 9)) ** 3


@pytest.mark.parametrize("view", [FieldOfView.point, FieldOfView.donut])
def test_the_forecast_is_the_pos_of_the_flight_that_it_foresees(view: type) -> None:
    fov = view()
    belief, record = Belief(PRIOR, outside=0.1), DetectionRecord(PRIOR, 0.1)
    gained = expected_pos(
        Standing(belief, record.undetected(), SearchState((0, 0))), make_planner("index", fov=fov), fov,
        steps=60, heed=1,
    ).gained  # fmt: skip
    planner, cell, heading = make_planner("index", fov=fov), (0, 0), "north"
    rng, flown = np.random.default_rng(0), [0.0]
    for _ in range(60):
        there = planner.plan(belief, SearchState(cell, heading), rng).path[0]
        heading = {(-1, 0): "north", (0, 1): "east", (1, 0): "south", (0, -1): "west"}[
            there[0] - cell[0], there[1] - cell[1]
        ]
        cell = there
        seen = fov.cells(cell, heading, belief.shape)
        belief.observe(seen, [False], 0.9, 0.9)
        record.look(seen, np.full(len(seen), 0.9))
        flown.append(record.pos)
    assert gained == pytest.approx(np.array(flown), abs=1e-12)


def test_no_forecast_beats_the_bound_and_none_changes_the_belief() -> None:
    belief, fov = Belief(PRIOR), FieldOfView.point()
    before = belief.digest()
    gained = expected_pos(
        Standing(belief, PRIOR / PRIOR.sum(), SearchState((4, 4))), make_planner("index", fov=fov), fov,
        steps=80,
    ).gained  # fmt: skip
    bound = release(PRIOR / PRIOR.sum(), (4, 4), 0.9, 80)
    assert len(gained) == 81
    assert (gained <= bound + 1e-12).all()
    assert (np.diff(gained) >= 0).all()
    assert gained[-1] > 0.5 * bound[-1]
    assert belief.digest() == before


def test_it_ends_when_enough_is_gained_and_says_when() -> None:
    belief, fov = Belief(PRIOR), FieldOfView.point()
    gained = expected_pos(
        Standing(belief, PRIOR / PRIOR.sum(), SearchState((4, 4))), make_planner("index", fov=fov), fov,
        steps=1000, until=0.3,
    ).gained  # fmt: skip
    step = steps_until(gained, 0.3)
    assert step is not None
    assert gained[step - 1] < 0.3 <= gained[step]
    assert steps_until(gained, 0.99) is None


@pytest.mark.parametrize("view", [FieldOfView.point, FieldOfView.donut])
def test_with_a_perfect_detector_it_ends_when_nothing_is_left(view: type) -> None:
    prior, fov = np.full((3, 4), 1 / 12), view(1.0, 0.9)
    gained = expected_pos(
        Standing(Belief(prior), prior, SearchState((0, 0))), make_planner("index", fov=fov), fov,
        steps=500,
    ).gained  # fmt: skip
    assert len(gained) < 60
    assert gained[-1] == pytest.approx(1.0)


def test_a_perfect_detector_that_has_reported_a_hit_needs_one_look_more() -> None:
    prior, fov = np.full((3, 4), 1 / 12), FieldOfView.point(1.0, 1.0)
    belief = Belief(prior)
    belief.observe([(0, 1)], [True], 1.0, 1.0)
    gained = expected_pos(
        Standing(belief, prior, SearchState((0, 0))), make_planner("index", fov=fov), fov,
        steps=50,
    ).gained  # fmt: skip
    assert gained == pytest.approx(np.array([0.0, 1 / 12]))
