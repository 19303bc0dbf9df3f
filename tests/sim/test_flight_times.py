"""What a run's folder tells of its pace."""

from __future__ import annotations

import pytest

from service.geometry import moved
from service.view.curve import PosCurve
from sim.flight_times import mean_speed


def test_the_mean_speed_is_that_of_the_search_alone_and_a_gap_is_no_flight() -> None:
    here, times, places = (47.0, 8.0), [], []
    for second in range(100):
        times.append(float(second))
        places.append(here)
        here = moved(here, 6.0 if second < 50 else 3.0, 0.0)
    assert mean_speed(times, places, 10.0, 40.0) == pytest.approx(6.0, rel=1e-3)
    assert mean_speed(times, places, 60.0, 90.0) == pytest.approx(3.0, rel=1e-3)
    assert mean_speed(times, places, 200.0, 300.0) is None
    later = [time + (100.0 if time >= 30.0 else 0.0) for time in times]
    assert mean_speed(later, places, 10.0, 140.0) == pytest.approx(6.0, rel=1e-3)


def test_a_curve_says_when_a_pos_was_reached() -> None:
    curve = PosCurve()
    for second, pos in ((100.0, 0.1), (110.0, 0.4), (130.0, 0.6)):
        curve.add(second, pos)
    assert [curve.when(pos) for pos in (0.3, 0.5, 0.9)] == [10.0, 30.0, None]
