"""The energy of one flight as it is kept: how far home is, wherever on earth that is."""

from __future__ import annotations

import json

import pytest

from service.area import build_grid, parse_area
from service.config import FlightSettings
from service.mavlink.telemetry import Home
from service.mission.chart import Chart
from service.mission.effects import Tell
from service.mission.reserve import Reserve
from service.mission.states import State
from tests.service.area.files import at, box, collection, feature, point, polygon
from tests.service.mission.flown import START, reached, telemetry

EDGE = (10.0, 179.997)


def test_the_way_home_over_the_antimeridian_is_as_long_as_it_is() -> None:
    field = collection(
        feature(polygon(box(0, 0, 200, 200, EDGE))), feature(point(at(0, -20, EDGE)), role="launch")
    )
    grid = build_grid(parse_area(json.dumps(field).encode(), source="field"), 20.0)
    reserve = Reserve(Chart(grid), FlightSettings())
    lon, lat = at(700, 0, EDGE)  # blown off, 370 m beyond the line
    assert lon < 0.0
    home_lon, home_lat = at(0, -20, EDGE)
    flying = telemetry(lat=lat, lon=lon, alt_home_m=30.0, home=Home(home_lat, home_lon, 400.0))
    reserve.update(flying, START, under_way=True)
    assert reserve.energy.home.length_m == pytest.approx(700.3, rel=0.01)


def test_a_battery_that_tells_the_same_level_for_ever_leads_home_before_it_is_empty() -> None:
    talk = reached(State.SEARCHING)
    talk.tick()
    for _ in range(1150):  # a full battery is said to last 1200 s, and this one is told to be at 90 %
        talk.tick(1.0)
        if talk.state == State.RETURNING:
            break
    assert talk.state == State.RETURNING
    assert "reckoned since it stands still" in talk.core.standing.why
    assert talk.core.reserve.energy.percent is not None
    assert talk.core.reserve.energy.percent > 19.5
    assert [said for said in talk.wanted if isinstance(said, Tell) and "level stands still" in said.text]
