"""A route that is laid down before the flight clears the ground, whatever an autopilot makes of its heights."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from service.config import FlightSettings
from service.ground.route import from_the_side, route_over
from tests.service.mission.flown import GRID, place
from tests.service.mission.test_heights import NEAR, ground_of, metres

FLIGHT = FlightSettings(altitude_m=30.0, clearance_m=15.0)
spots = st.tuples(st.floats(0.0, 260.0), st.floats(0.0, 110.0))


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32), st.floats(0.0, 60.0), st.lists(spots, min_size=2, max_size=5))
def test_the_lower_end_of_every_leg_clears_all_that_is_within_reach_of_it(
    seed: int, rough: float, stops: list[tuple[float, float]]
) -> None:
    relief = ground_of(seed, rough)
    route = route_over(GRID, relief, FLIGHT, [place(*stop) for stop in stops])
    turn = np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False)
    ring = NEAR * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    for (start, low), (end, high) in pairwise(zip(route.points, route.heights, strict=True)):
        a, b = metres(start), metres(end)
        for share in np.linspace(0.0, 1.0, 15):
            middle = a + share * (b - a)
            around = np.vstack([middle[None], middle + ring])
            assert min(low, high) - relief.height_at(around).max() >= FLIGHT.clearance_m
    clear, _ = from_the_side(GRID, relief, route).least
    assert clear >= FLIGHT.clearance_m


def test_over_level_ground_a_route_is_as_high_as_the_search() -> None:
    level = ground_of(1, 0.0)
    level.heights[:] = 0.0
    route = route_over(GRID, level, FLIGHT, [place(0.0, 0.0), place(200.0, 50.0)])
    assert set(route.heights) == {30.0}
