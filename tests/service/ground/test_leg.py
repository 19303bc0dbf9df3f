"""A leg is never judged to be higher above the ground than it is, whatever ground there is."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from service.ground.leg import least_clearance, lowest_path, profile
from service.ground.relief import Floats, Relief

STEP = 10.0


def hills(seed: int, rough: float, hole: bool) -> Relief:
    """Random ground of 40 x 40 posts: waves, spikes between cells, and perhaps a hole."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[0:40, 0:40]
    heights = sum(
        rng.uniform(0, 40) * np.sin(x * rng.uniform(0.05, 0.6) + y * rng.uniform(0.05, 0.6) + rng.uniform(0, 6))
        for _ in range(3)
    ) + rough * rng.exponential(1.0, (40, 40)) * (rng.random((40, 40)) < 0.1)  # fmt: skip
    if hole:
        row, col = rng.integers(5, 35, 2)
        heights[row : row + 2, col : col + 2] = np.nan
    return Relief(np.asarray(heights, dtype=np.float64), STEP, -50.0, -70.0, float(rng.uniform(0.0, 25.0)))


def by_brute_force(
    relief: Relief, start: tuple[float, float], end: tuple[float, float], z0: float, z1: float, ahead_m: float
) -> float:
    """The least of height less ground over places within reach of the leg, each looked at for itself."""
    length = math.hypot(end[0] - start[0], end[1] - start[1])
    least = math.inf
    for share in np.linspace(0.0, 1.0, 41):
        along = share * length
        z = z1 if z1 <= z0 else min(z0 + min((z1 - z0) / length if length else 0.0, 0.2) * along, z1)
        for on in np.linspace(along, min(along + ahead_m, length), 5):
            middle = np.array(start) + (np.array(end) - np.array(start)) * (on / length if length else 0.0)
            turn = np.linspace(0.0, 2 * math.pi, 12, endpoint=False)
            for radius in (0.0, 0.5 * relief.near_m, relief.near_m):
                ring = middle + radius * np.stack([np.cos(turn), np.sin(turn)], axis=1)
                ground = relief.height_at(ring)
                if np.isnan(ground).any():
                    return -math.inf
                least = min(least, float(z - ground.max()))
    return least


places = st.tuples(st.floats(-20.0, 320.0), st.floats(-40.0, 300.0))


@settings(max_examples=100, deadline=None)
@given(
    st.integers(0, 2**32), st.floats(0.0, 120.0), st.booleans(), places, places,
    st.floats(0.0, 200.0), st.floats(0.0, 200.0), st.floats(0.0, 60.0),
)  # fmt: skip
def test_no_place_within_reach_of_a_leg_is_nearer_than_it_says(
    seed: int, rough: float, hole: bool, start: tuple[float, float], end: tuple[float, float],
    z0: float, z1: float, ahead_m: float,
) -> None:  # fmt: skip
    relief = hills(seed, rough, hole)
    least = least_clearance(profile(relief, start, end, ahead_m=ahead_m), z0, z1, 0.2)
    assert least.metres <= by_brute_force(relief, start, end, z0, z1, ahead_m) + 1e-6


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32), places, places, st.floats(0.0, 200.0))
def test_it_is_too_careful_by_no_more_than_what_lies_three_posts_further(
    seed: int, start: tuple[float, float], end: tuple[float, float], z: float
) -> None:
    relief = hills(seed, 0.0, False)
    wider = Relief(relief.heights, STEP, relief.west_m, relief.north_m, 0.0)
    least = least_clearance(profile(relief, start, end), z, z, 0.2)
    seen = profile(wider, start, end).along
    points = np.array(start) + seen[:, None] / max(seen[-1], 1e-9) * (np.array(end) - np.array(start))
    reach = relief.near_m + 3.0 * STEP
    highest = -math.inf
    for post in np.argwhere(np.isfinite(relief.heights)):
        place = np.array([relief.west_m + post[1] * STEP, relief.north_m + post[0] * STEP])
        if np.hypot(*(points - place).T).min() <= reach:
            highest = max(highest, relief.heights[post[0], post[1]])
    if math.isfinite(least.metres):
        assert least.metres >= z - highest - 1e-6


def flat_with(post: tuple[int, int], height: float, near_m: float = 5.0) -> Relief:
    heights: Floats = np.zeros((30, 30))
    heights[post] = height
    return Relief(heights, STEP, 0.0, 0.0, near_m)


def test_a_hill_between_two_cells_stands_in_the_way() -> None:
    relief = flat_with((10, 10), 50.0)
    assert least_clearance(profile(relief, (50.0, 100.0), (150.0, 100.0)), 30.0, 30.0, 0.2).metres == -20.0
    beside = least_clearance(profile(relief, (50.0, 140.0), (150.0, 140.0)), 30.0, 30.0, 0.2)
    assert beside.metres == 30.0


def test_a_climb_is_no_steeper_than_the_aircraft_and_a_sink_is_at_once() -> None:
    relief = flat_with((10, 10), 50.0)
    seen = profile(relief, (20.0, 100.0), (220.0, 100.0))
    assert lowest_path(seen, 0.0, 100.0, 0.25)[-1] == 50.0
    assert lowest_path(seen, 0.0, 10.0, 0.25)[-1] == 10.0
    assert set(lowest_path(seen, 100.0, 60.0, 0.25)) == {60.0}
    climbing = least_clearance(seen, 20.0, 80.0, 0.25)
    assert climbing.metres < 0.0
    assert climbing.along_m < 110.0
    assert least_clearance(seen, 80.0, 80.0, 0.25).metres == 30.0


def test_who_may_have_to_stop_clears_what_lies_ahead() -> None:
    relief = flat_with((10, 20), 50.0)
    there = (240.0, 100.0)
    slow = least_clearance(profile(relief, (20.0, 100.0), there), 5.0, 65.0, 1.0)
    fast = least_clearance(profile(relief, (20.0, 100.0), there, ahead_m=40.0), 5.0, 65.0, 1.0)
    assert fast.metres < slow.metres - 8.0


def test_where_the_ground_is_not_known_no_height_clears_it() -> None:
    relief = flat_with((10, 10), math.nan)
    assert (
        least_clearance(profile(relief, (50.0, 100.0), (150.0, 100.0)), 500.0, 500.0, 0.2).metres == -math.inf
    )
    off = profile(relief, (50.0, 50.0), (900.0, 50.0))
    assert least_clearance(off, 500.0, 500.0, 0.2).metres == -math.inf
    assert least_clearance(off, 500.0, 500.0, 0.2).along_m == pytest.approx(235.0, abs=10.0)
    for nowhere in (math.nan, math.inf, 1e12):
        assert least_clearance(profile(relief, (0.0, 0.0), (nowhere, 0.0)), 9e9, 9e9, 0.2).metres == -math.inf
