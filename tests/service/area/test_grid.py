"""Cells over an area: what is searched, what is flown over, where the prior mass is."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import norm

from service.area import Grid, build_grid
from service.area.prior import cell_squares
from service.errors import BadInput
from tests.service.area.files import at, box, collection, feature, parse, point, polygon, ring, square


def grid_of(*features: Any, cell_m: float = 25.0, **options: Any) -> Grid:
    return build_grid(parse(collection(*features)), cell_m, **options)


def exclude(west: float, south: float, east: float, north: float, **properties: Any) -> Any:
    return feature(polygon(box(west, south, east, north)), role="exclude", **properties)


def launch(east: float, north: float) -> Any:
    return feature(point(at(east, north)), role="launch")


def cell(grid: Grid, east: float, north: float) -> tuple[int, int]:
    lon, lat = at(east, north)
    row, col = grid.frame.to_cells([[lat, lon]])[0]
    return int(row), int(col)


def test_square_area_is_all_searchable_flyable_and_even() -> None:
    grid = grid_of(square(), launch(0, -200))
    assert grid.frame.shape == (16, 16)
    assert grid.searchable.all()
    assert grid.flyable.all()
    assert grid.prior == pytest.approx(np.full((16, 16), 1 / 256), rel=2e-3)
    assert grid.prior.sum() == pytest.approx(1)
    assert grid.reachable_mass == pytest.approx(1)
    assert grid.notes == ()
    assert grid.start[0] == 15


def test_arrays_cannot_be_changed_by_accident() -> None:
    grid = grid_of(square())
    for array in (grid.prior, grid.searchable, grid.flyable, grid.covered):
        with pytest.raises(ValueError, match="read-only"):
            array[0, 0] = 0


def test_mass_of_an_edge_cell_is_its_covered_part() -> None:
    """A triangle: half of the square, and cells on the diagonal hold half of a full cell's mass."""
    triangle = feature(polygon(ring([(-200, -200), (200, -200), (-200, 200)])), role="search")
    grid = grid_of(triangle, cell_m=50.0)
    assert grid.frame.bearing_deg == 0.0
    assert grid.covered.sum() * 2500 == pytest.approx(80_000, rel=1e-3)
    assert grid.prior[5, 1] / grid.prior[7, 0] == pytest.approx(1.0, rel=1e-3)
    assert grid.prior[5, 5] / grid.prior[7, 0] == pytest.approx(0.5, rel=1e-2)
    assert not grid.searchable[0, 7]
    assert (grid.prior[~grid.searchable] == 0).all()


def test_covered_fractions_are_exact() -> None:
    """Cell by cell against shapely's own intersection of one square at a time."""
    corners = [(-210, -90), (10, -140), (190, 20), (60, 40), (120, 170), (-80, 60)]
    area = parse(polygon(ring(corners), ring([(-60, -60), (-10, -50), (-40, 10)])))
    grid = build_grid(area, 30.0)
    flat = grid.frame.flatten(area.ground)
    for (row, col), fraction in np.ndenumerate(grid.covered):
        here = shapely.box(col * 30, row * 30, col * 30 + 30, row * 30 + 30)
        assert fraction == pytest.approx(here.intersection(flat).area / 900, abs=1e-9)


def test_hole_is_not_searched() -> None:
    grid = grid_of(feature(polygon(box(-200, -200, 200, 200), box(-75, -75, 75, 75)), role="search"))
    assert not grid.searchable[cell(grid, 0, 0)]
    assert not grid.flyable[cell(grid, 0, 0)]
    assert grid.prior.sum() == pytest.approx(1)


def test_every_searchable_cell_is_flyable_without_exclusions() -> None:
    corners = [(-410, -90), (10, -140), (390, 20), (60, 40), (120, 170), (-80, 60)]
    grid = build_grid(parse(polygon(ring(corners))), 20.0)
    assert grid.flyable[grid.searchable].all()
    assert not grid.flyable.all()


def test_margin_lets_the_aircraft_fly_outside_the_area() -> None:
    wide = grid_of(square(), margin_m=60.0)
    assert wide.frame.shape == (21, 21)
    assert wide.flyable[cell(wide, -240, 0)]
    assert not wide.searchable[cell(wide, -240, 0)]
    assert not wide.flyable[0, 0]
    tight = grid_of(
        feature(polygon(ring([(-200, -200), (200, -200), (-200, 200)])), role="search"), margin_m=0.0
    )
    assert (tight.searchable & ~tight.flyable).any()


# --- exclusions ----------------------------------------------------------------------------------


