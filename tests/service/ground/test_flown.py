"""How high cells are flown over, and what of that is in the way home, the preview and the times of a search."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from roisearch.motion_fit import Flown
from service.area import Grid, way_home
from service.config import SPARE_M, Settings
from service.geometry import offset_m
from service.ground.flown import flown_heights, heights_over, highest_along
from service.ground.relief import Relief
from service.mission.chart import Chart
from service.mission.energy import Left, WayHome
from service.mission.heights import Heights
from service.motion import MotionLimits
from service.preview.foresight import foresee
from service.preview.pace import climb_seconds, route_seconds, take_off_m
from service.reach import Reach
from service.search import Search
from tests.service.mission.flown import GRID, telemetry
from tests.service.test_reach import WALLED

SETTINGS = Settings.model_validate(
    {
        "flight": {"altitude_m": 40.0, "clearance_m": 15.0, "return_height_m": 60.0},
        "sensor": {"cell_m": 20.0},
        "search": {"planner": "survey"},
    }
)
FLIGHT = SETTINGS.flight
STEP, AROUND = 10.0, 600.0


def sloping(grid: Grid, rise: float = 0.5, wall: float = 0.0) -> Grid:
    """The grid over a slope that rises to the east, so much a metre, with a wall of rock across it."""
    y, x = np.mgrid[0:200, 0:200] * STEP - AROUND
    heights = rise * x + wall * (np.abs(x - 150.0) < 8.0) + 0.0 * y
    relief = Relief(heights, STEP, -AROUND, -AROUND, 10.0, 400.0)
    east, south = grid.frame.to_metres([grid.launch])[0]
    base = float(relief.height_at(np.array([[east, south]]))[0])
    return replace(grid, relief=replace(relief, heights=heights - base))


def test_flat_ground_has_no_heights() -> None:
    assert flown_heights(GRID, FLIGHT) is None
    assert Search(GRID, SETTINGS).heights is None
    assert take_off_m(FLIGHT, GRID) == FLIGHT.altitude_m


def test_a_cell_is_flown_over_as_high_as_set_and_clear_of_what_is_near() -> None:
    grid = sloping(GRID, 0.5, wall=60.0)
    heights = flown_heights(grid, FLIGHT)
    assert heights is not None
    assert grid.relief is not None
    assert heights.shape == grid.frame.shape
    side = grid.frame.cell_m
    for row, col in np.ndindex(*heights.shape):
        point = np.array([[(col + 0.5) * side, (row + 0.5) * side]])
        ground, roof = float(grid.relief.height_at(point)[0]), float(grid.relief.roof_at(point)[0])
        assert heights[row, col] == pytest.approx(max(ground + 40.0, roof + 15.0 + SPARE_M))
    assert heights.max() > float(grid.relief.height_at(np.array([[150.0, 50.0]]))[0]) + 17.0
    grid.relief.heights[:, :100] = np.nan  # nothing is flown where the ground is not known
    holed = flown_heights(replace(grid, relief=replace(grid.relief)), FLIGHT)
    assert holed is not None
    assert np.isfinite(holed).all()


@pytest.mark.parametrize("wall", [0.0, 80.0])
def test_from_every_cell_the_way_home_takes_the_climb_and_descent_that_the_flight_reckons(
    wall: float,
) -> None:
    grid = sloping(WALLED, 0.5, wall)
    chart = Chart(grid)
    flying = Heights(chart, SETTINGS)
    flying.reckon(telemetry(armed=False), grid.launch)
    heights = flown_heights(grid, FLIGHT)
    assert heights is not None
    seconds = Reach(grid, FLIGHT).home_s(Left(500.0, 450.0, 10.0, 1e6, grid.launch))
    for row, col in np.argwhere(grid.flyable)[::9].tolist():
        lat, lon = grid.frame.to_latlon([(row, col)])[0]
        points = [(float(lat), float(lon)), *way_home(grid, (float(lat), float(lon)), grid.launch)]
        top = max(flying.highest_return_m(points), FLIGHT.return_height_m)
        legs = [offset_m(points[0], to) for to in points]
        way = WayHome.along(legs, float(heights[row, col]) - flying.home_m, None, FLIGHT, top)
        assert seconds[row, col] == pytest.approx(way.seconds, rel=1e-3), (row, col)
    flat = Reach(WALLED, FLIGHT).home_s(Left(500.0, 450.0, 10.0, 0.0, grid.launch))
    more = (seconds - flat)[grid.flyable]
    assert more.max() > more.min() + 50.0  # from the top of the slope it sinks for long


def test_what_is_foreseen_takes_the_climbs_that_it_flies() -> None:
    grid = sloping(GRID, 2.5)
    search = Search(grid, SETTINGS)
    heights = search.heights
    assert heights is not None
    seen = foresee(
        Search(grid, SETTINGS), grid.start, most_s=np.inf, until=0.5, most_steps=80, false_alarms=False,
        rng=np.random.default_rng(1),
    )  # fmt: skip
    along = [heights[cell] for cell in seen.cells]
    expected = search.motion.arrivals(seen.cells[1:], seen.cells[0], heights=along)
    np.testing.assert_allclose(seen.seconds[1:], expected)
    assert expected[-1] > search.motion.arrivals(seen.cells[1:], seen.cells[0])[-1]


def test_the_way_to_the_search_takes_its_climb() -> None:
    flat, steep = GRID, sloping(GRID, 1.0)
    west, east = ((float(a), float(b)) for a, b in GRID.frame.to_latlon([(2, 0), (2, 9)]))
    level = route_seconds(flat, FLIGHT, west, east)
    up, down = route_seconds(steep, FLIGHT, west, east), route_seconds(steep, FLIGHT, east, west)
    metres = 9 * GRID.frame.cell_m
    assert up - level == pytest.approx(metres / FLIGHT.climb_mps - metres / FLIGHT.speed_mps, rel=0.03)
    assert down - level == pytest.approx(metres / FLIGHT.descent_mps - metres / FLIGHT.speed_mps, rel=0.03)
    walled = replace(steep, launch=(float(east[0]), float(east[1])))
    assert climb_seconds(FLIGHT, walled) >= climb_seconds(FLIGHT, flat)


def test_the_highest_of_a_way_is_over_all_of_it() -> None:
    relief = sloping(GRID, 0.0, wall=100.0).relief
    assert relief is not None
    over = highest_along(relief, [(60.0, 50.0), (240.0, 50.0)], FLIGHT)
    assert over == pytest.approx(100.0 + 15.0 + SPARE_M)
    assert highest_along(relief, [(60.0, 50.0), (90.0, 50.0)], FLIGHT) == pytest.approx(40.0)
    assert highest_along(relief, [(60.0, 50.0), (9000.0, 50.0)], FLIGHT) == math.inf
    assert not np.isfinite(heights_over(relief, np.array([[9000.0, 50.0]]), FLIGHT)).any()


def test_how_fast_it_flies_is_learnt_over_a_slope_as_over_flat_ground() -> None:
    grid = sloping(GRID, 0.9)
    search = Search(grid, SETTINGS)
    search.limit(MotionLimits(climb_mps=3.0, descent_mps=1.5))
    assert (search.as_set.climb_mps, search.as_set.descent_mps) == (3.0, 1.5)
    rows, cols = grid.frame.shape
    path = [
        (row, col)
        for row in range(rows)
        for col in (range(cols) if row % 2 == 0 else range(cols - 1, -1, -1))
    ]
    took = search.arrivals(path[1:], path[0], "east", 8.0)
    search.learn([Flown(path[0], "east", path[1:], took)]).result()
    assert search.motion.speed_mps == pytest.approx(search.as_set.speed_mps, rel=0.05)
