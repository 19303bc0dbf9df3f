"""The areas that ship in config/: each reads, grids sensibly and can be flown."""

import itertools
from pathlib import Path

import numpy as np
import pytest
import shapely
from scipy import ndimage

from service.area import Grid, PointPrior, SearchArea, build_grid, leg_is_clear, read_area, way_home

CONFIG = Path(__file__).parents[3] / "config"
DEMO = CONFIG / "area.geojson"
VALLEY, COAST, FARM = (CONFIG / "areas" / f"{name}.geojson" for name in ("mountain-valley", "coast", "farm"))
ALL = [DEMO, VALLEY, COAST, FARM]


def load(path: Path) -> tuple[SearchArea, Grid]:
    area = read_area(path)
    return area, build_grid(area, 25.0)


@pytest.mark.parametrize("path", ALL, ids=lambda path: path.stem)
def test_shipped_area_is_minutes_of_flight_with_a_story(path: Path) -> None:
    area, grid = load(path)
    assert area.name
    assert len(area.description) > 80
    assert area.launch is not None
    assert 250 <= grid.searchable.sum() <= 450


@pytest.mark.parametrize("path", ALL, ids=lambda path: path.stem)
def test_shipped_prior_is_informative_and_reachable(path: Path) -> None:
    area, grid = load(path)
    assert len(area.priors) >= 3
    assert (grid.prior[grid.searchable] > 0).all()
    assert grid.reachable_mass > 0.99
    bits = -np.sum(grid.prior[grid.searchable] * np.log2(grid.prior[grid.searchable]))
    assert bits < np.log2(grid.searchable.sum()) - 0.5
    _, hills = ndimage.label(grid.prior > 2 / grid.searchable.sum())
    assert hills >= 2


@pytest.mark.parametrize("path", ALL, ids=lambda path: path.stem)
def test_shipped_area_is_flown_as_one_part_from_its_launch_point(path: Path) -> None:
    _, grid = load(path)
    assert ndimage.label(grid.flyable)[1] == 1
    assert not any("separate parts" in note for note in grid.notes)
    for row, col in np.argwhere(grid.flyable)[::20]:
        lat, lon = grid.frame.to_latlon([(row, col)])[0]
        route = [(float(lat), float(lon)), *way_home(grid, (float(lat), float(lon)), grid.launch)]
        assert all(leg_is_clear(grid, a, b) for a, b in itertools.pairwise(route))


def test_valley_is_concave_long_and_high() -> None:
    area, grid = load(VALLEY)
    assert area.polygon.area < 0.6 * shapely.convex_hull(area.polygon).area
    assert max(grid.frame.shape) * 25 >= 1200
    assert 45 < area.polygon.centroid.y < 48


def test_coast_exclusion_must_be_flown_around() -> None:
    area, grid = load(COAST)
    assert area.polygon.centroid.y < 0
    (colony,) = area.exclusions
    assert colony.polygon.intersects(area.polygon)
    north_beach, south_beach = [item.position for item in area.priors if isinstance(item, PointPrior)]
    assert not leg_is_clear(grid, north_beach, south_beach)
    assert len(way_home(grid, north_beach, south_beach)) >= 2


def test_farm_is_an_l_with_a_hole_in_the_far_north() -> None:
    area, grid = load(FARM)
    assert 65 < area.polygon.centroid.y < 69
    (fields,) = area.polygon.geoms
    assert len(fields.interiors) == 1
    hull = shapely.convex_hull(area.polygon)
    assert fields.area / hull.area < 0.8
    assert grid.frame.bearing_deg != 0
