"""The ruler in seconds is that in steps where a step takes a second, and counts turns where they cost."""

from __future__ import annotations

import numpy as np
import pytest

from roisearch import Belief, FieldOfView, Motion, SearchState, make_planner
from roisearch.bounds import expected_time
from roisearch.directions import direction_between
from sim.ruler import Ruler, detection_curve
from sim.ruler_seconds import Chance, How, TimedFlight, fly, in_a_copy

FOV = FieldOfView.point(0.9, 1.0)
MOTION = Motion(cell_m=25.0)
PRIOR = np.outer(np.hanning(14)[1:-1], np.hanning(17)[1:-1])
PRIOR /= PRIOR.sum()


def test_with_a_second_a_step_it_is_the_ruler_in_steps() -> None:
    how = How((0, 0), fov=FOV, steps=300)
    flight = fly(make_planner("index", fov=FOV), PRIOR, Motion.steps(), np.random.default_rng(0), how)
    ruler = Ruler(0.9, 1.0, FOV, stop_below=5e-5)
    curve = detection_curve(
        make_planner("index", fov=FOV), PRIOR, (0, 0), 300, ruler, np.random.default_rng(0)
    )
    times = np.arange(1.0, flight.found.size + 1.0)
    np.testing.assert_array_equal(flight.times, times)
    np.testing.assert_allclose(np.cumsum(flight.found), curve[1 : times.size + 1], atol=1e-12)
    assert flight.expected(300.0) == pytest.approx(expected_time(curve), rel=0.01)
    assert curve[int(flight.time_to(0.5))] >= 0.5


def test_the_same_looks_take_longer_where_turns_cost() -> None:
    motion, level = Motion(cell_m=8.0), Motion(cell_m=8.0, acceleration_mps2=1e6, corner_m=0.0)
    how = How((0, 0), fov=FOV, steps=100)
    flights = [
        fly(make_planner("index", fov=FOV), PRIOR, each, np.random.default_rng(0), how)
        for each in (motion, level)
    ]
    np.testing.assert_array_equal(flights[0].path, flights[1].path)
    assert flights[0].times[-1] > 1.2 * flights[1].times[-1]


def noisy(sequels: int, p_tn: float = 0.9) -> tuple[TimedFlight, How]:
    how = How((0, 0), fov=FieldOfView.point(0.9, p_tn), stop_below=0.05, sequels=sequels)
    planner = make_planner("survey", fov=how.fov, motion=MOTION)
    return fly(planner, PRIOR, MOTION, np.random.default_rng(3), how), how


def test_the_looks_at_a_cell_say_the_same_in_whatever_order_they_come() -> None:
    one, other = Chance(5, (7, 9)), Chance(5, (7, 9))
    cells = np.array([(0, 0), (6, 8), (3, 4)])
    first, second = one.draw(cells), one.draw(cells)
    again = np.array([other.draw(cells[[i]])[0] for i in (2, 0, 1)])
    np.testing.assert_array_equal(again, first[[2, 0, 1]])
    np.testing.assert_array_equal(other.draw(cells), second)
    assert not (first == second).any()
    assert not (Chance(6, (7, 9)).draw(cells) == first).any()
    many = Chance(1, (100, 100)).draw(np.argwhere(np.ones((100, 100))))
    assert np.histogram(many, 10, (0, 1))[0] == pytest.approx(np.full(10, 1000), abs=130)


def test_what_follows_a_hit_is_what_the_flight_with_a_target_there_does() -> None:
    flight, how = noisy(6)
    assert len(flight.sequels) == 6
    assert any(len(each.cells) for each in flight.sequels)
    for sequel, seconds in zip(flight.sequels, flight.after, strict=True):
        rng = np.random.default_rng(3)
        chance = Chance(int(rng.integers(2**63)), PRIOR.shape)
        planner, belief = make_planner("survey", fov=how.fov, motion=MOTION), Belief(PRIOR)
        target, state, path = None, SearchState((0, 0)), []
        while target is None or belief.mass_at([target])[0] < how.found_at:
            cell = planner.plan(belief, state, rng).path[0]
            state = SearchState(cell, direction_between(state.cell, cell), MOTION.speed_mps)
            path.append(cell)
            (draw,) = chance.draw(np.array([cell]))
            if len(path) == sequel.begun + 1:
                target = cell
            first = target is not None and len(path) == sequel.begun + 1
            belief.observe([cell], first or bool(draw < 0.9 if cell == target else draw >= 0.9), 0.9, 0.9)
        assert path == [
            tuple(cell) for cell in [*flight.path[: sequel.begun + 1].tolist(), *sequel.cells.tolist()]
        ]
        times = MOTION.arrivals(path, (0, 0))
        assert seconds == pytest.approx(times[-1] - times[sequel.begun])


def test_sequels_change_nothing_of_the_flight_and_a_sure_hit_has_none() -> None:
    without, _ = noisy(0)
    flight, _ = noisy(4)
    np.testing.assert_array_equal(flight.path, without.path)
    assert flight.expected_found(5000.0) > flight.expected(5000.0)
    sure, _ = noisy(4, p_tn=1.0)
    assert sure.after == (0.0,) * 4
    assert sure.expected_found(5000.0) == sure.expected(5000.0)


def test_work_in_a_copy_changes_nothing_here_and_its_failure_is_told() -> None:
    here = [1]

    def work() -> int:
        here.append(2)
        return len(here)

    assert in_a_copy(work) == 2
    assert here == [1]
    with pytest.raises(RuntimeError, match="could not be flown"):
        in_a_copy(lambda: 1 // 0)


def test_the_same_cells_are_timed_by_another_aircraft() -> None:
    flight, how = noisy(4)
    brisk = flight.timed_by(Motion(cell_m=25.0, acceleration_mps2=3.0), how)
    assert brisk.times[-1] < flight.times[-1]
    assert all(quick <= slow for quick, slow in zip(brisk.after, flight.after, strict=True))
    np.testing.assert_array_equal(flight.timed_by(MOTION, how).times, flight.times)
