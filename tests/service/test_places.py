"""Places in the words of teams, judged by what those who keep the grids have published."""

from __future__ import annotations

import re

import mgrs
import pyproj
import pytest
from hypothesis import given
from hypothesis import strategies as st

from service.geometry import distance_m
from service.places import written

LAT = st.floats(-89.0, 89.0)
LON = st.floats(-180.0, 180.0)


@pytest.mark.parametrize(
    ("how", "said"),
    [
        ("degrees", "47.051922, 8.301092"),
        ("minutes", "47° 03.115′ N, 008° 18.066′ E"),
        ("utm", "32T 446917 5211171"),
        ("mgrs", "32T MT 46916 11171"),
    ],
)
def test_a_place_is_written_as_asked(how: str, said: str) -> None:
    assert written((47.051922, 8.301092), how) == said  # type: ignore[arg-type]


def test_south_and_west_are_said() -> None:
    assert written((-33.5, -0.00001), "minutes") == "33° 30.000′ S, 000° 00.001′ W"
    assert written((-33.5, 18.4), "utm").startswith("34H ")


def test_minutes_never_are_sixty() -> None:
    assert written((46.9999999, 7.9999999), "minutes") == "47° 00.000′ N, 008° 00.000′ E"


def test_norway_has_its_own_zones() -> None:
    assert written((60.5, 5.0), "utm").startswith("32V ")
    assert written((78.0, 20.0), "mgrs").startswith("33X ")


def test_the_grid_of_great_britain_is_that_of_its_keeper() -> None:
    """Ordnance Survey, A guide to coordinate systems in Great Britain, annex C: the water tower at Caister is at
    WGS84 52°39'28.723" N, 1°42'57.787" E and at TG 51409 13177."""
    tower = (52 + 39 / 60 + 28.723 / 3600, 1 + 42 / 60 + 57.787 / 3600)
    assert written(tower, "osgb") == "TG 5140 1317"


def test_where_a_grid_does_not_go_degrees_are_written() -> None:
    assert written((47.05, 8.3), "osgb") == "47.050000, 8.300000"
    assert written((49.8, -8.9), "osgb") == "49.800000, -8.900000"
    assert written((86.0, 20.0), "utm") == "86.000000, 20.000000"


@given(
    LAT.filter(lambda lat: abs(lat) > 1e-4), LON
)  # at the equator itself GeoTrans does not read what it wrote
def test_mgrs_is_the_square_metre_that_a_place_lies_in(lat: float, lon: float) -> None:
    text = written((lat, lon), "mgrs").replace(" ", "")
    south_west = mgrs.MGRS().toLatLon(text)
    assert distance_m((lat, lon), south_west) < 3.0  # a metre square, and a sphere of 0.3 %


@given(st.floats(-79.9, 83.9), LON)
def test_utm_leads_back(lat: float, lon: float) -> None:
    zone, east, north = written((lat, lon), "utm").split(" ")
    number, band = re.fullmatch(r"(\d+)([C-X])", zone).groups()  # type: ignore[union-attr]
    crs = (32700 if band < "N" else 32600) + int(number)
    back = pyproj.Transformer.from_crs(crs, 4326, always_xy=True).transform(float(east), float(north))
    assert distance_m((lat, lon), (back[1], back[0])) < 1.5


@pytest.mark.parametrize("how", ["degrees", "minutes", "utm", "mgrs", "osgb"])
@given(st.floats(), st.floats(-1e6, 1e6))
def test_any_place_is_written_somehow_and_never_an_error(how: str, lat: float, lon: float) -> None:
    assert written((lat, lon), how)  # type: ignore[arg-type]
