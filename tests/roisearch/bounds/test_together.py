"""The bound of several searchers holds for all their flights on tiny maps, and is the known one for one searcher."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from roisearch import bounds
from roisearch.bounds import Start
from roisearch.fov import MOVES


def some_prior(seed: int, shape: tuple[int, int]) -> np.ndarray:
    weights = np.random.default_rng(seed).random(shape) ** 4
    prior: np.ndarray = weights / weights.sum()
    return prior


def walks(start: tuple[int, int], shape: tuple[int, int], length: int) -> list[list[tuple[int, int]]]:
    """All walks of so many moves."""
    found = []
    for moves in itertools.product(MOVES, repeat=length):
        cells, at = [], start
        for down, right in moves:
            at = (at[0] + down, at[1] + right)
            cells.append(at)
        if all(0 <= row < shape[0] and 0 <= col < shape[1] for row, col in cells):
            found.append(cells)
    return found


def found_by(looks: list[tuple[float, tuple[int, int]]], prior: np.ndarray, steps: int) -> np.ndarray:
    """F of looks at these moments, from its definition."""
    undetected, curve = prior.copy(), np.zeros(steps + 1)
    for when, cell in sorted(looks):
        curve[int(np.ceil(when)) :] += 0.9 * undetected[cell]
        undetected[cell] *= 0.1
    return curve


@given(
    seed=st.integers(0, 10_000), pace=st.sampled_from([1.0, 1.5, 2.0]), late=st.sampled_from([0.0, 0.5, 2.0])
)
@settings(max_examples=20, deadline=None)
def test_no_two_flights_find_more_at_any_step(seed: int, pace: float, late: float) -> None:
    shape, steps = (3, 3), 5
    prior = some_prior(seed, shape)
    bound = bounds.release_together(prior, [Start((0, 0)), Start((2, 1), late, pace)], 0.9, steps)
    second = int((steps - late) / pace)
    for mine in walks((0, 0), shape, 3):
        for other in walks((2, 1), shape, min(second, 3)):
            looks = [(float(i + 1), cell) for i, cell in enumerate(mine)]
            looks += [(late + pace * (i + 1), cell) for i, cell in enumerate(other)]
            assert (found_by(looks, prior, 3) <= bound[:4] + 1e-12).all()


def test_one_searcher_has_the_release_bound_and_four_at_one_start_have_it_with_four_looks() -> None:
    prior = some_prior(3, (20, 30))
    for count in (1, 4):
        ours = bounds.release_together(prior, [Start((4, 5))] * count, 0.9, 300)
        theirs = bounds.release(prior, (4, 5), 0.9, 300, looks=count)
        np.testing.assert_array_equal(ours, theirs)


def test_a_searcher_more_a_nearer_one_and_a_faster_one_raise_the_bound() -> None:
    prior = np.zeros((20, 30))
    prior[12:18, 20:28] = 1.0 / 48.0
    near, far, slow = Start((12, 19)), Start((0, 0)), Start((12, 19), pace=3.0)
    curves = [
        bounds.release_together(prior, starts, 0.9, 100) for starts in ([far], [far, slow], [far, near])
    ]
    for less, more in itertools.pairwise(curves):
        assert (less <= more + 1e-12).all()
        assert less.sum() < more.sum()


def test_bad_searchers_are_refused() -> None:
    prior = some_prior(1, (4, 4))
    with pytest.raises(ValueError, match="at least one"):
        bounds.release_together(prior, [], 0.9, 10)
    with pytest.raises(ValueError, match="not on the map"):
        bounds.release_together(prior, [Start((9, 0))], 0.9, 10)
    with pytest.raises(ValueError, match="pace above 0"):
        Start((0, 0), pace=0.0)
