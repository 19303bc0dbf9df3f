"""The grid on the ground: exact way back, true distances at every latitude, turned when it pays."""

import json
import math
import threading

import numpy as np
import pyproj
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from service.area.frame import GridFrame, lay_frame
from service.area.projection import Projection
from tests.service.area.files import parse, polygon, ring

GEOD = pyproj.Geod(ellps="WGS84")
LATITUDES = st.sampled_from([0.0, 70.0, -33.9]) | st.floats(-85, 85)
LONGITUDES = st.floats(-180, 180)
PARTS = st.floats(0, 1)


def frame_at(lat: float, lon: float, bearing: float, cell_m: float, rows: int, cols: int) -> GridFrame:
    return GridFrame(lat, lon, bearing, cell_m, rows, cols, -cols * cell_m / 2, rows * cell_m / 2)


def wide_frame(lat: float, lon: float, bearing: float = 0.0) -> GridFrame:
    """A grid whose corners are 20 km from its centre."""
    side = 2 * 20_000 / math.sqrt(2)
    return frame_at(lat, lon, bearing, side / 1000, 1000, 1000)


@given(LATITUDES, LONGITUDES, st.floats(-45, 45), st.floats(0.5, 200), PARTS, PARTS)
def test_cell_to_position_to_cell_is_the_identity(
    lat: float, lon: float, bearing: float, cell_m: float, down: float, across: float
) -> None:
    frame = frame_at(lat, lon, bearing, cell_m, 150, 100)
    cells = np.array([[int(down * 149), int(across * 99)], [0, 0], [149, 99]])
    back, inside = frame.locate(frame.to_latlon(cells))
    assert (back == cells).all()
    assert inside.all()
    assert (frame.to_cells(frame.to_latlon(cells)) == cells).all()


@given(LATITUDES, LONGITUDES, st.floats(-45, 45), st.lists(PARTS, min_size=4, max_size=4))
def test_distances_between_cells_agree_with_the_geodesic_to_1_in_100000(
    lat: float, lon: float, bearing: float, parts: list[float]
) -> None:
    frame = wide_frame(lat, lon, bearing)
    cells = (np.array(parts).reshape(2, 2) * 999).astype(int)
    if (cells[0] == cells[1]).all():
        cells[1] = (cells[1] + 1) % 1000
    (lat0, lon0), (lat1, lon1) = frame.to_latlon(cells)
    on_grid = frame.cell_m * math.hypot(*(cells[1] - cells[0]))
    on_earth = GEOD.inv(lon0, lat0, lon1, lat1)[2]
    assert on_grid == pytest.approx(on_earth, rel=1e-5)


@pytest.mark.parametrize("lat", [0.0, 70.0, -45.0])
@pytest.mark.parametrize("bearing", [0.0, 30.0])
def test_distances_hold_where_the_grid_is_stretched_most(lat: float, bearing: float) -> None:
    """At the rim, across the radius: between neighbours in the corners and along every edge."""
    frame = wide_frame(lat, 20.0, bearing)
    pairs = [
        ((0, 0), (5, 0)),
        ((0, 0), (0, 5)),
        ((999, 999), (994, 999)),
        ((0, 0), (5, -5)),
        ((500, 0), (501, 0)),
    ]
    for start, end in pairs:
        (lat0, lon0), (lat1, lon1) = frame.to_latlon([start, end])
        on_grid = frame.cell_m * math.dist(start, end)
        assert on_grid == pytest.approx(GEOD.inv(lon0, lat0, lon1, lat1)[2], rel=1e-5)


@given(st.floats(-80, 80), LONGITUDES, st.floats(-45, 45))
def test_bearing_is_the_true_bearing_of_the_grids_north(lat: float, lon: float, bearing: float) -> None:
    frame = frame_at(lat, lon, bearing, 10.0, 21, 21)
    (lat0, lon0), (lat1, lon1) = frame.to_latlon([[10, 10], [9, 10]])
    azimuth = GEOD.inv(lon0, lat0, lon1, lat1)[0]
    assert (azimuth - bearing + 180) % 360 - 180 == pytest.approx(0, abs=1e-3)


def test_rows_go_north_to_south_and_columns_west_to_east() -> None:
    frame = frame_at(-33.0, 151.0, 0.0, 25.0, 10, 8)
    north_west, south_east = frame.to_latlon([[0, 0], [9, 7]])
    assert north_west[0] > south_east[0]
    assert north_west[1] < south_east[1]
    corners = frame.corners()
    assert (corners[0] > corners[2]).tolist() == [True, False]


