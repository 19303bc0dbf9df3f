"""What knowing the climb is worth, and how a kept flight is put beside the motion: on a small world of its own."""

from __future__ import annotations

import numpy as np
import pytest

from roisearch import Motion
from sim.climbing import IGNORES, KNOWS, SURVEY, HillyGround, drawn_prior, entered, flown, row_of

SLOPE = np.broadcast_to(np.maximum(0.0, np.arange(21.0) - 10.0) * 20.0, (3, 21))
WORLD = HillyGround(
    np.ones((3, 21), dtype=bool), SLOPE, (1, 10), Motion(cell_m=25.0, climb_mps=2.0, descent_mps=1.0)
)


def test_who_knows_the_climb_goes_where_it_is_level_first_and_finds_sooner() -> None:
    prior = np.full((3, 21), 1e-4)
    prior[1, 3], prior[1, 17] = 0.5, 0.55  # a little more up the slope, as far away
    rows = {who: row_of([flown(WORLD, prior / prior.sum(), who, 1)]) for who in (KNOWS, IGNORES, SURVEY)}
    assert rows[KNOWS][0] < 0.95 * rows[IGNORES][0]
    assert rows[KNOWS][0] < rows[SURVEY][0]


def test_a_drawn_prior_is_one_and_lies_where_is_flown() -> None:
    flyable = WORLD.flyable.copy()
    flyable[0, :8] = False
    prior = drawn_prior(HillyGround(flyable, SLOPE, (1, 10), WORLD.motion), np.random.default_rng(3))
    assert prior.sum() == pytest.approx(1.0)
    assert (prior[~flyable] == 0.0).all()
    assert prior.max() > 2.0 * np.median(prior[flyable])


def test_the_cells_between_two_frames_were_entered_too() -> None:
    path, when = entered([(0, 0), (0, 0), (2, 1), (2, 2)], [1.0, 2.0, 3.0, 4.0])
    assert path == [(0, 0), (1, 1), (2, 1), (2, 2)]
    assert when == [1.0, 3.0, 3.0, 4.0]
