"""Short distances between places, on both sides of the line where longitude begins anew."""

from __future__ import annotations

import math

import pyproj
import pytest
from hypothesis import given
from hypothesis import strategies as st

from service.geometry import between, distance_m, moved, offset_m, turn_deg, wrapped_deg

GEOD = pyproj.Geod(ellps="WGS84")
NEAR = st.floats(-3000.0, 3000.0)


@given(st.floats(-85.0, 85.0), st.one_of(st.floats(-180.0, 180.0), st.floats(179.98, 180.0)), NEAR, NEAR)
def test_a_move_and_its_offset_are_inverse_and_as_long_as_on_the_ellipsoid(
    lat: float, lon: float, east: float, north: float
) -> None:
    there = moved((lat, lon), east, north)
    assert -180.0 <= there[1] <= 180.0
    assert offset_m((lat, lon), there) == pytest.approx(
        (east, north), abs=1.0 + 0.01 * math.hypot(east, north)
    )
    length = GEOD.inv(lon, lat, there[1], there[0])[2]
    assert distance_m((lat, lon), there) == pytest.approx(length, rel=0.012, abs=0.01)


def test_the_way_over_the_antimeridian_is_short() -> None:
    assert distance_m((10.0, 179.999), (10.0, -179.999)) == pytest.approx(219.0, abs=1.0)
    assert offset_m((10.0, -179.999), (10.0, 179.999))[0] == pytest.approx(-219.0, abs=1.0)


@given(st.floats(-180.0, 180.0))
def test_an_angle_in_its_range_stays_to_the_last_bit(angle: float) -> None:
    assert wrapped_deg(angle) == angle
    assert -180.0 <= turn_deg(angle, 0.0) < 180.0


def test_a_place_between_two_on_both_sides_of_the_antimeridian_lies_between_them() -> None:
    start, end = (10.0, 179.999), (10.002, -179.999)
    lat, lon = between(start, end, 0.75)
    assert (lat, lon) == pytest.approx((10.0015, -179.9995))
    assert between(start, end, 1.0) == pytest.approx(end)
    assert between((47.0, 8.0), (47.4, 8.8), 0.25) == pytest.approx((47.1, 8.2))
