"""The simulated target lies where the prior says, as often as it says."""

from __future__ import annotations

import numpy as np
import pytest

from sim.target import draw_target


def test_targets_are_drawn_as_often_as_the_prior_says() -> None:
    prior = np.array([[0.0, 0.5], [0.2, 0.3]])
    rng = np.random.default_rng(1)
    drawn = np.zeros((2, 2))
    for _ in range(4000):
        row, col = draw_target(prior, rng)
        drawn[int(row), int(col)] += 1
    assert drawn / 4000 == pytest.approx(prior, abs=0.03)


def test_the_same_seed_draws_the_same_target() -> None:
    prior = np.full((3, 4), 1 / 12)
    assert draw_target(prior, np.random.default_rng(7)) == draw_target(prior, np.random.default_rng(7))
