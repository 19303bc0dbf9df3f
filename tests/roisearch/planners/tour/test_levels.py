"""A tour over flat ground is no later than a lawnmower at any level of POS; over hills nothing is changed."""

from __future__ import annotations

import time

import numpy as np
import pytest
from numpy.typing import NDArray

from roisearch import Belief, FieldOfView, Motion, SearchState
from roisearch.directions import moves_allowed
from roisearch.planners.tour import levels
from roisearch.planners.tour.desk import Desk, prices_of
from roisearch.planners.tour.levels import LATER, LEVELS, PROPOSALS, keep_up, times_to
from roisearch.planners.tour.planner import TourPlanner
from roisearch.planners.tour.settings import TourSettings

SIDE = 8
MOTION = Motion(cell_m=25.0)


def arranged(worth: NDArray[np.float64]) -> Desk:
    """A desk with a look at every cell of `worth` [SIDE, SIDE], its starts tried."""
    allowed = np.ascontiguousarray(moves_allowed(np.ones(worth.shape, dtype=bool)).ravel())
    desk = Desk(80, worth.size, prices_of(MOTION, allowed, SIDE, True))
    desk.stand((0, 0), 2)
    for cell, each in enumerate(worth.ravel()):
        desk.append(cell, float(each))
    desk.settle()
    desk.arrange(np.inf)
    return desk


def kept_up(desk: Desk, until: float = np.inf, proposal_s: float = 0.0) -> bool:
    step_heat, random = float(desk.prices.axis[0]), np.ones(1, dtype=np.uint64)
    return keep_up(desk, desk.lawnmowers, step_heat, random, until, proposal_s)


def muddle(desk: Desk) -> NDArray[np.int64]:
    """Put the looks in an order that is late at every level."""
    order = np.random.default_rng(1).permutation(desk.lawnmowers[0])
    desk.put(order)
    return order


def test_levels_are_reached_when_the_looks_so_far_are_worth_them() -> None:
    desk = arranged(np.ones((SIDE, SIDE)))
    desk.prices.rest[0] = 0.2 * SIDE * SIDE
    tour, worth = desk.tour, np.ones(desk.size)
    for level, reached in zip(LEVELS, times_to(desk), strict=True):
        looks = np.flatnonzero(np.cumsum(worth) >= level * 1.2 * SIDE * SIDE - 1e-6)
        assert reached == (tour.time[looks[0] + 1] if looks.size else np.inf)
    assert np.isinf(times_to(desk)[-1])  # of what the tour finds and what it leaves


def test_a_late_tour_over_flat_ground_gives_way_to_a_lawnmower() -> None:
    desk = arranged(np.ones((SIDE, SIDE)))
    desk.put(desk.lawnmowers[0])
    soon, cheap = LATER * times_to(desk), desk.cost
    muddle(desk)
    assert (times_to(desk) > soon).all()
    assert kept_up(desk)
    assert (times_to(desk) <= soon).all()
    assert desk.cost <= cheap


@pytest.mark.parametrize("why", ["it is too dear", "there is no time"])
def test_a_late_tour_stays(why: str, monkeypatch: pytest.MonkeyPatch) -> None:
    desk = arranged(np.ones((SIDE, SIDE)))
    order = muddle(desk)
    if why == "it is too dear":
        monkeypatch.setattr(levels, "PAID", 0.01)
    assert not kept_up(desk, 0.0 if why == "there is no time" else np.inf)
    np.testing.assert_array_equal(desk.order(), order)


def test_what_would_not_be_over_in_time_is_not_begun(monkeypatch: pytest.MonkeyPatch) -> None:
    desk, begun = arranged(np.ones((SIDE, SIDE))), 0
    muddle(desk)

    def begin(*_: object) -> float:
        nonlocal begun
        begun += 1
        return 0.0

    monkeypatch.setattr(Desk, "anneal", begin)
    kept_up(desk, time.perf_counter() + 30.0, proposal_s=31.0 / (PROPOSALS * desk.size))
    assert not begun
    kept_up(desk, time.perf_counter() + 30.0, proposal_s=1e-9)
    assert begun


def test_over_a_hill_the_tour_and_the_draws_stay_as_they_are() -> None:
    down, right = np.indices((SIDE, SIDE)) - 3.5
    desk = arranged(np.exp(-0.2 * (down**2 + right**2)))
    order, random = desk.order(), np.full(1, 7, dtype=np.uint64)
    assert not keep_up(desk, desk.lawnmowers, 1.0, random, np.inf)
    np.testing.assert_array_equal(desk.order(), order)
    assert random[0] == 7


def test_the_planner_is_no_later_than_the_best_lawnmower_over_a_flat_square() -> None:
    planner = TourPlanner(
        TourSettings(looks=1000, iterations=0, first=40), fov=FieldOfView.point(0.9), motion=MOTION
    )
    planner.plan(Belief(np.ones((15, 15))), SearchState((3, 4)), np.random.default_rng(0))
    desk = planner._desk  # private: what it means to fly, without flying it
    reached = times_to(desk)
    desk.put(desk.lawnmowers[0])
    assert (reached <= LATER * times_to(desk)).all()
