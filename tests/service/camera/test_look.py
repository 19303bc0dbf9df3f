"""What a frame shows: covered parts, p_tp by range and angle, the horizon, terrain."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import shapely

from service.area import GridFrame
from service.camera import (
    Detectability,
    Flat,
    Ground,
    Looks,
    Pinhole,
    Sight,
    Terrain,
    look_at_cells,
    rotation,
    sight_from,
    terrain_of,
)
from service.camera.optics import Floats
from service.ground.reading import read_relief

CELL = 20.0
FRAME = GridFrame(47.05, 8.30, 0.0, CELL, 40, 40, -400.0, 400.0)
MIDDLE = (410.0, 410.0)  # the centre of cell (20, 20)
DETECT = Detectability(p_tp=0.9, size_m=0.9, half_px=8.0, nominal_px=16.0, floor=0.2)
CAMERA = Pinhole.of_angles(1920, 1080, 70.0)


def at(pitch: float, *, roll: float = 0.0, yaw: float = 0.0, height: float = 60.0) -> Sight:
    return sight_from(CAMERA, (*MIDDLE, height), rotation(yaw, pitch, roll))


def look(sight: Sight, ground: Ground | None = None, **options: float) -> Looks:
    limits = {"max_range_m": 300.0, "min_grazing_deg": 10.0, **options}
    return look_at_cells(sight, ground or Flat(), FRAME, DETECT, **limits)  # type: ignore[arg-type]


def by_cell(looks: Looks) -> dict[tuple[int, int], tuple[float, float]]:
    cells = [(row, col) for row, col in looks.cells.tolist()]
    return dict(zip(cells, zip(looks.covered.tolist(), looks.p_tp.tolist(), strict=True), strict=True))


@pytest.mark.parametrize(("pitch", "roll", "yaw"), [(-90, 0, 0), (-60, 0, 0), (-45, 0, 30), (-70, 25, 200)])
def test_the_covered_part_is_the_exact_one_but_for_the_stated_error(
    pitch: float, roll: float, yaw: float
) -> None:
    sight = at(pitch, roll=roll, yaw=yaw)
    corners = sight.rays([[0, 0], [1920, 0], [1920, 1080], [0, 1080]])
    far = Flat().meet(sight.position, corners, 1e4)
    quad = shapely.Polygon((sight.position + far[:, None] * corners)[:, :2])
    keen = Detectability(p_tp=0.9, size_m=0.9, half_px=0.1, nominal_px=1.0, floor=0.01)
    seen = by_cell(look_at_cells(sight, Flat(), FRAME, keen, max_range_m=1000.0, min_grazing_deg=0.1))
    worst = 0.0
    for row in range(40):
        for col in range(40):
            square = shapely.box(col * CELL, row * CELL, (col + 1) * CELL, (row + 1) * CELL)
            exact = shapely.intersection(square, quad).area / CELL**2
            worst = max(worst, abs(seen.get((row, col), (0.0, 0.0))[0] - exact))
    assert worst < 1 / 8
    assert sum(seen[cell][0] for cell in seen) * CELL**2 == pytest.approx(quad.area, rel=0.05)


def test_p_tp_is_the_nominal_one_in_the_middle_and_falls_with_range_and_angle() -> None:
    seen = by_cell(look(at(-45.0)))
    ahead = [seen[row, 20][1] for row in range(18, 12, -1) if seen.get((row, 20), (0.0, 0.0))[0] == 1.0]
    assert len(ahead) >= 3
    assert ahead == sorted(ahead, reverse=True)
    assert ahead[0] <= 0.9
    assert ahead[-1] < 0.6


def test_pixels_on_target_are_counted_as_said() -> None:
    n = DETECT.pixels(1000.0, np.array([50.0, 100.0, 100.0]), np.array([1.0, 1.0, 0.25]))
    assert n == pytest.approx([18.0, 9.0, 4.5])
    p = DETECT.chance(np.array([16.0, 100.0, 8.0, 3.0]))
    assert p[:2] == pytest.approx([0.9, 0.9])
    transfer = 2.0**4.1 / (1.0 + 2.0**4.1)
    assert p[2] == pytest.approx(0.9 * 0.5 / transfer)
    assert p[3] == 0.0  # below the floor


def test_above_the_horizon_and_beyond_the_range_nothing_is_seen() -> None:
    level = look(at(-5.0), min_grazing_deg=0.5)
    assert len(level.cells)
    far = np.hypot(*((level.cells[:, ::-1] + 0.5) * CELL - np.array(MIDDLE)).T)
    assert far.max() < 300.0 + CELL
    assert (level.cells[:, 0] < 20).all()  # it looks north
    assert not len(look(at(0.0, height=60.0), min_grazing_deg=30.0).cells)


def test_ground_at_a_flatter_angle_than_allowed_is_not_seen() -> None:
    seen = look(at(-45.0), min_grazing_deg=45.0)
    south = (seen.cells[:, 0].min()) * CELL
    assert MIDDLE[1] - south <= 60.0 + CELL


def test_a_camera_on_or_under_the_ground_sees_nothing() -> None:
    assert not len(look(at(-90.0, height=0.0)).cells)


def ridge(height_m: float) -> Terrain:
    """A wall 30 m to the north of the middle, level ground elsewhere."""
    heights = np.zeros((181, 181))
    heights[70:72] = height_m  # posts every 5 m from -50: 300 and 305 m south of the corner...
    return Terrain(heights, 5.0, -50.0, -50.0)


def test_a_ridge_hides_what_is_behind_it() -> None:
    # the wall stands at 300 to 305 m, 105 m north of the camera at 60 m; 40 m of wall shadow the next 200 m
    open_ground = by_cell(look(at(-25.0), Terrain(np.zeros((181, 181)), 5.0, -50.0, -50.0)))
    flat = by_cell(look(at(-25.0)))
    assert open_ground.keys() == flat.keys()
    assert all(open_ground[cell] == pytest.approx(flat[cell], abs=1e-12) for cell in flat)
    behind = by_cell(look(at(-25.0), ridge(40.0)))
    assert (13, 20) in open_ground
    assert (13, 20) not in behind
    assert behind[17, 20][0] == open_ground[17, 20][0]


def test_a_ray_meets_a_hill_before_the_plain() -> None:
    ray = at(-25.0).rays([[960, 540]])
    plain = Flat().meet(at(-25.0).position, ray, 300.0)[0]
    hill = ridge(40.0).meet(at(-25.0).position, ray, 300.0)[0]
    assert plain == pytest.approx(60.0 / math.sin(math.radians(25.0)))
    assert hill < plain
    point = at(-25.0).position + hill * ray[0]
    assert ridge(40.0).height_at(point[None, :2])[0] == pytest.approx(point[2], abs=0.01)


def test_a_height_model_is_laid_under_the_grid_relative_to_the_launch(tmp_path: Path) -> None:
    rasterio = pytest.importorskip("rasterio")
    from rasterio.transform import from_origin

    west, north = FRAME.corners()[:, 1].min() - 0.01, FRAME.corners()[:, 0].max() + 0.01
    side = 0.0005
    rows, cols = 80, 80
    lats = north - (np.arange(rows) + 0.5) * side
    heights = np.broadcast_to((500.0 + 1000.0 * (lats - 47.05))[:, None], (rows, cols)).astype("float32")
    file = tmp_path / "dem.tif"
    with rasterio.open(
        file, "w", driver="GTiff", width=cols, height=rows, count=1, dtype="float32", crs="EPSG:4326",
        transform=from_origin(west, north, side, side),
    ) as raster:  # fmt: skip
        raster.write(heights, 1)
    launch = tuple(FRAME.to_latlon([[20, 20]])[0])
    terrain = terrain_of(read_relief([str(file)], FRAME, launch, reach_m=300.0))
    for cell in ([20, 20], [3, 30], [38, 2]):
        lat, lon = FRAME.to_latlon([cell])[0]
        here = FRAME.to_metres([[lat, lon]])
        assert terrain.height_at(here)[0] == pytest.approx(1000.0 * (lat - launch[0]), abs=0.2)


def test_a_camera_at_the_horizon_looks_no_farther_than_what_it_sees_steeply_enough() -> None:
    class Counting(Flat):
        most = 0

        def height_at(self, points: Floats) -> Floats:
            type(self).most = max(self.most, len(points))
            return super().height_at(points)

    ground = Counting()
    limits = {"max_range_m": 4000.0, "min_grazing_deg": 10.0}
    far = look_at_cells(at(-20.0), ground, FRAME, DETECT, bounded=False, **limits)  # type: ignore[arg-type]
    reach = 60.0 / math.sin(math.radians(10.0))
    assert ground.most <= 36 * (reach / CELL + 3) * (2 * reach / CELL + 3)
    near = look_at_cells(
        at(-20.0), Flat(), FRAME, DETECT, bounded=False, max_range_m=reach, min_grazing_deg=10.0
    )
    assert by_cell(far) == by_cell(near)
