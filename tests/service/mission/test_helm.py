"""What the helm objects to: before a waypoint leaves, and while one is flown."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import shapely

from roisearch.directions import STEPS, moves_allowed
from service.area import Grid
from service.config import Settings
from service.mavlink.events import Home
from service.mavlink.telemetry import Telemetry
from service.mission.chart import Chart
from service.mission.effects import SendWaypoint
from service.mission.helm import Helm
from service.mission.situation import Situation
from sim.soak import ground
from tests.service.mission.flown import GRID, ON_GROUND, START, place, telemetry


def helm(grid: Grid = GRID, **flight: Any) -> Helm:
    """A helm over the soak's field, home known."""
    settings = Settings.model_validate({"flight": {"altitude_m": 15.0, **flight}, "sensor": {"cell_m": 20.0}})
    built = Helm(Chart(grid), settings, fresh_s=2.0, patience_s=15.0)
    built.reckon(telemetry())
    return built


def at(east: float, north: float, height: float = 15.0) -> Telemetry:
    """The aircraft there."""
    lat, lon = place(east, north)
    return telemetry(lat=lat, lon=lon, alt_home_m=height)


def waypoint(built: Helm, point: tuple[float, float], t: Telemetry, *, on_way: bool) -> SendWaypoint:
    """As it would be sent."""
    return SendWaypoint(point, built.leg(point, t).altitude_m, on_way=on_way)


@pytest.mark.parametrize(
    ("point", "on_way", "flight", "words"),
    [
        ((250.0, 60.0), False, {}, ""),
        ((320.0, 60.0), False, {}, "outside the area"),
        ((80.0, 160.0), False, {}, "outside the area"),
        ((20.0, 50.0), False, {}, "behind an excluded area"),
        ((-20.0, 10.0), True, {}, ""),
        ((200.0, -60.0), True, {}, "outside the way"),
        ((250.0, 60.0), False, {"max_height_m": 20.0, "altitude_m": 15.0}, ""),
        ((250.0, 60.0), False, {"max_launch_distance_m": 100.0}, "more than 100 m from the launch"),
    ],
)
def test_no_waypoint_leaves_for_where_it_must_not_be_flown(
    point: tuple[float, float], on_way: bool, flight: dict[str, float], words: str
) -> None:
    built = helm(**flight)
    wanted = waypoint(built, place(*point), telemetry(), on_way=on_way)
    objection = built.objection(wanted, telemetry(), START)
    assert (objection is None) if not words else (objection is not None and words in objection.reason)


def test_every_diagonal_leg_that_a_planner_may_fly_is_clear_of_exclusions_from_anywhere_near_its_beginning() -> (
    None
):
    built, chart, rng, legs = helm(), Chart(GRID), np.random.default_rng(1), 0
    allowed = moves_allowed(GRID.flyable)
    for row, col in np.argwhere(GRID.flyable):
        beside = GRID.frame.to_latlon(np.array([(row, col)]) + rng.uniform(-0.25, 0.25, 2))[0]
        for bit in (bit for bit in (1, 3, 5, 7) if allowed[row, col] >> bit & 1):
            there = chart.latlon((int(row) + STEPS[bit][0], int(col) + STEPS[bit][1]))
            at = telemetry(lat=float(beside[0]), lon=float(beside[1]))
            assert built.objection(waypoint(built, there, at, on_way=False), at, START) is None
            legs += 1
    assert legs > 100


@pytest.mark.parametrize(
    ("point", "allowed"), [((250.0, 60.0), True), ((280.0, 60.0), True), ((320.0, 60.0), False)]
)
def test_a_leg_may_be_aimed_where_the_search_may_be(point: tuple[float, float], allowed: bool) -> None:
    assert helm().allows(place(*point)) == allowed


def test_no_leg_is_aimed_into_an_exclusion_or_near_to_one() -> None:
    built, chart = helm(), Chart(GRID)
    zone = GRID.keep_out.zone.shape.representative_point()
    inside = GRID.frame.from_metres(np.array([[zone.x, zone.y]]))[0]
    assert chart.too_near((float(inside[0]), float(inside[1])))
    assert not built.allows((float(inside[0]), float(inside[1])))


