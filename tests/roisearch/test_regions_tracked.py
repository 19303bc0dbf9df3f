"""Regions that follow the belief: numbers stay with the ground, and are drawn again when enough mass has moved."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from roisearch import Belief, FieldOfView, Regions, SearchState, make_planner, segment_regions
from roisearch.planners.base import Redrawable
from roisearch.regions import mass_moved, segment_again, track_regions, worth_segmenting

SHAPE = (40, 60)


def hills(*middles: tuple[float, float], spread: float = 4.0) -> NDArray[np.float64]:
    down, right = np.mgrid[: SHAPE[0], : SHAPE[1]]
    return sum(np.exp(-((down - r) ** 2 + (right - c) ** 2) / (2 * spread**2)) for r, c in middles) + 1e-4  # type: ignore[return-value]


def boxes(*corners: tuple[int, int, int, int]) -> Regions:
    """Regions that are rectangles of rows and columns, numbered from 1."""
    prior = np.zeros(SHAPE)
    labels = np.zeros(SHAPE, dtype=np.int32)
    for number, (top, left, bottom, right) in enumerate(corners, 1):
        labels[top:bottom, left:right] = number
        prior[top:bottom, left:right] = number
    middles = np.array([[(t + b) / 2, (le + r) / 2] for t, le, b, r in corners]).reshape(-1, 2)
    peaks = np.array([[t, le] for t, le, _, _ in corners], dtype=np.int64).reshape(-1, 2)
    return Regions(labels, len(corners), middles, peaks, np.full(len(corners) + 1, 1.0 / (len(corners) + 1)))


def test_numbers_stay_with_the_ground_whatever_the_order_of_the_new_ones() -> None:
    old = boxes((0, 0, 10, 10), (20, 20, 30, 30))
    new = boxes((21, 22, 29, 31), (1, 0, 9, 12))
    tracked = track_regions(old, new)
    assert tracked.labels[5, 5] == 1
    assert tracked.labels[25, 25] == 2
    assert tracked.count == 2
    assert tracked.peaks.tolist() == [[1, 0], [21, 22]]
    assert tracked.centroids.tolist() == [[5.0, 6.0], [25.0, 26.5]]


def test_a_new_region_gets_a_new_number_and_that_of_a_vanished_one_is_not_used_again() -> None:
    old = boxes((0, 0, 10, 10), (20, 20, 30, 30))
    gone = track_regions(old, boxes((20, 20, 30, 30)))
    assert gone.numbers == (2,)
    assert gone.shares[1] == 0.0
    again = track_regions(gone, boxes((20, 20, 30, 30), (0, 0, 10, 10)))
    assert again.numbers == (2, 3)
    assert again.labels[5, 5] == 3


def test_the_largest_part_of_a_region_that_falls_apart_keeps_its_number() -> None:
    parts = track_regions(boxes((0, 0, 20, 40)), boxes((0, 0, 20, 10), (0, 12, 20, 40)))
    assert parts.labels[5, 30] == 1
    assert parts.labels[5, 5] == 2
    joined = track_regions(parts, boxes((0, 0, 20, 40)))
    assert joined.numbers == (1,)


def test_regions_that_hardly_touch_are_not_the_same() -> None:
    assert track_regions(boxes((0, 0, 10, 10)), boxes((9, 0, 19, 10))).numbers == (2,)


@given(st.integers(0, 10_000))
@settings(max_examples=20, deadline=None)
def test_tracking_renames_and_changes_no_border(seed: int) -> None:
    rng = np.random.default_rng(seed)
    old = segment_regions(hills(*rng.uniform((0, 0), SHAPE, (4, 2)).tolist()))
    new = segment_regions(hills(*rng.uniform((0, 0), SHAPE, (5, 2)).tolist()))
    tracked = track_regions(old, new)
    assert len(tracked.numbers) == new.count
    assert tracked.count >= old.count
    for number in tracked.numbers:
        assert len(np.unique(new.labels[tracked.labels == number])) == 1
    np.testing.assert_array_equal(tracked.labels == 0, new.labels == 0)
    assert tracked.shares.sum() == pytest.approx(1.0)
    again = track_regions(old, new)
    np.testing.assert_array_equal(tracked.labels, again.labels)


def test_only_mass_that_changed_hands_is_worth_segmenting() -> None:
    prior = hills((10, 15), (30, 45))
    regions = segment_regions(prior)
    assert mass_moved(regions, 7.0 * prior) == pytest.approx(0.0, abs=1e-12)
    inside = prior.copy()
    inside[regions.labels == 1] = inside[regions.labels == 1][::-1]
    assert not worth_segmenting(regions, inside)
    searched = np.where(regions.labels == 1, 0.1 * prior, prior)
    share = regions.shares[1]
    assert mass_moved(regions, searched) == pytest.approx(share - 0.1 * share / (1 - 0.9 * share))
    assert worth_segmenting(regions, searched)


def test_the_furrows_of_a_search_make_no_regions() -> None:
    prior = hills((20, 30), spread=8.0)
    furrows = prior.copy()
    furrows[np.arange(SHAPE[0]) % 6 < 2] *= 0.1
    assert segment_regions(furrows).count > 3
    assert segment_again(segment_regions(prior), furrows).numbers == (1,)


def test_a_region_that_was_searched_is_spent_and_one_that_filled_appears() -> None:
    old = segment_regions(hills((10, 15), (30, 45)))
    spent = int(old.labels[10, 15])
    now = segment_again(old, hills((30, 45), (8, 50)))
    assert spent not in now.numbers
    assert now.numbers == (3 - spent, 3)
    assert now.labels[8, 50] == 3


@pytest.mark.parametrize("ask", [mass_moved, worth_segmenting, segment_again])
def test_a_map_of_another_shape_is_refused(ask: Any) -> None:
    with pytest.raises(ValueError, match=r"shape \(40, 60\)"):
        ask(boxes((0, 0, 9, 9)), np.ones((3, 3)))
    with pytest.raises(ValueError, match="shapes"):
        track_regions(boxes((0, 0, 9, 9)), segment_regions(np.ones((3, 3))))


@pytest.mark.parametrize(
    ("name", "options"), [("puct-regions-lite", {}), ("puct-regions", {"iterations": 8}), ("index", {})]
)
def test_a_planner_goes_on_with_other_regions(name: str, options: dict[str, Any]) -> None:
    belief, rng = Belief(hills((10, 15), (30, 45))), np.random.default_rng(1)
    planner = make_planner(name, fov=FieldOfView.point(), **options)
    assert isinstance(planner, Redrawable)
    before = planner.plan(belief, SearchState((0, 0)), rng)
    regions = segment_again(segment_regions(belief.probability()), hills((30, 45), (8, 50)))
    planner.redraw(regions)()
    after = planner.plan(belief, SearchState(before.path[0], "east"), rng)
    told = {each.region for each in after.alternatives if each.region}
    assert told <= set(regions.numbers) | {None}
    if name == "puct-regions-lite":  # the plan that it had is still flown
        assert after.path[:8] == before.path[1:9]
    with pytest.raises(ValueError, match="the regions have the shape"):
        planner.redraw(segment_regions(np.ones((3, 3))))