def test_metres_are_east_and_south_of_the_north_west_corner() -> None:
    frame = frame_at(47.0, 11.0, 20.0, 25.0, 10, 8)
    assert frame.to_metres(frame.corners()[0]) == pytest.approx(np.array([[0, 0]]), abs=1e-6)
    assert frame.to_metres(frame.corners()[2]) == pytest.approx(np.array([[200, 250]]), abs=1e-6)
    assert frame.to_metres(frame.to_latlon([[2, 3]])) == pytest.approx(np.array([[87.5, 62.5]]), abs=1e-6)
    assert frame.from_metres([[87.5, 62.5]]) == pytest.approx(frame.to_latlon([[2, 3]]), abs=1e-12)


def test_positions_off_the_grid_are_marked() -> None:
    frame = frame_at(47.0, 11.0, 0.0, 25.0, 10, 8)
    beside = [[-1, 0], [0, -1], [10, 0], [0, 8], [9, 7]]
    cells, inside = frame.locate(frame.to_latlon(beside))
    assert cells.tolist() == beside
    assert inside.tolist() == [False, False, False, False, True]


def test_nonsense_positions_are_off_the_grid() -> None:
    frame = frame_at(47.0, 11.0, 0.0, 25.0, 10, 8)
    _, inside = frame.locate([[math.nan, 11.0], [95.0, 11.0], [math.inf, math.inf], [-47.0, -169.0]])
    assert not inside.any()


@given(LATITUDES, LONGITUDES, st.floats(-45, 45), st.floats(0.1, 1000))
def test_frame_goes_through_the_journal_unchanged(
    lat: float, lon: float, bearing: float, cell_m: float
) -> None:
    frame = frame_at(lat, lon, bearing, cell_m, 7, 9)
    assert GridFrame.from_dict(json.loads(json.dumps(frame.to_dict()))) == frame


@pytest.mark.parametrize("turn", [10.0, 44.0, 60.0, -20.0])
def test_grid_is_turned_along_a_long_area(turn: float) -> None:
    """A strip of 1000 x 100 m whose long side points to a true bearing of `turn` degrees."""
    along, across = (math.sin(math.radians(turn)), math.cos(math.radians(turn))), 50.0
    corners = [
        (500 * a * along[0] + across * b * along[1], 500 * a * along[1] - across * b * along[0])
        for a, b in [(-1, -1), (1, -1), (1, 1), (-1, 1)]
    ]
    frame = lay_frame(parse(polygon(ring(corners))).polygon, 25.0)
    assert sorted(frame.shape) == [4, 40]
    expected = turn if turn <= 45 else turn - 90
    assert frame.bearing_deg == pytest.approx(expected, abs=0.01)


def test_grid_stays_true_north_when_turning_saves_nothing() -> None:
    circle = [(300 * math.cos(a), 300 * math.sin(a)) for a in np.linspace(0, 6.2, 40)]
    assert lay_frame(parse(polygon(ring(circle))).polygon, 25.0).bearing_deg == 0.0


def test_whole_area_lies_in_the_grid() -> None:
    shape = parse(polygon(ring([(-400, -90), (310, 70), (280, 190), (-390, 40)]))).polygon
    for cell_m in (7.0, 25.0, 200.0):
        frame = lay_frame(shape, cell_m)
        west, north, east, south = shapely.bounds(frame.flatten(shape))
        assert min(west, north) > -1e-3 * cell_m
        assert east < (frame.cols + 1e-3) * cell_m
        assert south < (frame.rows + 1e-3) * cell_m
        assert max(west, frame.cols * cell_m - east) < cell_m


def test_edges_follow_the_parallel_as_geojson_says() -> None:
    """RFC 7946, section 3.1.1: an edge is straight in degrees; at 70° north, 18 km bend by more than 17 m."""
    west, east = 19.76, 20.24
    edge = shapely.LineString([[west, 70.0], [east, 70.0]])
    flat = Projection(70.0, 20.0).flatten(edge)
    on_parallel = Projection(70.0, 20.0).forward([[70.0, 20.0]])[0]
    assert shapely.distance(flat, shapely.Point(on_parallel)) < 0.1
    chord = shapely.LineString(Projection(70.0, 20.0).forward([[70.0, west], [70.0, east]]))
    assert shapely.distance(chord, shapely.Point(on_parallel)) > 17


def test_frame_works_in_many_threads_at_once() -> None:
    frame = frame_at(47.0, 11.0, 12.0, 25.0, 100, 100)
    cells = np.argwhere(np.ones(frame.shape, dtype=bool))
    wrong: list[int] = []

    def work() -> None:
        wrong.extend(int((frame.to_cells(frame.to_latlon(cells)) != cells).sum()) for _ in range(5))

    threads = [threading.Thread(target=work) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert wrong == [0] * 20
