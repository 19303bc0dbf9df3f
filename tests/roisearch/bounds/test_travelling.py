"""The bound that counts travel: below every walk on tiny maps, above the release bound where hills lie apart."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from roisearch import bounds
from roisearch.bounds.travelling import BLOCKS
from roisearch.bounds.walks import best_walk
from roisearch.fov import MOVES

Floats = NDArray[np.float64]
Cell = tuple[int, int]


def some_prior(seed: int, shape: tuple[int, int]) -> Floats:
    weights = np.random.default_rng(seed).random(shape) ** 4
    prior: Floats = weights / weights.sum()
    return prior


def two_hills(shape: tuple[int, int] = (24, 60)) -> Floats:
    """Hills of equal height at both ends of a long map; the searcher begins in the middle."""
    row, col = np.indices(shape)
    hills = sum(np.exp(-((row - 12) ** 2 + (col - at) ** 2) / 18.0) for at in (8, 51))
    prior: Floats = hills / hills.sum()
    return prior


def walks(shape: tuple[int, int], start: Cell, steps: int, flyable: NDArray[np.bool_]) -> list[list[Cell]]:
    """Every walk of so many steps."""
    found: list[list[Cell]] = [[]]
    for _ in range(steps):
        longer = []
        for walk in found:
            row, col = walk[-1] if walk else start
            for down, right in MOVES:
                to = (row + down, col + right)
                if 0 <= to[0] < shape[0] and 0 <= to[1] < shape[1] and flyable[to]:
                    longer.append([*walk, to])
        found = longer
    return found


def expected_time_of(walk: list[Cell], prior: Floats, p_tp: float) -> float:
    undetected = prior.copy()
    found, total = 0.0, 0.0
    for cell in walk:
        total += 1.0 - found
        found += p_tp * undetected[cell]
        undetected[cell] *= 1.0 - p_tp
    return total


@given(seed=st.integers(0, 10_000), p_tp=st.sampled_from([0.4, 0.9, 1.0]), blocked=st.booleans())
@settings(max_examples=12, deadline=None)
def test_no_walk_beats_the_bound_however_often_it_was_divided(seed: int, p_tp: float, blocked: bool) -> None:
    prior, start, steps = some_prior(seed, (3, 4)), (seed % 3, seed % 4), 7
    flyable = np.ones(prior.shape, dtype=bool)
    if blocked:
        flyable[1, 1 if start != (1, 1) else 2] = False
    best = min(expected_time_of(walk, prior, p_tp) for walk in walks(prior.shape, start, steps, flyable))
    found = bounds.travel(prior, start, p_tp, steps, divisions=4, flyable=flyable)
    assert found.expected <= best + 1e-9
    assert found.expected >= found.release
    assert list(found.history) == sorted(found.history)


def test_travel_between_hills_is_counted() -> None:
    found = bounds.travel(two_hills(), (12, 30), 0.9, 300, divisions=4)
    assert found.history[0] > found.release, "prices alone"
    assert found.expected > 1.05 * found.release, "and dividing the walks by where they are"
    assert found.classes > 1


def test_one_hill_is_left_to_the_release_bound() -> None:
    row, col = np.indices((20, 20))
    hill = np.exp(-((row - 10) ** 2 + (col - 10) ** 2) / 20.0)
    found = bounds.travel(hill / hill.sum(), (0, 0), 0.9, 200)
    assert found.expected == pytest.approx(found.release, rel=0.02)


def test_classes_above_a_known_walk_are_not_divided() -> None:
    free = bounds.travel(two_hills(), (12, 30), 0.9, 300, divisions=4)
    assert len(bounds.travel(two_hills(), (12, 30), 0.9, 300, divisions=4, known=free.release).history) == 1


def test_a_uniform_map_has_one_class_and_a_bound() -> None:
    found = bounds.travel(np.full((5, 6), 1.0 / 30.0), (0, 0), 0.9, 40)
    assert found.classes == 1
    assert found.expected >= found.release > 0.0


@given(seed=st.integers(0, 10_000), steps=st.integers(1, 6), tied=st.booleans())
@settings(max_examples=25, deadline=None)
def test_the_best_walk_agrees_with_trying_all(seed: int, steps: int, tied: bool) -> None:
    rng = np.random.default_rng(seed)
    shape, start = (3, 3), (int(rng.integers(3)), int(rng.integers(3)))
    worth, price = rng.random((*shape, 2)), rng.random((*shape, 2)) * steps
    flyable = rng.random(shape) < 0.8
    flyable[start] = True
    labels = rng.integers(0, 2, shape)
    fixed = np.full(steps + 1, -1)
    if tied:
        fixed[rng.integers(1, steps + 1)] = 1
    best = -np.inf
    for walk in walks(shape, start, steps, flyable):
        if any(fixed[t] >= 0 and labels[cell] != fixed[t] for t, cell in enumerate(walk, start=1)):
            continue
        earned = 0.0
        for t, cell in enumerate(walk, start=1):
            earned += max(0.0, *(worth[cell] * (steps - t) - price[cell]))
        best = max(best, earned)
    assert best_walk(worth, price, flyable, labels, start, fixed) == pytest.approx(best)


@pytest.mark.parametrize("seed", range(4))
def test_the_optimum_agrees_with_every_order(seed: int) -> None:
    prior, start = some_prior(seed, (2, 3)), (0, seed % 3)
    cells = list(np.ndindex(*prior.shape))
    best = np.inf
    for order in itertools.permutations(cells):
        at, now, total = start, 0, 0.0
        for cell in order:
            away = abs(cell[0] - at[0]) + abs(cell[1] - at[1])
            now += away or 2  # the start has to be left and entered again
            total += float(prior[cell]) * now
            at = cell
        best = min(best, total)
    assert bounds.least_expected_time(prior, start) == pytest.approx(best)


def test_the_optimum_lies_between_its_bounds_and_a_sweep() -> None:
    prior = some_prior(3, (4, 5))
    best = bounds.least_expected_time(prior, (0, 0))
    sweep = [(row, col if row % 2 == 0 else 4 - col) for row in range(4) for col in range(5)][1:]
    assert bounds.travel(prior, (0, 0), 1.0, 60).expected <= best + 1e-9
    assert best <= expected_time_of([*sweep, (3, 1), (2, 1), (1, 1), (0, 1), (0, 0)], prior, 1.0) + 1e-9


def test_too_large_a_map_for_the_optimum_is_refused() -> None:
    with pytest.raises(ValueError, match="1 to 22 cells"):
        bounds.least_expected_time(np.full((5, 5), 0.04), (0, 0))


def test_a_search_of_no_steps_is_refused() -> None:
    with pytest.raises(ValueError, match="steps must be 1 or more"):
        bounds.travel(two_hills(), (0, 0), 0.9, 0)
    assert BLOCKS >= 1
