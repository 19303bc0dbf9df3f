"""Ways around exclusions: never across, never longer than needed."""

import itertools
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from service.area import Grid, LatLon, SearchArea, build_grid, leads_out, leg_is_clear, way_home
from service.errors import BadInput
from tests.service.area.files import at, box, collection, feature, parse, polygon, ring, square


def place(east: float, north: float) -> LatLon:
    lon, lat = at(east, north)
    return lat, lon


def field(*shapes: Any) -> tuple[SearchArea, Grid]:
    area = parse(collection(square(), *[feature(shape, role="exclude") for shape in shapes]))
    return area, build_grid(area, 25.0)


def metres(grid: Grid, route: list[LatLon]) -> float:
    points = grid.frame.to_metres(route)
    return float(np.hypot(*np.diff(points, axis=0).T).sum())


def nearest_approach(area: SearchArea, grid: Grid, route: list[LatLon]) -> float:
    """How near a route comes to any exclusion, in metres."""
    line = shapely.LineString(grid.frame.to_metres(route))
    return min(float(line.distance(grid.frame.flatten(item.polygon))) for item in area.exclusions)


BLOCK = polygon(box(-50, -50, 50, 50))
HORSESHOE = polygon(
    ring([(-100, -60), (100, -60), (100, 120), (60, 120), (60, -20), (-60, -20), (-60, 120), (-100, 120)])
)


def test_leg_is_clear_only_when_it_keeps_its_distance() -> None:
    _, grid = field(BLOCK)
    assert not leg_is_clear(grid, place(-150, 0), place(150, 0))
    assert not leg_is_clear(grid, place(-150, 53), place(150, 53))
    assert leg_is_clear(grid, place(-150, 57), place(150, 57))
    assert leg_is_clear(grid, place(-150, 0), place(-60, 0))


def test_every_leg_is_clear_without_exclusions() -> None:
    _, grid = field()
    assert leg_is_clear(grid, place(-900, 0), place(900, 0))
    assert way_home(grid, place(-150, 0), place(150, 0)) == [place(150, 0)]


def test_way_home_is_straight_when_nothing_is_between() -> None:
    _, grid = field(BLOCK)
    assert way_home(grid, place(-150, 100), place(150, 100)) == [place(150, 100)]


def test_way_home_leads_around_an_exclusion_and_is_short() -> None:
    area, grid = field(BLOCK)
    start, end = place(-150, 10), place(150, 10)
    route = [start, *way_home(grid, start, end)]
    assert route[-1] == end
    assert len(route) == 4
    assert nearest_approach(area, grid, route) >= 5.0
    assert metres(grid, route) < 1.03 * 2 * (np.hypot(95, 45) + 55)


def test_way_home_leads_out_of_a_dead_end() -> None:
    area, grid = field(HORSESHOE)
    start, end = place(0, 0), place(0, -150)
    route = [start, *way_home(grid, start, end)]
    assert nearest_approach(area, grid, route) >= 5.0
    assert metres(grid, route) > 350


def test_way_home_works_from_and_to_places_off_the_grid() -> None:
    area, grid = field(HORSESHOE)
    start, end = place(0, 900), place(0, -900)
    route = [start, *way_home(grid, start, end)]
    assert nearest_approach(area, grid, route) >= 5.0


def test_from_inside_an_exclusion_the_nearest_way_out_comes_first() -> None:
    """Wind has carried the aircraft in: it leaves eastwards, then flies around."""
    _, grid = field(BLOCK)
    route = way_home(grid, place(40, 0), place(-150, 0))
    exit_east = grid.frame.to_metres([route[0]])[0] - grid.frame.to_metres([place(0, 0)])[0]
    assert exit_east == pytest.approx([55.5, 0], abs=0.2)
    assert all(leg_is_clear(grid, a, b) for a, b in itertools.pairwise(route))


def test_out_of_an_exclusion_only_about_the_nearest_way_is_allowed() -> None:
    """The block reaches 50 m east of its middle, its clearance 5 m more."""
    _, grid = field(BLOCK)
    drifted = place(40, 2)  # since the way out was reckoned from (40, 0)
    out = way_home(grid, place(40, 0), place(-150, 0))[0]
    assert leads_out(grid, drifted, out)
    assert leads_out(grid, place(53, 0), out)  # only too near, and not over it
    assert not leads_out(grid, drifted, place(60, 150))  # a long way through it
    assert not leads_out(grid, drifted, place(-150, 0))
    assert not leads_out(grid, drifted, place(45, 0))  # not out
    assert not leads_out(grid, place(60, 0), place(150, 0))  # was out