def test_no_flyable_square_comes_near_an_exclusion() -> None:
    corners = [(-60, -20), (40, -72), (90, 60)]
    area = parse(collection(square(), feature(polygon(ring(corners)), role="exclude")))
    grid = build_grid(area, 25.0, clearance_m=5.0)
    flat = grid.frame.flatten(area.exclusions[0].polygon)
    for (row, col), flyable in np.ndenumerate(grid.flyable):
        square_of_cell = shapely.box(col * 25, row * 25, col * 25 + 25, row * 25 + 25)
        assert flyable == (shapely.distance(square_of_cell, flat) > 5.0)


def test_excluded_ground_has_no_mass_but_the_strip_beside_it_keeps_its_own() -> None:
    grid = grid_of(square(), exclude(-60, -60, 60, 60))
    inside, strip = cell(grid, 0, 0), cell(grid, 62, 0)
    assert not grid.searchable[inside]
    assert grid.prior[inside] == 0
    assert grid.searchable[strip]
    assert not grid.flyable[strip]
    assert grid.prior[strip] == pytest.approx(0.6 * grid.prior[0, 0], rel=1e-2)
    assert grid.reachable_mass == pytest.approx(1 - grid.prior[~grid.flyable].sum())
    assert "% of the prior lies in cells that may not be flown over" in grid.notes[-1]


def test_searchable_exclusion_keeps_its_mass() -> None:
    grid = grid_of(square(), exclude(-60, -60, 60, 60, searchable=True), launch(0, -200))
    inside = cell(grid, 0, 0)
    assert grid.searchable.all()
    assert not grid.flyable[inside]
    assert grid.prior[inside] == pytest.approx(1 / 256, rel=2e-3)
    assert grid.reachable_mass < 0.9
    assert len(grid.notes) == 1


def test_exclusion_that_leaves_no_cell_to_fly_over_is_refused() -> None:
    with pytest.raises(BadInput, match=r"leave no cell of 200 m to fly over; make them smaller"):
        grid_of(square(), exclude(-20, -150, 20, 150), exclude(-150, -20, 150, 20), cell_m=200.0)


def test_of_two_separate_parts_the_one_with_more_mass_is_flown() -> None:
    heavy = feature(point(at(150, 0)), role="prior", sigma_m=20, weight=3)
    light = feature(point(at(-150, 0)), role="prior", sigma_m=20, weight=1)
    grid = grid_of(square(), exclude(-30, -260, 30, 260), heavy, light, launch(-150, -190))
    assert grid.flyable[cell(grid, 150, 0)]
    assert not grid.flyable[cell(grid, -150, 0)]
    assert grid.flyable[grid.start]
    assert grid.notes[0].startswith("The cells that may be flown over fall into 2 separate parts")
    assert "75 % of the prior is flown, 25 %" in grid.notes[0]


def test_all_parts_of_an_area_are_flown_across_their_hull_and_never_across_an_exclusion() -> None:
    west, east = polygon(box(-200, -60, -80, 60)), polygon(box(80, -60, 200, 60))
    parts = [feature(shape, role="search") for shape in (west, east)]
    grid = grid_of(*parts, launch(-150, 0))
    assert grid.flyable[cell(grid, -150, 0)]
    assert grid.flyable[cell(grid, 150, 0)]
    assert grid.flyable[cell(grid, 0, 0)]
    assert not grid.searchable[cell(grid, 0, 0)]
    assert grid.notes[0] == (
        "Between separate parts of the area the aircraft crosses their convex hull, which is not searched."
    )
    assert grid.reachable_mass == pytest.approx(1.0)
    around = grid_of(*parts, exclude(-30, 10, 30, 100), launch(-150, 0))
    assert not around.flyable[cell(around, 0, 40)]
    assert around.flyable[cell(around, 150, 0)]
    closed = shapely.intersects(around.keep_out.zone.shape, cell_squares(around.frame))
    assert not (around.flyable & closed).any()
    cut = grid_of(*parts, exclude(-30, -300, 30, 300), launch(-150, 0))
    assert cut.flyable[cell(cut, 150, 0)] != cut.flyable[cell(cut, -150, 0)]
    assert "fall into 2 separate parts" in cut.notes[1]


def test_ground_drawn_as_transit_is_all_that_is_crossed() -> None:
    west, east = polygon(box(-200, -60, -80, 60)), polygon(box(80, -60, 200, 60))
    corridor = feature(polygon(box(-90, 30, 90, 60)), role="transit")
    grid = grid_of(feature(west, role="search"), feature(east, role="search"), corridor, launch(-150, 0))
    assert grid.flyable[cell(grid, 0, 45)]
    assert grid.flyable[cell(grid, 150, 0)]
    assert not grid.flyable[cell(grid, 0, -40)]
    assert "the ground drawn as transit" in grid.notes[0]


