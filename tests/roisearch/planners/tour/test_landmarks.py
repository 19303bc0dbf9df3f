"""The way around: distances from landmarks are those of the plain twin, and a default that reckons with them follows
walls rather than to hop over them."""

from __future__ import annotations

import itertools
import math
import time

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from roisearch import Belief, FieldOfView, Motion, Planner, SearchState, make_planner
from roisearch.directions import STEPS, direction_between, moves_allowed
from roisearch.planners.tour.landmarks import DIAGONAL, FAR, MOST_CELLS, STRAIGHT, apart, landmarks, spread
from roisearch.planners.tour.planner import TourPlanner
from roisearch.planners.tour.settings import TourSettings

MASKS = hnp.arrays(np.bool_, hnp.array_shapes(min_dims=2, max_dims=2, max_side=8))
MOTION = Motion(cell_m=25.0, speed_mps=8.0, acceleration_mps2=1.5)


def slow(flyable: NDArray[np.bool_], start: int) -> NDArray[np.float64]:
    """Distances by a library's Dijkstra."""
    allowed, cols = moves_allowed(flyable).ravel(), flyable.shape[1]
    moves = [
        (cell, cell + down * cols + right, DIAGONAL if d % 2 else STRAIGHT)
        for cell, (d, (down, right)) in itertools.product(range(allowed.size), enumerate(STEPS))
        if allowed[cell] >> d & 1
    ]
    here, there, cost = np.array(moves).reshape(-1, 3).T
    graph = csr_matrix((cost, (here, there)), shape=(allowed.size, allowed.size))
    return np.asarray(dijkstra(graph, indices=start))


@settings(deadline=None, max_examples=60)
@given(MASKS, st.data())
def test_the_distances_are_those_of_the_plain_twin_and_no_way_is_shorter_than_is_said(
    flyable: NDArray[np.bool_], data: st.DataObject
) -> None:
    allowed = np.ascontiguousarray(moves_allowed(flyable).ravel())
    start = data.draw(st.integers(0, allowed.size - 1))
    field, room = np.empty(allowed.size, dtype=np.int32), np.zeros((8, allowed.size), dtype=np.int32)
    spread(start, allowed, flyable.shape[1], field, room, np.zeros(8, dtype=np.int64))
    true = slow(flyable, start)
    np.testing.assert_array_equal(np.where(field == FAR, math.inf, field), true)
    fields = landmarks(allowed, flyable.shape[1], start, math.inf)
    for cell in np.flatnonzero(np.isfinite(true)).tolist():
        assert apart(start, cell, fields) <= true[cell]


def comb(arms: int, length: int) -> NDArray[np.bool_]:
    """Arms two cells wide with a thin wall between each and the next, open at the lower end."""
    flyable = np.ones((length, 3 * arms - 1), dtype=bool)
    flyable[:-2, 2::3] = False
    return flyable


def test_from_arm_to_arm_it_is_known_how_far_it_is() -> None:
    flyable = comb(4, 30)
    allowed = np.ascontiguousarray(moves_allowed(flyable).ravel())
    fields, cols = landmarks(allowed, flyable.shape[1], 0, math.inf), flyable.shape[1]
    true = slow(flyable, 10 * cols + 1)
    assert apart(10 * cols + 1, 10 * cols + 3, fields) == true[10 * cols + 3] > 30 * STRAIGHT


def test_there_are_fewer_where_there_is_no_time_and_none_on_a_large_map() -> None:
    allowed = np.ascontiguousarray(moves_allowed(comb(4, 30)).ravel())
    assert len(landmarks(allowed, 11, 0, time.perf_counter() - 1.0)) == 0
    assert landmarks(np.zeros(MOST_CELLS + 1, dtype=np.uint8), 1, 0, math.inf).size == 0


def flown(planner: Planner, prior: NDArray[np.float64]) -> float:
    """Expected seconds until the first true detection, up to nine tenths of them."""
    belief, left, path, found = Belief(prior), prior.copy(), [], []
    state, rng = SearchState((0, 0), "south"), np.random.default_rng(1)
    while sum(found) < 0.9:
        for cell in planner.plan(belief, state, rng).path[:16]:
            state = SearchState(cell, direction_between(state.cell, cell), MOTION.speed_mps)
            path.append(cell)
            found.append(0.9 * left[cell])
            left[cell] *= 0.1
            belief.observe([cell], False, 0.9, 1.0)
    times = MOTION.arrivals(path, (0, 0), "south")
    return float(times @ np.array(found)) + (1.0 - sum(found)) * float(times[-1])


def test_behind_thin_walls_it_is_no_later_than_a_survey() -> None:
    """Valleys: it hopped over the walls in mind, and flew around them: a third later than the survey."""
    flyable = comb(4, 40)
    prior = np.exp(-((np.indices(flyable.shape)[0] - 6.0) ** 2) / 800.0) * flyable
    prior /= prior.sum()
    fov = FieldOfView.point(0.9, 1.0)
    default = TourPlanner(TourSettings(first=200), fov=fov, motion=MOTION, flyable=flyable)
    survey = make_planner("survey", fov=fov, motion=MOTION, flyable=flyable)
    assert flown(default, prior) < flown(survey, prior)