def test_into_an_exclusion_the_route_goes_to_its_edge_first() -> None:
    _, grid = field(BLOCK)
    route = way_home(grid, place(-150, 0), place(40, 0))
    assert route[-1] == place(40, 0)
    legs = list(itertools.pairwise([place(-150, 0), *route]))
    assert all(leg_is_clear(grid, a, b) for a, b in legs[:-1])


def test_no_way_is_said_plainly() -> None:
    _, grid = field(polygon(box(-100, -100, 100, 100), box(-60, -60, 60, 60)))
    with pytest.raises(
        BadInput, match=r"no way from 47.0\d+, 11.0\d+ to .* around the exclusions; leave a gap"
    ):
        way_home(grid, place(0, 0), place(150, 150))
    with pytest.raises(BadInput, match=r"no way from 32T PT \d{5} \d{5} to 32T PT"):
        way_home(replace(grid, coordinates="mgrs"), place(0, 0), place(150, 150))


def test_between_neighbouring_flyable_cells_every_move_is_clear() -> None:
    """The planner's moves need no route: centre to centre is always clear."""
    _, grid = field(HORSESHOE, polygon(ring([(-170, -170), (-130, -175), (-150, -120)])))
    for row, col in np.argwhere(grid.flyable):
        for other in ((row + 1, col), (row, col + 1)):
            if all(i < n for i, n in zip(other, grid.frame.shape, strict=True)) and grid.flyable[other]:
                here, there = grid.frame.to_latlon([(row, col), other])
                assert leg_is_clear(grid, tuple(here), tuple(there))


@settings(max_examples=40, deadline=None)
@given(
    st.lists(st.tuples(*[st.floats(-150, 150)] * 2, *[st.floats(5, 80)] * 2), min_size=1, max_size=5),
    st.tuples(*[st.floats(-250, 250)] * 4),
)
def test_no_route_crosses_an_exclusion(
    blocks: list[tuple[float, float, float, float]], ends: tuple[float, float, float, float]
) -> None:
    shapes = [polygon(box(x, y, x + width, y + height)) for x, y, width, height in blocks]
    area, grid = field(*shapes)
    start, end = place(*ends[:2]), place(*ends[2:])
    assume(not shapely.intersects_xy(grid.keep_out.zone.shape, *grid.frame.to_metres([start, end]).T).any())
    try:
        route = [start, *way_home(grid, start, end)]
    except BadInput:
        zones = shapely.get_parts(grid.keep_out.zone.shape)
        assert any(len(zone.interiors) for zone in zones), "there is a way around everything that has no hole"
        return
    assert route[-1] == end
    assert nearest_approach(area, grid, route) >= 5.0 - 0.1


def test_exclusions_with_many_corners_still_give_a_route() -> None:
    angles = np.linspace(0, 2 * np.pi, 1500, endpoint=False)
    radius = 90 + 6 * np.sin(90 * angles)
    coastline = ring(
        [(float(r * np.cos(a)), float(r * np.sin(a))) for r, a in zip(radius, angles, strict=True)]
    )
    area, grid = field(polygon(coastline))
    assert len(grid.keep_out.corners) <= 250
    start, end = place(-180, 0), place(180, 0)
    route = [start, *way_home(grid, start, end)]
    assert nearest_approach(area, grid, route) >= 5.0
    assert metres(grid, route) < 470


def circles(count: int, side_m: float, corners: int) -> Any:
    """Many round exclusions beside each other, with gaps that can be flown through."""
    places = [(-900 + 150 * (n % 13), -900 + 150 * (n // 13)) for n in range(count)]
    turns = [2 * np.pi * k / corners for k in range(corners)]
    return [
        polygon(ring([(x + side_m * np.cos(turn), y + side_m * np.sin(turn)) for turn in turns]))
        for x, y in places
    ]


def test_exclusions_drawn_by_a_computer_are_simplified_and_never_cut() -> None:
    shapes = circles(6, 60.0, 5000)
    area, grid = field(*shapes)
    assert shapely.get_num_coordinates(grid.keep_out.zone.shape) < 2000
    for item in area.exclusions:
        drawn = grid.frame.flatten(item.polygon)
        assert shapely.covers(shapely.buffer(grid.keep_out.zone.shape, 1e-6), shapely.buffer(drawn, 4.9))


def test_more_exclusions_than_a_way_is_found_around_are_refused_with_their_number() -> None:
    with pytest.raises(
        BadInput, match=r"the exclusions have 845 corners, and \d+ when drawn to 8 m.*more than 500"
    ):
        field(*circles(169, 40.0, 4))
