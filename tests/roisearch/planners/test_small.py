"""The default in steps on ground so small that the exact optimum is known."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from numpy.typing import NDArray

from roisearch.belief import Belief
from roisearch.bounds import least_expected_time
from roisearch.decision import SearchState
from roisearch.fov import HEADINGS, MOVES, FieldOfView
from roisearch.kernels.records import Pose
from roisearch.planners.base import Planner
from roisearch.planners.lookahead.small import tour_from
from roisearch.registry import make_planner

VIEW = FieldOfView.point(1.0, 1.0)
START = (0, 0)


def steps_flown(planner: Planner, prior: NDArray[np.float64], seed: int) -> float:
    """The expected steps until the target is seen, of a search that the planner decides step by step."""
    rng, belief, state = np.random.default_rng(seed), Belief(prior), SearchState(START)
    left, steps = prior.copy(), 0.0
    while left.sum() > 1e-9:
        cell = planner.plan(belief, state, rng).path[0]
        steps += float(left.sum())
        move = MOVES.index((cell[0] - state.cell[0], cell[1] - state.cell[1]))
        state = SearchState(cell, HEADINGS[move])
        left[cell] = 0.0
        if left.sum() > 1e-9:
            belief.observe([cell], False, 1.0, 1.0)
    return steps


@pytest.mark.parametrize("power", [1.0, 4.0])
def test_the_default_is_within_a_hundredth_of_the_optimum_on_small_maps(power: float) -> None:
    """Twelve maps of 4 x 5 cells, uniform ** power: 1.067 and 1.018 of it, at worst 1.23, without a tour as a start."""
    ratios = []
    for seed in range(1000, 1012):
        prior = np.random.default_rng(seed).random((4, 5)) ** power
        prior /= prior.sum()
        flown = steps_flown(make_planner("puct-regions-lite", fov=VIEW), prior, seed)
        ratios.append(flown / least_expected_time(prior, START))
    print(f"uniform ** {power:g}: {np.mean(ratios):.4f} of the optimum, worst {max(ratios):.4f}")
    assert min(ratios) > 1.0 - 1e-9
    assert np.mean(ratios) <= 1.01
    assert max(ratios) <= 1.04


def test_a_tour_enters_every_cell_that_is_worth_it_and_leads_round_what_is_not_flyable() -> None:
    mass, flyable = np.full((6, 7), 1 / 42), np.ones((6, 7), dtype=bool)
    flyable[1:5, 3] = False
    pose = Pose(0, 0, HEADINGS.index("east"))
    cells = tour_from(pose, np.where(flyable, mass, 0.0), VIEW, flyable, 1, np.inf)
    way = [(0, 0), *(divmod(cell, 7) for cell in cells.tolist())]
    assert set(way) == set(zip(*(axis.tolist() for axis in np.nonzero(flyable)), strict=True))
    assert all(abs(a[0] - b[0]) + abs(a[1] - b[1]) == 1 for a, b in itertools.pairwise(way))
    assert tour_from(pose, np.zeros((6, 7)), VIEW, None, 1, np.inf).size == 0
