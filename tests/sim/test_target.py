"""The simulated target lies where the prior says, as often as it says, and walks as the belief reckons."""

from __future__ import annotations

import numpy as np
import pytest

from roisearch import Belief, Walk
from sim.target import Tour, draw_target, draw_tour


def test_targets_are_drawn_as_often_as_the_prior_says() -> None:
    prior = np.array([[0.0, 0.5], [0.2, 0.3]])
    rng = np.random.default_rng(1)
    drawn = np.zeros((2, 2))
    for _ in range(4000):
        row, col = draw_target(prior, rng)
        drawn[int(row), int(col)] += 1
    assert drawn / 4000 == pytest.approx(prior, abs=0.03)


def test_the_same_seed_draws_the_same_target() -> None:
    prior = np.full((3, 4), 1 / 12)
    assert draw_target(prior, np.random.default_rng(7)) == draw_target(prior, np.random.default_rng(7))


def test_targets_walk_as_far_as_the_belief_reckons() -> None:
    walk, size, seconds = Walk(0.5, 10.0), 81, 900.0
    prior = np.zeros((size, size))
    prior[40, 40] = 1.0
    belief = Belief(prior, walk=walk)
    belief.drift(seconds)
    rows = np.arange(size) + 0.5
    reckoned = float((belief.probability().sum(axis=1) * (rows - 40.5) ** 2).sum())
    rng, everywhere = np.random.default_rng(2), np.ones((size, size), dtype=bool)
    ends = np.array(
        [draw_tour((40.5, 40.5), walk, everywhere, seconds, rng).at(seconds) for _ in range(1500)]
    )
    walked = float(((ends - 40.5) ** 2).mean())
    # a random tour starts straight on: 2 v^2 T (t - T) of its 2 v^2 T t are left after a time t much above T
    assert walked == pytest.approx(reckoned * (1.0 - 60.0 / seconds), rel=0.08)


def test_a_tour_stays_on_open_cells_and_ends_when_the_target_stops() -> None:
    open_cells = np.zeros((5, 9), dtype=bool)
    open_cells[2, 1:8] = True
    walk = Walk(1.0, 10.0, stops_per_hour=20.0)
    ends = []
    for seed in range(20):
        tour = draw_tour((2.5, 4.5), walk, open_cells, 7200.0, np.random.default_rng(seed))
        rows, cols = np.floor(tour.places).astype(int).T
        assert open_cells[rows, cols].all()
        assert (np.diff(tour.seconds) >= 0.0).all()
        legs = np.linalg.norm(np.diff(tour.places, axis=0), axis=1) * 10.0
        assert (legs <= np.diff(tour.seconds) * 1.0 + 1e-9).all()  # never faster than it walks
        assert tour.at(1e6) == tuple(tour.places[-1])
        ends.append(tour.seconds[-1])
    assert 60.0 < np.mean(ends) < 500.0  # 180 s is the mean


def test_a_tour_is_between_its_places_in_between() -> None:
    tour = Tour(np.array([0.0, 10.0]), np.array([[0.0, 0.0], [1.0, 2.0]]))
    assert tour.at(5.0) == (0.5, 1.0)


def test_a_target_keeps_to_ground_that_is_walked_as_the_belief_has_it() -> None:
    """Where it has walked for long, it is in each cell as often as that is easily entered; not in water."""
    mobility = np.array([[1.0, 0.25, 1.0], [0.5, 0.0, 0.5], [1.0, 0.25, 1.0]])
    walk = Walk(speed_mps=1.0, cell_m=10.0, straight_s=10.0, mobility=mobility)
    tour = draw_tour((0.5, 0.5), walk, np.ones((3, 3), dtype=bool), 150_000.0, np.random.default_rng(3))
    places = np.floor([tour.at(second) for second in range(0, 150_000, 5)]).astype(int)
    share = np.zeros((3, 3))
    np.add.at(share, (places[:, 0], places[:, 1]), 1.0 / len(places))
    assert share[1, 1] < 1e-3, "a stride may cut a corner"
    assert share == pytest.approx(mobility / mobility.sum(), abs=0.04)
