"""What the way home takes from every cell: the same as the flight reckons it from there."""

from __future__ import annotations

import json
import threading
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from service.area import build_grid, parse_area, way_home
from service.config import FlightSettings
from service.geometry import LatLon, offset_m
from service.mavlink.telemetry import Wind
from service.mission.energy import Energy, Left, WayHome
from service.reach import Reach
from tests.service.area.files import at, box, collection, feature, point, polygon

FLIGHT = FlightSettings()
WALLED = build_grid(
    parse_area(
        json.dumps(
            collection(
                feature(polygon(box(0, 0, 300, 300))),
                feature(polygon(box(40, 120, 260, 160)), role="exclude"),
                feature(point(at(150, -20)), role="launch"),
            )
        ).encode(),
        source="field",
    ),
    20.0,
)


def left(wind: Wind | None = None, ground: float = 500.0, search: float = 450.0) -> Left:
    way = WayHome.along([(0.0, 0.0)], 30.0, wind, FLIGHT)
    return Left(ground, search, way.seconds, way.upright_s, WALLED.launch, wind)


@pytest.mark.parametrize("wind", [None, Wind(6.0, -9.0), Wind(0.0, -15.4)])
def test_from_every_cell_it_is_what_the_flight_reckons_there(wind: Wind | None) -> None:
    seconds = Reach(WALLED, FLIGHT).home_s(left(wind))
    around = 0
    for row, col in np.argwhere(WALLED.flyable)[::7].tolist():
        lat, lon = WALLED.frame.to_latlon([(row, col)])[0]
        here = (float(lat), float(lon))
        points = [here, *way_home(WALLED, here, WALLED.launch)]
        around += len(points) > 2
        way = WayHome.along([offset_m(here, to) for to in points], 30.0, wind, FLIGHT)
        assert seconds[row, col] == pytest.approx(way.seconds, rel=1e-3), (row, col)
    assert around > 5


def test_no_cell_is_entered_when_its_search_must_be_over() -> None:
    """The least level counts wherever the aircraft is, the way home only from there."""
    endurance = Reach(WALLED, FLIGHT).endurance(left(ground=500.0, search=300.0))
    assert endurance.home_s.min() == 200.0
    assert endurance.search_s((0, 0)) <= 300.0


def test_what_is_left_is_what_the_rule_permits() -> None:
    """At the moment when planning says that the search must be over here, the rule says so, and not before."""
    home = WayHome.along([(0.0, 0.0), (800.0, 0.0)], 30.0, None, FLIGHT)
    for percent in (48.0, 60.0, 95.0):
        energy = Energy(percent, 0.11, home)
        what = energy.left(100.0, WALLED.launch, FLIGHT)
        assert what is not None
        for seconds, low in ((what.spare_s - 1.0, False), (what.spare_s + 0.1, True)):
            then = replace(energy, percent=percent - 0.11 * seconds)
            assert bool(then.objection(100.0 + seconds, FLIGHT)) is low
    assert Energy(60.0, None, home).left(0.0, WALLED.launch, FLIGHT) is None
    assert Energy(None, 0.1, home).left(0.0, WALLED.launch, FLIGHT) is None
    late = Energy(90.0, 0.01, home).left(7000.0, WALLED.launch, FLIGHT)
    assert late is not None
    assert late.spare_s == pytest.approx(200.0)


def test_the_ways_home_are_looked_for_beside_the_flight(monkeypatch: pytest.MonkeyPatch) -> None:
    """A decision does not wait for them; a home that has hardly moved is the same."""
    reach, go = Reach(WALLED, FLIGHT), threading.Event()

    def slowly(*words: Any) -> list[LatLon]:
        assert go.wait(60.0)
        return way_home(*words)

    monkeypatch.setattr("service.reach.way_home", slowly)
    lat, lon = WALLED.launch
    assert not reach.knows((lat, lon))
    assert not reach.knows((lat, lon))
    go.set()
    reach.home_s(left())
    assert reach.knows((lat + 1e-5, lon))
    assert not reach.knows((lat + 1e-3, lon))