def test_a_single_polygon_is_not_left_to_join_what_an_exclusion_cuts() -> None:
    """An area around a village: what lies between its arms was left out by who drew it."""
    arms = polygon(
        ring(
            [
                (-200, -200),
                (200, -200),
                (200, 200),
                (100, 200),
                (100, -100),
                (-100, -100),
                (-100, 200),
                (-200, 200),
            ]
        )
    )
    grid = grid_of(feature(arms, role="search"), exclude(-30, -260, 30, -80), launch(-150, 0))
    assert not grid.flyable[cell(grid, 0, 100)]
    assert "fall into 2 separate parts" in grid.notes[0]


def test_part_that_the_launch_cannot_reach_is_not_flown() -> None:
    """The heavy prior is behind a closed ring of exclusion; the launch is outside of it."""
    closed = feature(polygon(box(-120, -120, 120, 120), box(-70, -70, 70, 70)), role="exclude")
    heavy = feature(point(at(0, 0)), role="prior", sigma_m=15, weight=9)
    light = feature(point(at(-150, 150)), role="prior", sigma_m=15, weight=1)
    grid = grid_of(square(), closed, heavy, light, launch(0, -200))
    assert not grid.flyable[cell(grid, 0, 0)]
    assert grid.flyable[cell(grid, -150, 150)]
    inner = grid_of(square(), closed, heavy, light, launch(0, 0))
    assert inner.flyable[cell(inner, 0, 0)]
    assert not inner.flyable[cell(inner, -150, 150)]


def test_launch_shut_in_by_an_exclusion_is_refused() -> None:
    wall = feature(polygon(box(-60, -400, 60, -260), box(-30, -370, 30, -290)), role="exclude")
    with pytest.raises(BadInput, match="launch point cannot reach the area without crossing an exclusion"):
        grid_of(square(), wall, launch(0, -330))


@pytest.mark.parametrize("north", [0, 62])
def test_launch_in_or_right_beside_an_exclusion_is_refused(north: float) -> None:
    with pytest.raises(BadInput, match="launch point lies in an exclusion or too near to one; move it"):
        grid_of(square(), exclude(-60, -60, 60, 60), launch(0, north))


def test_without_a_launch_point_the_search_starts_from_a_flyable_cell_and_says_so() -> None:
    grid = grid_of(square())
    assert grid.flyable[grid.start]
    assert grid.frame.to_cells([grid.launch]).tolist() == [list(grid.start)]
    assert grid.notes[0].startswith("The area file has no launch point; the search starts from 4")
    in_utm = grid_of(square(), coordinates="utm")
    assert "the search starts from 32T " in in_utm.notes[0]


def test_launch_can_be_given_instead_of_the_files() -> None:
    lon, lat = at(200, 0)
    grid = grid_of(square(), launch(0, -200), launch=(lat, lon))
    assert grid.launch == (lat, lon)
    assert grid.start[1] == 15
    with pytest.raises(BadInput, match=r"the launch point is \d+ km from the area, more than 2 km"):
        grid_of(square(), launch=(48.0, 11.0))


# --- sizes ---------------------------------------------------------------------------------------


def test_area_too_small_for_one_cell_is_refused() -> None:
    with pytest.raises(
        BadInput, match=r"field.geojson: the area of 400 m² is too small for one cell of 25 m; take"
    ):
        grid_of(square(10), cell_m=25.0)
    assert grid_of(square(13), cell_m=25.0).searchable.any()


def test_too_many_cells_are_refused() -> None:
    with pytest.raises(BadInput, match=r"cells of 0.1 m make a grid of 4000 x 4000 cells, more than 1000000"):
        grid_of(square(), cell_m=0.1)


@pytest.mark.parametrize("cell_m", [0.0, -1.0, float("nan"), float("inf")])
def test_impossible_cell_size_is_refused(cell_m: float) -> None:
    with pytest.raises(BadInput, match=r"the cell size is .* give a length greater than 0"):
        grid_of(square(), cell_m=cell_m)


def test_impossible_margin_is_refused() -> None:
    with pytest.raises(BadInput, match="the flight margin is -1 m; give 0 or more"):
        grid_of(square(), margin_m=-1.0)


# --- prior ---------------------------------------------------------------------------------------


