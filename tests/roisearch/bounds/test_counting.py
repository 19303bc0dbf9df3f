"""The bounds hold against every path there is on tiny maps, and against slow twins on larger ones."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from roisearch import bounds
from roisearch.fov import HEADINGS, MOVES
from sim.scenario import paper_prior


class Mask:
    """A field of view from offsets when heading north; the others are turned from it."""

    def __init__(self, offsets: list[tuple[int, int]]) -> None:
        self.offsets = np.array(offsets, dtype=np.int64).reshape(-1, 2)

    def cells(self, cell: tuple[int, int], heading: str, shape: tuple[int, int]) -> np.ndarray:
        turned = self.offsets
        for _ in range(HEADINGS.index(heading)):
            turned = np.stack([turned[:, 1], -turned[:, 0]], axis=1)
        seen = turned + np.array(cell)
        return seen[((seen >= 0) & (seen < np.array(shape))).all(axis=1)]


POINT = Mask([(0, 0)])
DONUT = Mask([(r, c) for r in (-1, 0, 1) for c in (-1, 0, 1) if (r, c) != (0, 0)])
WIDE = Mask([(-1, c) for c in (-1, 0, 1)] + [(-2, c) for c in range(-2, 3)])


def curve_of(looked: list[np.ndarray], prior: np.ndarray, p_tp: float) -> np.ndarray:
    """F of a sequence of footprints, from its definition."""
    undetected = prior.copy()
    found = [0.0]
    for cells in looked:
        gain = 0.0
        for row, col in cells:
            gain += p_tp * undetected[row, col]
            undetected[row, col] *= 1.0 - p_tp
        found.append(found[-1] + gain)
    return np.array(found)


def best_of_all_paths(
    prior: np.ndarray, start: tuple[int, int], fov: Mask, p_tp: float, steps: int
) -> np.ndarray:
    """The largest F(t) over all paths, for each t on its own."""
    best = np.zeros(steps + 1)
    for headings in itertools.product(range(4), repeat=steps):
        at, looked = start, []
        for heading in headings:
            at = (at[0] + MOVES[heading][0], at[1] + MOVES[heading][1])
            if not (0 <= at[0] < prior.shape[0] and 0 <= at[1] < prior.shape[1]):
                break
            looked.append(fov.cells(at, HEADINGS[heading], prior.shape))
        found = curve_of(looked, prior, p_tp)
        best[: len(found)] = np.maximum(best[: len(found)], found)
    return best


def naive_release(
    prior: np.ndarray, start: tuple[int, int], p_tp: float, steps: int, reach: int = 0
) -> np.ndarray:
    """The greedy order by looking through all cells at each step."""
    undetected = prior.copy()
    row, col = np.indices(prior.shape)
    released = np.maximum(1, np.abs(row - start[0]) + np.abs(col - start[1]) - reach)
    found = [0.0]
    for step in range(1, steps + 1):
        allowed = np.where(released <= step, undetected, -1.0)
        cell = np.unravel_index(np.argmax(allowed), allowed.shape)
        found.append(found[-1] + (p_tp * undetected[cell] if allowed[cell] > 0 else 0.0))
        if allowed[cell] > 0:
            undetected[cell] *= 1.0 - p_tp
    return np.array(found)


def some_prior(seed: int, shape: tuple[int, int]) -> np.ndarray:
    weights = np.random.default_rng(seed).random(shape) ** 3
    return weights / weights.sum()


@given(seed=st.integers(0, 10_000), rows=st.integers(1, 6), cols=st.integers(1, 6), p_tp=st.floats(0.05, 1.0))
@settings(max_examples=60, deadline=None)
def test_release_agrees_with_its_naive_twin(seed: int, rows: int, cols: int, p_tp: float) -> None:
    prior = some_prior(seed, (rows, cols))
    start = (seed % rows, seed % cols)
    np.testing.assert_allclose(
        bounds.release(prior, start, p_tp, 40), naive_release(prior, start, p_tp, 40), atol=1e-12
    )


@given(seed=st.integers(0, 10_000), p_tp=st.floats(0.05, 1.0), steps=st.integers(0, 60))
@settings(max_examples=60, deadline=None)
def test_teleport_is_the_sum_of_the_most_valuable_looks(seed: int, p_tp: float, steps: int) -> None:
    prior = some_prior(seed, (3, 5))
    looks = np.outer(prior.ravel(), p_tp * (1.0 - p_tp) ** np.arange(steps + 1)).ravel()
    expected = np.concatenate([[0.0], np.cumsum(np.sort(looks)[::-1])])[: steps + 1]
    np.testing.assert_allclose(bounds.teleport(prior, p_tp, steps), expected, atol=1e-12)


@pytest.mark.parametrize("fov", [POINT, DONUT, WIDE], ids=["point", "donut", "wide-angle"])
@pytest.mark.parametrize("seed", range(3))
def test_no_path_beats_a_bound(fov: Mask, seed: int) -> None:
    prior, start, p_tp, steps = some_prior(seed, (4, 4)), (1, 1), (0.9, 0.5, 1.0)[seed], 6
    best = best_of_all_paths(prior, start, fov, p_tp, steps)
    bound = bounds.multi_cell(prior, start, fov, p_tp, steps, memory=2)
    assert np.all(best <= bound + 1e-12)
    if fov is POINT:
        release = bounds.release(prior, start, p_tp, steps)
        assert np.all(best <= release + 1e-12)
        assert np.all(release <= bounds.teleport(prior, p_tp, steps) + 1e-12)
        assert best[1] == pytest.approx(release[1], abs=1e-12) or prior[start] > 0


def test_release_is_attained_on_a_corridor_with_falling_mass() -> None:
    prior = np.array([[0.0, 0.4, 0.3, 0.2, 0.1]])
    found = curve_of([np.array([[0, c]]) for c in (1, 2, 3, 4)], prior, 0.9)
    np.testing.assert_allclose(bounds.release(prior, (0, 0), 0.9, 4), found, atol=1e-12)


def test_release_goes_around_obstacles() -> None:
    prior = np.zeros((3, 3))
    prior[0, 2] = 1.0
    flyable = np.ones((3, 3), dtype=bool)
    flyable[:2, 1] = False
    assert bounds.quantiles(bounds.release(prior, (0, 0), 1.0, 20), [0.5])[0] == 2
    assert bounds.quantiles(bounds.release(prior, (0, 0), 1.0, 20, flyable=flyable), [0.5])[0] == 6


def test_multi_cell_is_tighter_than_counting_every_cell_of_the_footprint() -> None:
    prior = paper_prior(np.random.default_rng(1))
    loose = bounds.release(prior, (5, 5), 0.9, 2000, looks=8, reach=2)
    tight = bounds.multi_cell(prior, (5, 5), DONUT, 0.9, 2000)
    assert np.all(tight <= loose + 1e-12)
    assert bounds.expected_time(tight) > 1.1 * bounds.expected_time(loose)


@pytest.mark.parametrize(("fov", "fresh"), [(POINT, 1), (DONUT, 3)], ids=["point", "donut"])
def test_new_cells_of_a_move(fov: Mask, fresh: int) -> None:
    assert bounds.new_cells(fov) == fresh


def test_a_field_of_view_that_sees_nothing_finds_nothing() -> None:
    assert not bounds.multi_cell(some_prior(0, (3, 3)), (0, 0), Mask([]), 0.9, 10).any()


def test_multi_cell_of_a_point_is_no_looser_than_release() -> None:
    prior = paper_prior(np.random.default_rng(2), (50, 50))
    release = bounds.release(prior, (5, 5), 0.9, 3000)
    assert np.all(bounds.multi_cell(prior, (5, 5), POINT, 0.9, 3000) <= release + 1e-12)


def test_reference_without_false_alarms_is_teleport() -> None:
    prior = paper_prior(np.random.default_rng(3), (40, 40))
    reference = bounds.teleport_reference(prior, 0.9, 1.0, 500, np.random.default_rng(0), draws=1)
    np.testing.assert_allclose(reference, bounds.teleport(prior, 0.9, 500), atol=1e-12)


def test_false_alarms_cost_time_and_never_beat_teleport() -> None:
    prior = paper_prior(np.random.default_rng(3), (40, 40))
    reference = bounds.teleport_reference(prior, 0.9, 0.9, 2000, np.random.default_rng(0), draws=5)
    best = bounds.teleport(prior, 0.9, 2000)
    assert np.all(reference <= best + 1e-12)
    assert bounds.expected_time(reference) > 1.05 * bounds.expected_time(best)


def test_expected_time_and_quantiles_of_a_known_curve() -> None:
    curve = np.array([0.0, 0.5, 0.5, 0.75])
    assert bounds.expected_time(curve) == pytest.approx(1.0 + 0.5 + 0.5)
    np.testing.assert_array_equal(bounds.quantiles(curve, [0.25, 0.5, 0.75, 0.95]), [1, 1, 3, np.inf])


@pytest.mark.parametrize(
    ("prior", "p_tp", "start", "message"),
    [
        (np.ones((2, 2)), 0.9, (0, 0), "at most 1"),
        (np.full((2, 2), 0.25), 1.5, (0, 0), "p_tp"),
        (np.full((2, 2), 0.25), 0.9, (0, 5), "not on the map"),
        (np.full(4, 0.25), 0.9, (0, 0), "rows and columns"),
    ],
)
def test_bad_input_is_named(prior: np.ndarray, p_tp: float, start: tuple[int, int], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        bounds.release(prior, start, p_tp, 5)


def test_paper_prior_is_a_distribution_and_repeats_with_its_seed() -> None:
    prior = paper_prior(np.random.default_rng(7))
    assert prior.shape == (200, 200)
    assert prior.sum() == pytest.approx(1.0)
    np.testing.assert_array_equal(prior, paper_prior(np.random.default_rng(7)))


def test_hills_share_height_mass_or_neither() -> None:
    """Two far-apart hills of one seed: same heights, same masses, or heights from 0.18 to 0.88."""
    seed = next(
        s for s in range(1000) if _peaks_apart(paper_prior(np.random.default_rng(s), equal="height")) == 2
    )
    height, mass, neither = (
        np.sort(_peaks(paper_prior(np.random.default_rng(seed), equal=equal)))
        for equal in ("height", "mass", "neither")
    )
    assert height[1] / height[0] == pytest.approx(1.0, rel=0.02)
    assert mass[1] / mass[0] > 1.02
    assert 1.02 < neither[1] / neither[0] < 0.88 / 0.18


def _peaks(prior: NDArray[np.float64]) -> NDArray[np.float64]:
    """The values of the local maxima."""
    inner = prior[1:-1, 1:-1]
    around = [np.roll(prior, (i, j), (0, 1))[1:-1, 1:-1] for i in (-1, 0, 1) for j in (-1, 0, 1) if i or j]
    return inner[(inner > np.max(around, axis=0)) & (inner > 1e-6)]


def _peaks_apart(prior: NDArray[np.float64]) -> int:
    """How many local maxima there are, none when two are close enough to add to each other."""
    peaks = _peaks(prior)
    return len(peaks) if np.ptp(peaks) < 0.01 * peaks.max() else 0