def test_the_height_of_a_waypoint_follows_home_when_it_moves() -> None:
    built = helm()
    assert built.leg(place(250.0, 60.0), telemetry()).altitude_m == 415.0
    higher = telemetry(home=Home(*ground.launch(), 420.0), alt_amsl_m=435.0)
    built.reckon(higher)
    assert built.leg(place(250.0, 60.0), higher).altitude_m == 435.0


def test_the_fence_follows_home_when_it_moves() -> None:
    built, there = helm(), place(200.0, -60.0)
    out = waypoint(built, there, telemetry(), on_way=True)
    assert built.objection(out, telemetry(), START) is not None
    moved = telemetry(home=Home(*there, 400.0))
    built.reckon(moved)
    assert built.objection(out, moved, START) is None


def test_two_sources_that_contradict_each_other_on_home_are_a_doubt() -> None:
    """A home in another datum, or a correction of the altitude: the height over ground is one of two."""
    built = helm()
    assert built.doubts(telemetry(), START) == []
    for contradiction in (telemetry(home=Home(*ground.launch(), 447.0)), telemetry(alt_amsl_m=435.0)):
        assert "above the sea" in built.doubts(contradiction, START)[0]
        wanted = waypoint(built, place(250.0, 60.0), contradiction, on_way=False)
        assert built.objection(wanted, contradiction, START) is not None


def test_a_slow_aircraft_needs_more_of_its_battery_for_the_way_out_and_home() -> None:
    built = helm(full_battery_s=250.0)
    seen = Situation(telemetry(battery_percent=90.0))
    assert built.too_empty(seen) == ""
    slow = replace(seen, telemetry=replace(seen.telemetry, most_speed_mps=1.0))
    assert "the way out and home needs about" in built.too_empty(slow)


def test_a_home_far_from_the_launch_point_is_refused_and_one_beside_it_told() -> None:
    built, (lat, lon) = helm(), ground.launch()
    assert built.too_far(telemetry()) == built.far(telemetry()) == ""
    beside = telemetry(home=Home(lat + 0.001, lon, 400.0))
    assert (built.too_far(beside), built.far(beside)) == ("", "home is 111 m from the launch point")
    away = telemetry(home=Home(-lat, lon - 170.0, 400.0))
    assert "more than 500 m; is it the right area file?" in built.too_far(away)


def test_an_aircraft_whose_home_is_not_told_stands_where_home_will_be() -> None:
    built, (lat, lon) = helm(), ground.launch()
    untold = telemetry(home=None, lat=lat, lon=lon, **ON_GROUND)
    assert built.too_far(untold) == built.far(untold) == ""
    assert "more than 500 m" in built.too_far(replace(untold, lat=lat + 1.0, lon=lon))
    assert built.too_far(telemetry(home=None, lat=lat + 1.0, lon=lon)) == ""  # in the air it may be anywhere


def test_nothing_takes_off_or_is_taken_over_whose_home_lies_in_an_exclusion() -> None:
    built, (lat, lon) = helm(), place(250.0, 60.0)
    assert built.unfit(telemetry(home=Home(lat, lon, 400.0)), ()) == ""
    around = shapely.Point(lon, lat).buffer(1e-4)
    why = helm(GRID.excluding(around)).unfit(telemetry(home=Home(lat, lon, 400.0)), ())
    assert "home" in why
    assert "lies in an excluded area" in why


@pytest.mark.parametrize(
    ("east", "north", "height", "words"),
    [
        (320.0, 50.0, 15.0, "outside the area and its margin"),
        (200.0, 50.0, 140.0, "140 m above home, more than 120 m"),
        (200.0, 50.0, 0.5, "0 m above home, less than 3 m"),
        (80.0, 60.0, 15.0, "over an excluded area"),
    ],
)
def test_an_aircraft_that_has_strayed_is_told_once_it_lasts(
    east: float, north: float, height: float, words: str
) -> None:
    built, there = helm(), at(east, north, height)
    assert built.strayed(telemetry(), START) == ""
    assert built.strayed(there, START) == ""
    assert words in built.strayed(there, START + 2.5)
    built.rest()  # a resumed search may begin outside
    assert built.strayed(there, START + 5.0) == ""


def test_an_unknown_heading_is_where_the_aircraft_goes() -> None:
    east = replace(telemetry(), heading_deg=float("nan"), velocity_ned_mps=(0.0, 5.0, 0.0))
    known = replace(east, heading_deg=90.0)
    assert Chart(GRID).heading(east) == Chart(GRID).heading(known)