def test_weights_are_shares_of_the_whole() -> None:
    west = feature(polygon(box(-200, -200, -100, 200)), role="prior", weight=1)
    east = feature(point(at(120, 0)), role="prior", sigma_m=15, weight=3)
    grid = grid_of(square(), west, east)
    assert grid.prior[:, :4].sum() == pytest.approx(0.25, abs=1e-3)
    assert grid.prior[:, 8:].sum() == pytest.approx(0.75, abs=1e-3)
    assert "searchable cells have a prior of 0" in grid.notes[-1]


def test_polygon_prior_counts_only_inside_the_area() -> None:
    """Half of the wood is outside: its weight is still its whole share, spread over the inner half."""
    wood = feature(polygon(box(100, -200, 300, 200)), role="prior", weight=1)
    rest = feature(polygon(box(-200, -200, 0, 200)), role="prior", weight=1)
    grid = grid_of(square(), wood, rest)
    assert grid.prior[:, 12:].sum() == pytest.approx(0.5, abs=1e-3)
    assert grid.prior[:, 8:12].sum() == pytest.approx(0, abs=1e-3)


def test_point_prior_is_the_integral_of_the_normal_distribution() -> None:
    grid = grid_of(square(), feature(point(at(0, 0)), role="prior", sigma_m=40))
    edges = np.linspace(-200, 200, 17)
    line = np.diff(norm.cdf(edges, scale=40))
    expected = np.outer(line, line)
    assert grid.prior == pytest.approx(expected / expected.sum(), rel=5e-3)


@pytest.mark.parametrize("sigma", [1e-6, 0.1, 1e7])
def test_point_prior_of_any_width_is_a_distribution(sigma: float) -> None:
    grid = grid_of(square(), feature(point(at(12, 12)), role="prior", sigma_m=sigma))
    assert np.isfinite(grid.prior).all()
    assert grid.prior.sum() == pytest.approx(1)
    if sigma < 1:
        assert grid.prior[cell(grid, 12, 12)] == pytest.approx(1)
    else:
        assert grid.prior.max() == pytest.approx(grid.prior.mean(), rel=5e-3)


def test_tails_of_a_point_prior_stay_positive() -> None:
    """Ten sigma away the mass is tiny and true, not lost in 1 - 1."""
    grid = grid_of(square(), feature(point(at(-190, 0)), role="prior", sigma_m=25))
    assert (grid.prior > 0).all()
    assert grid.prior[8, 15] < 1e-40


@settings(max_examples=30)
@given(
    st.lists(
        st.tuples(st.floats(-150, 150), st.floats(-150, 150), st.floats(1, 500), st.floats(1e-300, 1e300)),
        max_size=4,
    ),
    st.floats(0, 0.99),
)
def test_prior_sums_to_one_over_searchable_cells(
    points: list[tuple[float, float, float, float]], outside: float
) -> None:
    features = [
        feature(point(at(east, north)), role="prior", sigma_m=sigma, weight=weight)
        for east, north, sigma, weight in points
    ]
    area = parse(collection(square(), *features, outside=outside))
    grid = build_grid(area, 40.0)
    assert grid.prior.sum() == pytest.approx(1)
    assert (grid.prior >= 0).all()
    assert (grid.prior[~grid.searchable] == 0).all()
    assert grid.outside == outside


def test_prior_can_be_replaced() -> None:
    grid = grid_of(square(), launch(0, -200))
    other = np.zeros(grid.frame.shape)
    other[3, 4] = 7.0
    replaced = grid.with_prior(other)
    assert replaced.prior[3, 4] == 1.0
    assert replaced.notes == ("255 of 256 searchable cells have a prior of 0: no search of them.",)
    with pytest.raises(BadInput, match="no mass on any cell that is searched"):
        grid.with_prior(np.zeros(grid.frame.shape))


def test_same_file_gives_the_same_grid_to_the_last_bit() -> None:
    features = [square(), feature(point(at(20, 30)), role="prior", sigma_m=40), exclude(50, 50, 90, 90)]
    first, second = grid_of(*features), grid_of(*features)
    assert first.prior.tobytes() == second.prior.tobytes()
    assert first.frame == second.frame


@pytest.mark.parametrize("exclusions", [(), [exclude(10, -190, 190, 190), exclude(-190, -190, -10, -10)]])
def test_ground_of_a_single_cell_is_refused_with_what_helps(exclusions: Sequence[dict[str, Any]]) -> None:
    cell_m = 200.0 if exclusions else 400.0
    with pytest.raises(BadInput, match=r"no cell to fly over has another one beside it.*take smaller cells"):
        grid_of(square(), *exclusions, cell_m=cell_m)
