"""How well the ground has been searched, and where the target most likely is."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from roisearch.detection import DetectionRecord
from roisearch.place import most_likely_place


def one(cell: tuple[int, int]) -> NDArray[np.int64]:
    return np.array([cell])


def test_two_looks_leave_a_hundredth_at_p_tp_nine_tenths() -> None:
    record = DetectionRecord(np.full((2, 2), 0.25))
    record.look(one((0, 1)), np.array([0.9]))
    record.look(one((0, 1)), np.array([0.9]))
    assert record.pod()[0, 1] == pytest.approx(0.99)
    assert record.pos == pytest.approx(0.25 * 0.99)


def test_pos_counts_the_mass_outside_and_searched_does_not() -> None:
    record = DetectionRecord(np.ones((1, 2)), outside=0.5)
    record.look(one((0, 0)), np.array([1.0]))
    assert record.pos == pytest.approx(0.25)
    assert record.searched == pytest.approx(0.5)


@given(st.lists(st.tuples(st.integers(0, 3), st.integers(0, 4), st.floats(0.01, 1.0)), max_size=60))
def test_the_running_pos_is_the_sum_of_poa_times_pod(looks: list[tuple[int, int, float]]) -> None:
    prior = np.arange(1.0, 21.0).reshape(4, 5)
    record = DetectionRecord(prior, outside=0.2)
    for row, col, p_tp in looks:
        record.look(one((row, col)), np.array([p_tp]))
    assert record.pos == pytest.approx(float((0.8 * prior / prior.sum() * record.pod()).sum()), abs=1e-12)


def test_the_place_is_the_peak_with_its_neighbours() -> None:
    belief = np.zeros((6, 6))
    belief[2, 3], belief[2, 4], belief[5, 0] = 0.6, 0.2, 0.2
    place = most_likely_place(belief)
    assert place.cell == (2, 3)
    assert place.probability == pytest.approx(0.8)
    assert place.centroid == (pytest.approx(2.0), pytest.approx(3.25))
    assert place.covariance[1, 1] > place.covariance[0, 0] == pytest.approx(1 / 12)


def test_a_peak_at_the_border_has_fewer_neighbours() -> None:
    belief = np.zeros((3, 3))
    belief[0, 0], belief[1, 1] = 0.75, 0.25
    assert most_likely_place(belief).probability == pytest.approx(1.0)


def test_an_empty_map_has_no_place() -> None:
    assert most_likely_place(np.zeros((3, 3))).probability == 0.0
