"""Fields of view turn with the heading and stop at the border; regions are the hills of the prior."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from scipy import ndimage

from roisearch import Belief, FieldOfView, segment_regions
from roisearch.forest import Forest
from tests.roisearch.strategies import World, worlds


def seen(fov: FieldOfView, heading: str, cell: tuple[int, int] = (5, 5)) -> set[tuple[int, int]]:
    return {(int(r), int(c)) for r, c in fov.cells(cell, heading, (11, 11))}


def test_wide_angle_looks_ahead_of_every_heading() -> None:
    fov = FieldOfView.wide_angle()
    assert seen(fov, "north") == {(4, c) for c in (4, 5, 6)} | {(3, c) for c in range(3, 8)}
    assert seen(fov, "south") == {(6, c) for c in (4, 5, 6)} | {(7, c) for c in range(3, 8)}
    assert seen(fov, "east") == {(r, 6) for r in (4, 5, 6)} | {(r, 7) for r in range(3, 8)}
    assert seen(fov, "west") == {(r, 4) for r in (4, 5, 6)} | {(r, 3) for r in range(3, 8)}


def test_donut_hides_its_own_cell() -> None:
    assert (5, 5) not in seen(FieldOfView.donut(), "east")
    assert len(seen(FieldOfView.donut(), "east")) == 8


def test_the_border_clips_what_is_seen_and_its_probabilities() -> None:
    p_tp = np.linspace(0.1, 0.9, 9).reshape(3, 3)
    fov = FieldOfView.from_mask(np.ones((3, 3)), p_tp=p_tp)
    cells, tp, tn = fov.looks((0, 0), "north", (11, 11))
    assert cells.tolist() == [[0, 0], [0, 1], [1, 0], [1, 1]]
    np.testing.assert_allclose(tp, [p_tp[1, 1], p_tp[1, 2], p_tp[2, 1], p_tp[2, 2]])
    assert len(tn) == 4


@pytest.mark.parametrize("mask", [np.ones((2, 3)), np.zeros((3, 3)), np.ones(3)])
def test_a_mask_without_a_middle_or_a_cell_is_refused(mask: np.ndarray) -> None:
    with pytest.raises(ValueError, match="mask"):
        FieldOfView.from_mask(mask)


def test_two_hills_are_two_regions_and_a_flat_top_is_one() -> None:
    down, right = np.mgrid[0:40, 0:60]
    two = np.exp(-((down - 20) ** 2 + (right - 15) ** 2) / 32) + np.exp(
        -((down - 20) ** 2 + (right - 45) ** 2) / 32
    )
    regions = segment_regions(two)
    assert regions.count == 2
    assert sorted(map(tuple, regions.peaks.tolist())) == [(20, 15), (20, 45)]
    plateau = np.full((40, 60), 0.1)
    plateau[10:30, 10:50] = 1.0
    assert segment_regions(plateau).count == 1


def test_a_flat_prior_has_no_region() -> None:
    assert segment_regions(np.ones((10, 10))).count == 0


@given(worlds())
@settings(max_examples=40, deadline=None)
def test_regions_hold_only_cells_above_the_threshold_and_the_most_probable_one(world: World) -> None:
    regions = segment_regions(world.prior, searchable=world.flyable)
    mass = np.where(world.flyable, world.prior, 0.0)
    threshold = 1.2 * mass.sum() / world.flyable.sum()
    inside = world.flyable & (mass >= threshold)
    assert not (regions.labels > 0)[~inside].any()
    assert not inside.any() or regions.labels[np.unravel_index(mass.argmax(), mass.shape)] > 0
    assert set(np.unique(regions.labels)) - {0} == set(range(1, regions.count + 1))


@given(worlds(obstacles=False))
@settings(max_examples=40, deadline=None)
def test_region_sums_and_peaks_follow_every_observation(world: World) -> None:
    regions = segment_regions(world.prior)
    belief = Belief(world.prior)
    forest = Forest(regions.labels, regions.count + 1)
    sums = belief.follow(forest)
    rng = np.random.default_rng(0)
    for _ in range(10):
        cells = rng.integers(0, world.prior.shape, (3, 2))
        belief.observe(cells, rng.random(3) < 0.3, 0.9, 0.9)
    weights = belief.weights.reshape(belief.shape)
    for region in range(regions.count + 1):
        inside = weights[regions.labels == region]
        if inside.size:
            assert sums.sums[forest.root[region]] == pytest.approx(inside.sum(), rel=1e-12)
            assert sums.peaks[forest.root[region]] == inside.max()


def test_middles_and_peaks_of_regions_are_those_of_their_cells() -> None:
    rng = np.random.default_rng(0)
    for _ in range(10):
        prior = ndimage.gaussian_filter(rng.random((50, 70)), 2.0) ** 8
        regions = segment_regions(prior, float(prior.mean()))
        assert regions.count > 2
        for label in range(1, regions.count + 1):
            inside = regions.labels == label
            np.testing.assert_allclose(regions.centroids[label - 1], np.argwhere(inside).mean(axis=0))
            assert prior[tuple(regions.peaks[label - 1])] == prior[inside].max()


def test_the_peak_of_a_flat_top_is_its_first_cell() -> None:
    prior = np.zeros((12, 12))
    prior[3:6, 4:8] = 1.0
    assert segment_regions(prior).peaks.tolist() == [[3, 4]]
