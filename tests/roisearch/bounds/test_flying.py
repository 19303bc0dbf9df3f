"""The bound in seconds that counts travel: below every flight on tiny maps, above the release bound between hills."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from roisearch import Motion, bounds
from roisearch.bounds.flying import costs_of, halves
from roisearch.bounds.walks import best_flight
from roisearch.directions import DIRECTIONS, STEPS, moves_allowed
from tests.roisearch.bounds.test_seconds import MOTIONS, some_prior

Floats = NDArray[np.float64]
Cell = tuple[int, int]
FOUR = Motion(cell_m=25.0, diagonal=False)
WIDE = Motion(
    cell_m=20.0, acceleration_mps2=8.0, corner_m=10.0
)  # its corners are shorter than the way through


def far_hills() -> Floats:
    """Two narrow hills at both ends of a map of 9 x 36 cells."""
    row, col = np.indices((9, 36))
    near, far = (np.exp(-((row - 4) ** 2 + (col - at) ** 2) / 5.0) for at in (4, 31))
    prior: Floats = (near + far) / (near + far).sum()
    return prior


def flights(shape: tuple[int, int], start: Cell, moves: int, motion: Motion) -> list[list[Cell]]:
    """Every path of so many moves."""
    found: list[list[Cell]] = [[]]
    for _ in range(moves):
        longer = []
        for path in found:
            row, col = path[-1] if path else start
            for down, right in STEPS if motion.diagonal else STEPS[::2]:
                if 0 <= row + down < shape[0] and 0 <= col + right < shape[1]:
                    longer.append([*path, (row + down, col + right)])
        found = longer
    return found


def expected_of(path: list[Cell], arrivals: Floats, prior: Floats, p_tp: float, cap: float) -> float:
    undetected, total = prior.copy(), cap
    for cell, at in zip(path, arrivals, strict=True):
        total -= p_tp * undetected[cell] * max(0.0, cap - at)
        undetected[cell] *= 1.0 - p_tp
    return total


@pytest.mark.parametrize("motion", [*MOTIONS, FOUR, WIDE])
def test_no_flight_beats_the_bound(motion: Motion) -> None:
    """The exact optimum: every flight there is until the cap."""
    for seed, p_tp, speed in ((1, 0.9, 0.0), (2, 1.0, motion.speed_mps)):
        prior, start = some_prior(seed, (3, 3)), (seed % 3, (seed + 1) % 3)
        cap = 5.0 * bounds.seconds.least_between_looks(motion)[0]
        best = min(
            expected_of(path, motion.arrivals(path, start, heading, speed), prior, p_tp, cap)
            for path in flights(prior.shape, start, 5, motion)
            for heading in (DIRECTIONS[::2] if speed else ("north",))
        )
        found = bounds.travel_seconds(prior, start, p_tp, motion, cap, divisions=3)
        assert found.release <= found.expected <= best + 1e-9
        assert list(found.history) == sorted(found.history)


@given(
    seed=st.integers(0, 10_000),
    motion=st.sampled_from([*MOTIONS, FOUR, WIDE]),
    speed=st.sampled_from([0.0, 1.0]),
    turning=st.sampled_from([0.1, 0.5, 1.0]),
)
@settings(max_examples=150, deadline=None)
def test_no_flight_is_faster_than_its_slots(seed: int, motion: Motion, speed: float, turning: float) -> None:
    rng, costs = np.random.default_rng(seed), costs_of(motion)
    kinds = 8 if motion.diagonal else 4
    cell, path, slots, at, before = (0, 0), [], [], 0, -1
    direction = int(rng.integers(kinds)) * (8 // kinds)
    for _ in range(40):
        if rng.random() < turning:
            direction = int(rng.integers(kinds)) * (8 // kinds)
        apart = (direction - before) & 7
        at += costs.moves[direction] + (costs.turns[min(apart, 8 - apart)] if before >= 0 else 0)
        cell = (cell[0] + STEPS[direction][0], cell[1] + STEPS[direction][1])
        path.append(cell)
        slots.append(at)
        before = direction
    heading = DIRECTIONS[int(rng.integers(kinds)) * (8 // kinds)]
    arrivals = motion.arrivals(path, (0, 0), heading, speed * motion.speed_mps)
    assert (arrivals >= np.array(slots) * costs.slot_s - costs.early_s - 1e-9).all()


def test_a_turn_costs_what_it_costs_alone_and_less_where_corners_are_cut() -> None:
    for degrees, half in zip((45, 90, 135, 180), halves(Motion(cell_m=50.0).pace)[1:], strict=True):
        assert 2.0 * half == pytest.approx(Motion(cell_m=50.0).corner_seconds(degrees), rel=0.02)
    assert costs_of(WIDE).early_s > 0.0
    assert costs_of(Motion.steps()).turns.tolist() == [0] * 5


@given(seed=st.integers(0, 10_000), tied=st.booleans())
@settings(max_examples=25, deadline=None)
def test_the_best_flight_agrees_with_trying_all(seed: int, tied: bool) -> None:
    rng, shape, slots = np.random.default_rng(seed), (3, 3), 9
    start = (int(rng.integers(3)), int(rng.integers(3)))
    worth, price = rng.random((*shape, 2)), rng.random((*shape, 2)) * slots
    labels = rng.integers(0, 2, shape)
    moves, turns = rng.integers(2, 4, 8), np.array([0, 1, 0, 2, 3])
    fixed = np.full(slots + 1, -1)
    if tied:
        fixed[rng.integers(1, slots + 1)] = 1
    best = -np.inf
    for path in flights(shape, start, 5, MOTIONS[0]):  # five moves of two slots are past the last
        directions = [STEPS.index((b[0] - a[0], b[1] - a[1])) for a, b in itertools.pairwise([start, *path])]
        here, at, before, earned, legal = start, 0, -1, 0.0, True
        for cell, direction in zip(path, directions, strict=True):
            apart = (direction - before) & 7
            then = at + int(moves[direction]) + (int(turns[min(apart, 8 - apart)]) if before >= 0 else 0)
            during = fixed[at : min(then, slots + 1)]
            legal = legal and bool(((during < 0) | (during == labels[here])).all())
            if then > slots:
                break
            here, at, before = cell, then, direction
            earned += max(0.0, *(worth[cell] * (10.0 - 0.5 * at) - price[cell]))
        if legal:
            best = max(best, earned)
    allowed = moves_allowed(np.ones(shape, dtype=bool))
    found = best_flight((worth, price), (0.5, 10.0), allowed, labels, start, (moves, turns), fixed)
    assert found == pytest.approx(best)


def test_travel_between_hills_and_turns_are_counted() -> None:
    motion = Motion(cell_m=25.0)
    found = bounds.travel_seconds(far_hills(), (4, 17), 0.9, motion, 400.0, divisions=3)
    assert found.history[0] > found.release
    assert found.expected > 1.05 * found.release
    assert found.classes > 1


def test_in_steps_it_is_the_bound_of_steps() -> None:
    prior = far_hills()
    steps = bounds.travel(prior, (4, 17), 0.9, 120, divisions=0)
    timed = bounds.travel_seconds(prior, (4, 17), 0.9, Motion.steps(), 120.0, divisions=0)
    assert timed.expected == pytest.approx(steps.expected, rel=0.03)


def test_a_cap_of_nothing_is_refused() -> None:
    with pytest.raises(ValueError, match="above 0"):
        bounds.travel_seconds(some_prior(1, (3, 3)), (0, 0), 0.9, MOTIONS[0], 0.0)
