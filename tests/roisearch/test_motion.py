"""How long a path takes: against a slow twin, by laws, and against flights of the mock autopilot."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from roisearch import FieldOfView, Motion, SearchState
from roisearch.directions import DIRECTIONS, STEPS, direction_index, moves_allowed
from roisearch.motion import Cell
from roisearch.motion_fit import Flown, learnt
from tests.mock_flights import flown

STRIDE_M = 0.01


def walked(moves: list[int], start: Cell = (0, 0)) -> list[Cell]:
    """The cells entered from `start` by moves in eight directions."""
    path, here = [], start
    for move in moves:
        here = (here[0] + STEPS[move][0], here[1] + STEPS[move][1])
        path.append(here)
    return path


def slow_arrivals(motion: Motion, moves: list[int], heading: int) -> NDArray[np.float64]:
    """The plain twin: from a stand, a speed limit for each centimetre of the track, speed up, brake, add up."""
    pace = motion.pace
    limit: list[float] = []
    middles: list[int] = []
    turns = [0] + [min((b - a) % 8, (a - b) % 8) for a, b in itertools.pairwise(moves)] + [0]
    for i, move in enumerate(moves):
        length = pace.diagonal_m if move % 2 else pace.straight_m
        begin, end = turns[i], turns[i + 1]
        limit += [pace.speed[begin]] * round(0.5 * pace.arc[begin] / STRIDE_M)
        limit += [pace.cruise[move]] * round((length - pace.zone[begin] - pace.zone[end]) / STRIDE_M)
        limit += [pace.speed[end]] * round(0.5 * pace.arc[end] / STRIDE_M)
        middles.append(len(limit))
    bounds = np.array([*limit, math.inf])
    speeds = np.minimum(bounds, np.concatenate([[0.0], bounds[:-1]]))
    for middle, turn in zip([0, *middles], turns, strict=True):
        speeds[middle] = min(speeds[middle], pace.speed[turn])
    speeds[0] = 0.0
    for i in range(1, speeds.size):
        speeds[i] = min(speeds[i], math.sqrt(speeds[i - 1] ** 2 + 2.0 * pace.accelerate * STRIDE_M))
    for i in range(speeds.size - 2, -1, -1):
        speeds[i] = min(speeds[i], math.sqrt(speeds[i + 1] ** 2 + 2.0 * pace.brake * STRIDE_M))
    seconds = np.concatenate([[0.0], np.cumsum(2.0 * STRIDE_M / (speeds[1:] + speeds[:-1]))])
    stood = [pace.wait[min((moves[0] - heading) % 8, (heading - moves[0]) % 8)]]
    stood += [pace.wait[turn] if pace.speed[turn] == 0.0 else 0.0 for turn in turns[1:-1]]
    return np.array(seconds[middles] + np.cumsum(stood))


@st.composite
def motions(draw: st.DrawFn, least_braking: float = 0.7) -> Motion:
    """Motions that brake with at least this part of what they speed up with."""
    acceleration = draw(st.floats(1.0, 5.0))
    return Motion(
        cell_m=draw(st.floats(15.0, 60.0)),
        speed_mps=draw(st.floats(3.0, 12.0)),
        acceleration_mps2=acceleration,
        braking_mps2=acceleration * draw(st.floats(least_braking, 3.0)),
        corner_m=draw(st.sampled_from([0.0, 2.0, 5.0])),
        turning_dps=draw(st.sampled_from([30.0, math.inf])),
    )


MOVES = st.lists(st.integers(0, 7), min_size=1, max_size=12)


@settings(deadline=None, max_examples=60)
@given(motions(), MOVES, st.integers(0, 7))
def test_arrivals_agree_with_the_slow_twin(motion: Motion, moves: list[int], heading: int) -> None:
    fast = motion.arrivals(walked(moves), (0, 0), DIRECTIONS[heading])
    np.testing.assert_allclose(fast, slow_arrivals(motion, moves, heading), rtol=0.02, atol=0.1)


@settings(deadline=None, max_examples=60)
@given(motions(least_braking=0.2), MOVES, st.integers(0, 7))
@example(Motion(cell_m=15.0, speed_mps=6.0, acceleration_mps2=3.0, braking_mps2=1.0), [1, 2, 0], 0)
def test_who_brakes_weakly_is_reckoned_slower_and_never_faster(
    motion: Motion, moves: list[int], heading: int
) -> None:
    """Each corner has one speed, so what has to be braked in one for the next is braked before it."""
    fast, slow = (
        motion.arrivals(walked(moves), (0, 0), DIRECTIONS[heading]),
        slow_arrivals(motion, moves, heading),
    )
    assert (fast >= 0.98 * slow - 0.1).all()
    assert (fast <= 1.2 * slow + 0.1).all()


@settings(deadline=None, max_examples=40)
@given(motions(least_braking=0.2), MOVES, st.floats(0.0, 12.0))
def test_time_only_goes_on_and_nothing_is_faster_than_the_straight_line_at_full_speed(
    motion: Motion, moves: list[int], speed: float
) -> None:
    path = walked(moves)
    times = motion.arrivals(path, (0, 0), "north", min(speed, motion.speed_mps))
    assert (np.diff([0.0, *times]) > 0.0).all()
    straight = motion.cell_m * np.hypot(*np.array(path).T) / motion.speed_mps
    rounded = 2.0 * motion.corner_m * len(moves) / motion.speed_mps  # an arc is shorter than its corner
    assert (times >= straight - rounded - 1e-9).all()


def test_steps_are_the_papers_world() -> None:
    steps = Motion.steps()
    assert steps.is_steps
    assert not Motion(cell_m=25.0).is_steps
    path = walked([2, 2, 4, 6, 6, 0, 2])
    np.testing.assert_array_equal(steps.arrivals(path, (0, 0), "south"), np.arange(1.0, 8.0))
    with pytest.raises(ValueError, match="four neighbours"):
        steps.arrivals([(1, 1)], (0, 0))


def test_a_long_leg_is_the_textbook_sum() -> None:
    motion = Motion(cell_m=25.0, speed_mps=8.0, acceleration_mps2=2.0, corner_m=0.0)
    there = motion.arrivals(walked([2] * 8), (0, 0), "east")[-1]
    assert there == pytest.approx(4.0 + (200.0 - 16.0) / 8.0)
    back = motion.arrivals(walked([2] * 8 + [6] * 8), (0, 0), "east")[-1]
    assert back == pytest.approx(4.0 + (200.0 - 32.0) / 8.0 + 4.0 + 4.0 + (200.0 - 16.0) / 8.0)


def flown_numerically(length: float, motion: Motion) -> float:
    """Seconds for a leg, millisecond by millisecond: full power until it is time to brake."""
    at = speed = seconds = 0.0
    step, pace = 1e-3, motion.pace
    while at < length - 0.001 and seconds < 1e3:
        braking = speed**2 / (2.0 * pace.brake) >= length - at
        speed = min(motion.speed_mps, max(speed + (-pace.brake if braking else pace.accelerate) * step, 0.02))
        at, seconds = at + speed * step, seconds + step
    return seconds


@pytest.mark.parametrize("length", [5.0, 25.0, 42.0, 43.0, 300.0])
@pytest.mark.parametrize("braking", [0.5, 1.5])
def test_a_leg_takes_what_speeding_up_and_braking_take(length: float, braking: float) -> None:
    motion = Motion(cell_m=25.0, acceleration_mps2=2.0, braking_mps2=braking)
    assert motion.leg_seconds(length) == pytest.approx(
        flown_numerically(length, motion), abs=0.4
    )  # it creeps at the end


def test_turning_on_the_spot_costs_where_it_stops() -> None:
    turning = Motion(cell_m=25.0, corner_m=0.0, turning_dps=45.0)
    sliding = Motion(cell_m=25.0, corner_m=0.0)
    path = walked([2, 2, 4, 4, 0])
    more = turning.arrivals(path, (0, 0), "north") - sliding.arrivals(path, (0, 0), "north")
    np.testing.assert_allclose(more, [2.0, 2.0, 4.0, 4.0, 8.0])


def test_headwind_slows_and_an_impossible_wind_is_refused() -> None:
    windy = Motion(cell_m=25.0, wind_mps=(0.0, -5.0), airspeed_mps=10.0)
    east = windy.arrivals(walked([2] * 10), (0, 0), "east", 5.0)
    west = windy.arrivals(walked([6] * 10), (0, 0), "west", 8.0)
    assert east[-1] == pytest.approx(250.0 / 5.0)
    assert west[-1] == pytest.approx(250.0 / 8.0)
    with pytest.raises(ValueError, match="cannot fly"):
        Motion(cell_m=25.0, wind_mps=(0.0, -12.0), airspeed_mps=10.0)


def test_climbing_takes_the_time_it_takes() -> None:
    motion = Motion(cell_m=25.0, climb_mps=2.0)
    flat = motion.arrivals(walked([2, 2, 2]), (0, 0), "east", 8.0)
    steep = motion.arrivals(walked([2, 2, 2]), (0, 0), "east", 8.0, heights=[0.0, 0.0, 20.0, 20.0])
    assert steep[-1] - flat[-1] == pytest.approx(10.0 - 25.0 / 8.0)


def test_sinking_takes_longer_than_climbing_where_it_is_slower() -> None:
    motion = Motion(cell_m=25.0, climb_mps=2.0, descent_mps=1.0)
    flat = motion.arrivals(walked([2, 2]), (0, 0), "east", 8.0)[-1]
    for there, seconds in ((10.0, 5.0), (-10.0, 10.0)):
        took = motion.arrivals(walked([2, 2]), (0, 0), "east", 8.0, heights=[0.0, there, there])[-1]
        assert took - flat == pytest.approx(seconds - 25.0 / 8.0)
    np.testing.assert_allclose(motion.upright_s([4.0, -4.0, 0.0]), [2.0, 4.0, 0.0])


@settings(deadline=None, max_examples=80)
@given(
    st.lists(st.tuples(st.floats(0.1, 30.0), st.floats(-50.0, 50.0)), min_size=1, max_size=12),
    st.tuples(st.floats(0.0, 25.0), st.floats(0.0, 25.0)),
)
def test_the_climb_is_that_of_its_plain_twin(
    moves: list[tuple[float, float]], slack: tuple[float, float]
) -> None:
    motion = Motion(cell_m=25.0, climb_mps=2.0, descent_mps=1.0, slack_m=slack)
    across, heights = (np.array(each) for each in zip(*moves, strict=True))
    times, along = np.concatenate([[0.0], np.cumsum(across)]), np.concatenate([[0.0], heights])
    now, height, said = 0.0, 0.0, [0.0]
    for seconds, wanted in zip(across, heights, strict=True):
        reached = np.clip(wanted, height - seconds * 1.0, height + seconds * 2.0)
        least, most = wanted - slack[0], wanted + slack[1]
        now += seconds + max(0.0, (least - reached) / 2.0) + max(0.0, (reached - most) / 1.0)
        height = float(np.clip(reached, least, most))
        said.append(now)
    found = motion.climbed(times, along)
    np.testing.assert_allclose(found, said, atol=1e-9)
    assert (np.diff(found) >= across - 1e-9).all()
    if slack == (0.0, 0.0):
        np.testing.assert_allclose(np.diff(found), np.maximum(across, motion.upright_s(np.diff(along))))


def test_legs_are_the_straight_parts() -> None:
    legs = Motion(cell_m=25.0).legs(walked([2, 2, 3, 3, 3, 4]), (0, 0))
    assert [(leg.end, leg.direction, leg.cells) for leg in legs] == [
        ((0, 2), "east", 2), ((3, 5), "south-east", 3), ((4, 5), "south", 1)
    ]  # fmt: skip


@pytest.mark.parametrize(
    "bad",
    [
        {"speed_mps": 0.0},
        {"corner_m": -1.0},
        {"acceleration_mps2": math.nan},
        {"corners_mps": (1.0,)},
        {"descent_mps": 0.0},
        {"slack_m": (-1.0, 0.0)},
    ],
)
def test_values_out_of_range_are_refused_by_name(bad: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=next(iter(bad))):
        Motion(cell_m=25.0, **bad)  # type: ignore[arg-type]


def test_no_corner_of_unflyable_ground_is_cut() -> None:
    flyable = np.ones((3, 3), dtype=bool)
    flyable[0, 1] = False
    allowed = moves_allowed(flyable)
    north_east, north, west = (direction_index(name) for name in ("north-east", "north", "west"))
    assert not allowed[1, 0] >> north_east & 1  # passes the corner of the cell that must not be entered
    assert allowed[1, 0] >> north & 1
    assert not allowed[1, 1] >> north & 1
    assert allowed[2, 0] >> north_east & 1
    assert not allowed[0, 0] >> west & 1
    assert not (moves_allowed(flyable, diagonal=False) & 0b10101010).any()


def test_a_state_has_eight_directions_and_a_speed() -> None:
    assert SearchState((1, 1), "south-west", 7.5).speed_mps == 7.5
    with pytest.raises(ValueError, match="direction"):
        SearchState((1, 1), "up")
    with pytest.raises(ValueError, match="speed_mps"):
        SearchState((1, 1), "east", -1.0)
    seen = FieldOfView.wide_angle().cells((5, 5), "north-east", (11, 11))
    assert len(seen) == 8


def loops(side: int, across: int, cells: int) -> list[Cell]:
    """A lawnmower: lanes of `side` cells, `across` cells apart."""
    moves = ([2] * side + [4] * across + [6] * side + [4] * across) * cells
    return [(0, 0), *walked(moves[:cells])]


def random_walk(cells: int, seed: int) -> list[Cell]:
    rng, moves, heading = np.random.default_rng(seed), [], 2
    while len(moves) < cells:
        moves += [heading] * int(rng.integers(1, 7))
        heading = (heading + int(rng.choice([2, 6]))) % 8
    return [(0, 0), *walked(moves[:cells])]


@pytest.mark.parametrize("flavour", ["px4", "ardupilot"])
def test_what_one_flight_taught_holds_for_others_of_the_mock(flavour: str) -> None:
    lesson = random_walk(120, 1)
    motion = learnt(Motion(cell_m=25.0), [Flown(lesson[0], "east", lesson[1:], flown(lesson, flavour))])
    for path in (loops(20, 5, 200), loops(6, 1, 200), loops(2, 2, 200), random_walk(200, 2)):
        took = np.diff([0.0, *flown(path, flavour)])
        said = np.diff([0.0, *motion.arrivals(path[1:], path[0], "east")])
        moves = np.diff(np.array(path), axis=0)
        corner = (moves[1:] != moves[:-1]).any(axis=1)
        near = np.concatenate([[False], corner]) | np.concatenate([corner, [False]])
        near[0] = False
        assert said.sum() == pytest.approx(took.sum(), rel=0.05)
        assert said[near].sum() == pytest.approx(took[near].sum(), rel=0.05)
        if (~near).sum() > 20:
            assert said[~near].sum() == pytest.approx(took[~near].sum(), rel=0.05)
