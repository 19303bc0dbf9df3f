"""The energy of one flight as it is kept: how far home is, wherever on earth that is."""

from __future__ import annotations

import json

import pytest

from roisearch import Motion
from service.area import build_grid, parse_area
from service.config import FlightSettings
from service.mavlink.telemetry import Home
from service.mission.chart import Chart
from service.mission.effects import Tell
from service.mission.reserve import Reserve
from service.mission.states import State
from service.reach import Reach
from tests.service.area.files import at, box, collection, feature, point, polygon
from tests.service.mission.flown import CELL_M, GRID, START, Talk, reached, searching, telemetry

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


def home_s(talk: Talk) -> tuple[float, float]:
    """Seconds across ground on the way home as the flight reckons it from where it is, and as the plan of the battery's
    end does, on average over all cells."""
    for percent in (89.0, 88.0, 87.0, 86.0):
        talk.shows(battery_percent=percent)
        talk.tick(10.0)
    # what a decision is handed, without the wait for one
    home, left = talk.core.reserve.energy.home, talk.core._look().battery_left()
    assert left is not None
    across = Reach(GRID, talk.settings.flight).home_s(left) - left.upright_s
    return home.seconds - home.upright_s, float(across[GRID.flyable].mean())


@pytest.mark.parametrize("how", ["its parameters say so", "it was learnt in flight"])
def test_the_way_home_is_reckoned_at_no_speed_that_the_aircraft_cannot_fly(how: str) -> None:
    as_asked, slow = searching(), searching()
    if how.startswith("its"):
        slow.shows(most_speed_mps=4.0)
    else:
        slow.sees(motion=Motion(cell_m=CELL_M, speed_mps=4.0))
    for asked_s, slow_s in zip(home_s(as_asked), home_s(slow), strict=True):
        assert slow_s > 1.4 * asked_s


def test_a_faster_aircraft_flies_home_at_the_speed_that_is_asked() -> None:
    talk = searching(most_speed_mps=20.0)
    talk.sees(motion=Motion(cell_m=CELL_M, speed_mps=11.0))
    talk.tick()
    assert talk.core.reserve.energy.speed_mps == 8.0
