"""The bound in seconds holds for every path that a motion can fly, and is the release bound where time is steps."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from roisearch import Motion, bounds
from roisearch.bounds.seconds import least_between_looks
from roisearch.directions import DIRECTIONS, STEPS

Floats = NDArray[np.float64]

MOTIONS = [
    Motion(cell_m=25.0),
    Motion(cell_m=10.0, acceleration_mps2=3.0, corner_m=5.0),
    Motion(cell_m=25.0, corner_m=0.0, turning_dps=60.0),
    Motion(cell_m=25.0, wind_mps=(3.0, -4.0), airspeed_mps=9.0),
    Motion(cell_m=28.8, corners_mps=(7.0, 5.0, 2.0, 0.0)),
]


def some_prior(seed: int, shape: tuple[int, int]) -> Floats:
    weights = np.random.default_rng(seed).random(shape) ** 4
    prior: Floats = weights / weights.sum()
    return prior


@pytest.mark.parametrize(
    "motion",
    [
        Motion(cell_m=25.0, speed_mps=2.5, diagonal=False),
        Motion(cell_m=25.0, speed_mps=3.5, corner_m=10.0, diagonal=False),
        Motion(cell_m=25.0, acceleration_mps2=15.0, corner_m=12.5, diagonal=False),
    ],
)
def test_a_staircase_that_is_rounded_at_every_step_is_not_beaten_by_the_bound(motion: Motion) -> None:
    """Only the start and the end were taken to be cut: the bound said 278 s for a flight of 239."""
    prior = np.zeros((21, 21))
    prior[20, 20] = 1.0
    path = [cell for k in range(1, 21) for cell in ((k, k - 1), (k, k))]
    flown = motion.arrivals(path, (0, 0), "south", motion.speed_mps)[-1]
    times, found = bounds.release_seconds(prior, (0, 0), 0.9, motion, 1000.0)
    assert times[np.argmax(found > 0.0)] <= flown


@given(
    seed=st.integers(0, 10_000),
    motion=st.sampled_from(MOTIONS),
    speed=st.sampled_from([0.0, 8.0]),
    straight=st.booleans(),
)
@settings(max_examples=200, deadline=None)
def test_no_flight_finds_more_at_any_second(seed: int, motion: Motion, speed: float, straight: bool) -> None:
    rng, shape = np.random.default_rng(seed), (6, 7)
    prior, start = some_prior(seed, shape), (int(rng.integers(6)), int(rng.integers(7)))
    cell, path, direction = start, [], int(rng.integers(8))
    while len(path) < 60:  # a walk that mostly goes straight on, or wildly about
        if not straight or rng.random() < 0.3:
            direction = int(rng.integers(8))
        to = (cell[0] + STEPS[direction][0], cell[1] + STEPS[direction][1])
        if 0 <= to[0] < shape[0] and 0 <= to[1] < shape[1]:
            path.append(to)
            cell = to
        else:
            direction = int(rng.integers(8))
    arrivals = motion.arrivals(path, start, DIRECTIONS[direction], speed_mps=speed)
    undetected, found = prior.copy(), []
    for at in path:
        found.append((found[-1] if found else 0.0) + 0.9 * undetected[at])
        undetected[at] *= 0.1
    times, most = bounds.release_seconds(prior, start, 0.9, motion, float(arrivals[-1]) + 1.0)
    allowed = most[np.searchsorted(times, arrivals, side="right") - 1]
    assert (np.array(found) <= allowed + 1e-12).all()


def test_in_the_world_of_steps_it_is_the_release_bound() -> None:
    prior = some_prior(4, (9, 11))
    times, found = bounds.release_seconds(prior, (2, 3), 0.9, Motion.steps(), 200.0)
    np.testing.assert_allclose(times, np.arange(201.0))
    np.testing.assert_allclose(found, bounds.release(prior, (2, 3), 0.9, 200))
    assert bounds.expected_seconds(times, found, 200.0) == pytest.approx(
        bounds.expected_time(bounds.release(prior, (2, 3), 0.9, 200))
    )


def test_it_is_attained_on_a_straight_line_at_full_speed() -> None:
    motion = Motion(cell_m=20.0, speed_mps=10.0)
    prior = np.array([[0.0, 0.4, 0.3, 0.2, 0.1]])
    path = [(0, 1), (0, 2), (0, 3), (0, 4)]
    arrivals = motion.arrivals(path, (0, 0), "east", speed_mps=10.0)
    apart, _ = least_between_looks(motion)
    times, found = bounds.release_seconds(prior, (0, 0), 1.0, motion, 10.0)
    np.testing.assert_allclose(arrivals, 2.0 * np.arange(1, 5))
    assert apart <= 2.0
    assert found[-1] == pytest.approx(1.0)
    assert times[np.searchsorted(found, 0.99)] == pytest.approx(4 * apart)


def test_a_faster_aircraft_has_a_lower_bound() -> None:
    prior = some_prior(1, (10, 10))
    slow, fast = (
        bounds.expected_seconds(*bounds.release_seconds(prior, (0, 0), 0.9, motion, 2000.0), 2000.0)
        for motion in (Motion(cell_m=25.0, speed_mps=5.0), Motion(cell_m=25.0, speed_mps=10.0))
    )
    assert fast < 0.6 * slow


def test_bad_input_is_named() -> None:
    with pytest.raises(ValueError, match="not on the map"):
        bounds.release_seconds(some_prior(0, (3, 3)), (3, 0), 0.9, Motion(cell_m=10.0), 10.0)
    with pytest.raises(ValueError, match="seconds must be 0 or more"):
        bounds.release_seconds(some_prior(0, (3, 3)), (0, 0), 0.9, Motion(cell_m=10.0), -1.0)
