"""The ruler for a target that walks agrees with walks that are drawn one by one."""

from __future__ import annotations

import numpy as np
import pytest

from roisearch import FieldOfView, Motion, Walk, make_planner
from sim.ruler_walking import Chase, Course, chase

MOTION = Motion(cell_m=20.0, speed_mps=8.0, acceleration_mps2=float("inf"))
PRIOR = np.ones((5, 6)) / 30.0


def course(walk: Walk) -> Course:
    planner = make_planner(
        "puct-regions-lite", fov=FieldOfView.point(0.9, 1.0), motion=MOTION, first=2, proposals=50
    )
    return chase(planner, PRIOR, np.random.default_rng(1), Chase(walk, MOTION, until_s=200.0))


def test_f_is_what_drawn_walks_find() -> None:
    walk = Walk(1.0, 20.0)
    flown, rng, caught = course(walk), np.random.default_rng(2), 0
    tick, count = walk.tick_us / 1e6, 3000
    for _ in range(count):
        at, ticks = np.array([rng.integers(5), rng.integers(6)]), 0
        for cell, time in zip(flown.path, flown.times, strict=True):
            while (ticks + 1) * tick <= time + 1e-9:
                ticks += 1
                step = rng.integers(8)  # one in eight to each of four neighbours
                there = at + np.array([(-1, 0), (1, 0), (0, -1), (0, 1), *[(0, 0)] * 4])[step]
                if ((there >= 0) & (there < (5, 6))).all():
                    at = there
            if (cell == at).all() and rng.random() < 0.9:
                caught += 1
                break
    assert caught / count == pytest.approx(flown.at(200.0), abs=0.03)


def test_expected_seconds_are_the_area_above_f() -> None:
    flown = Course(np.zeros((2, 2), dtype=np.int64), np.array([10.0, 30.0]), np.array([0.5, 1.0]))
    assert flown.expected(100.0) == pytest.approx(20.0)
    assert flown.expected(20.0) == pytest.approx(15.0)
    assert (flown.at(9.0), flown.at(10.0), flown.at(31.0)) == (0.0, 0.5, 1.0)
