"""Height models: every kind is laid onto the plane, and what is none is refused in one sentence."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely

from service.area import GridFrame
from service.errors import BadInput
from service.ground.reading import check_covered, read_relief
from service.ground.relief import Relief
from tests.service.ground.rasters import Floats, write

FRAME = GridFrame(47.05, 8.30, 0.0, 20.0, 40, 40, -400.0, 400.0)
TURNED = GridFrame(47.05, 8.30, 30.0, 20.0, 40, 40, -400.0, 400.0)
PLACES = np.array([[410.0, 410.0], [50.0, 700.0], [790.0, 20.0], [-200.0, 900.0]])


def slope(east: Floats, south: Floats) -> Floats:
    """A plane, which any resampling keeps."""
    return 900.0 + 0.3 * east - 0.2 * south


def launch_of(frame: GridFrame) -> tuple[float, float]:
    lat, lon = frame.to_latlon([[20, 20]])[0]
    return float(lat), float(lon)


def read(path: Path | list[Path], frame: GridFrame = FRAME, **options: Any) -> Relief:
    paths = path if isinstance(path, list) else [path]
    return read_relief([str(each) for each in paths], frame, launch_of(frame), reach_m=300.0, **options)


def check(path: Path | list[Path], frame: GridFrame = FRAME, within: float = 0.7) -> None:
    """A pixel's height is kept at the post next to it: on a slope that raises it by no more than its share."""
    relief = read(path, frame)
    launch = slope(PLACES[:1, 0], PLACES[:1, 1])[0]
    found, true = relief.height_at(PLACES), slope(PLACES[:, 0], PLACES[:, 1]) - launch
    assert (np.abs(found - true) <= within + 0.36 * 0.71 * relief.step_m).all()
    assert (found >= true - within).all()
    assert relief.launch_amsl_m == pytest.approx(launch, abs=within)


@pytest.mark.parametrize("frame", [FRAME, TURNED])
@pytest.mark.parametrize("crs", ["EPSG:4326", "EPSG:32632", "EPSG:3857", "EPSG:2056", "EPSG:4979"])
def test_any_reference_system_is_laid_onto_the_plane(tmp_path: Path, crs: str, frame: GridFrame) -> None:
    check(write(tmp_path / "dem.tif", frame, slope, crs=crs), frame)


@pytest.mark.parametrize(
    "options",
    [
        {"turn_deg": 25.0},
        {"south_up": True},
        {"south_up": True, "turn_deg": -70.0},
        {"pitch": 1.5, "reach_m": 320.0},
        {"pitch": 90.0},
        {"scale": 0.1, "dtype": "int16", "offset": 500.0},
    ],
    ids=str,
)
def test_how_the_raster_lies_and_counts_makes_no_difference(tmp_path: Path, options: dict[str, Any]) -> None:
    check(write(tmp_path / "dem.tif", FRAME, slope, crs="EPSG:32632", **options))


@pytest.mark.parametrize(
    ("unit", "metres"), [("feet", 0.3048), ("ft", 0.3048), ("US survey foot", 1200 / 3937)]
)
def test_feet_become_metres(tmp_path: Path, unit: str, metres: float) -> None:
    check(write(tmp_path / "dem.tif", FRAME, lambda e, s: slope(e, s) / metres, unit=unit))


def test_the_vertical_reference_system_tells_the_unit_when_the_band_does_not(tmp_path: Path) -> None:
    def feet(east: Floats, south: Floats) -> Floats:
        return slope(east, south) * 3937 / 1200

    check(write(tmp_path / "a.tif", FRAME, feet, crs="EPSG:4326+6360"))
    with pytest.raises(
        BadInput, match="its band is in 'm' and its vertical reference system in US survey foot"
    ):
        read(write(tmp_path / "b.tif", FRAME, feet, crs="EPSG:4326+6360", unit="m"))


def test_srtm_tiles_and_several_files_are_one_ground(tmp_path: Path) -> None:
    import rasterio
    from rasterio.transform import from_origin

    frame = GridFrame(47.0, 8.5, 0.0, 20.0, 40, 40, -400.0, 400.0)  # on the edge between two tiles
    tiles = []
    for south in (46, 47):
        side = 1.0 / 1200.0
        lat = south + 1.0 - np.arange(1201) * side
        lon = 8.0 + np.arange(1201) * side
        grid = np.stack(np.meshgrid(lat, lon, indexing="ij"), axis=-1).reshape(-1, 2)
        plane = frame.to_metres(grid)
        near = np.abs(plane) < 20_000.0
        values = np.where(near.all(axis=1), slope(plane[:, 0], plane[:, 1]), -32768).reshape(1201, 1201)
        path = tmp_path / f"N{south}E008.hgt"
        with rasterio.open(
            path, "w", driver="SRTMHGT", width=1201, height=1201, count=1, dtype="int16", crs="EPSG:4326",
            transform=from_origin(8.0 - side / 2, south + 1.0 + side / 2, side, side),
        ) as raster:  # fmt: skip
            raster.write(np.rint(values).astype("int16"), 1)
        tiles.append(path)
    check(tiles, frame, within=2.0)
    relief = read(tiles[1], frame)
    with pytest.raises(BadInput, match="no height for"):
        check_covered(relief, shapely.box(0.0, 0.0, 800.0, 800.0), ["one.hgt"])


def spoilt(values: Any, with_what: float) -> None:
    middle = values.shape[0] // 2
    values[middle + 8 : middle + 12, middle + 8 : middle + 12] = with_what


@pytest.mark.parametrize(
    ("void", "profile"),
    [
        (-32768.0, {}),
        (-9999.0, {"nodata": -9999.0}),
        (-3.4028234663852886e38, {}),
        (float("nan"), {}),
        (float("inf"), {}),
        (0.0, {}),
        (1234.5, {"nodata": 1234.5}),
    ],
)
def test_voids_are_never_ground(tmp_path: Path, void: float, profile: dict[str, Any]) -> None:
    file = write(tmp_path / "dem.tif", FRAME, slope, spoil=lambda values: spoilt(values, void), **profile)
    relief = read(file)
    assert np.isnan(relief.heights).any()
    assert np.nanmin(relief.heights) > -600.0
    with pytest.raises(BadInput, match=r"has no height for [\d.]+% of the area"):
        check_covered(relief, shapely.box(0.0, 0.0, 800.0, 800.0), [str(file)])
    check_covered(relief, shapely.box(0.0, 0.0, 300.0, 300.0), [str(file)])
    hole = np.argwhere(np.isnan(relief.heights))[0]
    there = np.array([[relief.west_m + hole[1] * relief.step_m, relief.north_m + hole[0] * relief.step_m]])
    assert np.isinf(relief.roof_at(there)[0])


def test_the_sea_beside_a_shore_is_ground_of_zero_metres(tmp_path: Path) -> None:
    def shore(east: Floats, south: Floats) -> Floats:
        return np.maximum(0.0, 0.2 * (east - 500.0)) + 150.0 * (south < 200.0) * (east > 500.0)

    relief = read(write(tmp_path / "dem.tif", FRAME, shore))
    assert not np.isnan(relief.heights).any()


def palette(values: Any) -> None:
    values[:] = values % 200


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda p: write(p, FRAME, slope, unit="K"), "its unit is 'K'"),
        (lambda p: write(p, FRAME, slope, dtype="complex64"), "complex numbers"),
        (lambda p: write(p, FRAME, slope, dtype="uint8", photometric="palette", spoil=palette), "palette"),
        (lambda p: write(p, FRAME, slope, scale=float("inf")), "its scale is inf"),
    ],
)
def test_what_is_no_height_model_is_refused(tmp_path: Path, make: Callable[[Path], Path], said: str) -> None:
    import warnings

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        file = make(tmp_path / "dem.tif")
    with pytest.raises(BadInput, match=said):
        read(file)


def test_pictures_and_files_without_a_place_are_refused(tmp_path: Path) -> None:
    import rasterio

    colours = tmp_path / "rgb.tif"
    with rasterio.open(
        colours, "w", driver="GTiff", width=4, height=4, count=3, dtype="uint8", crs="EPSG:4326"
    ) as raster:
        raster.write(np.zeros((3, 4, 4), dtype="uint8"))
    with pytest.raises(BadInput, match="one band of metres, this has 3"):
        read(colours)
    nowhere = tmp_path / "nowhere.tif"
    with rasterio.open(nowhere, "w", driver="GTiff", width=4, height=4, count=1, dtype="float32") as raster:
        raster.write(np.zeros((4, 4), dtype="float32"), 1)
    with pytest.raises(BadInput, match="no coordinate reference system"):
        read(nowhere)
    text = tmp_path / "text.tif"
    text.write_text("heights")
    with pytest.raises(BadInput, match="not a readable height model"):
        read(text)
    with pytest.raises(BadInput, match=r"no such height model; check ground\.file"):
        read(tmp_path / "none.tif")


def test_a_launch_point_beyond_the_file_is_refused(tmp_path: Path) -> None:
    file = write(tmp_path / "dem.tif", FRAME, slope, reach_m=0.0)
    with pytest.raises(BadInput, match="no height at the launch point"):
        read_relief([str(file)], FRAME, (47.08, 8.30), reach_m=300.0)
    with pytest.raises(BadInput, match="no height at the launch point"):
        read_relief([str(file)], FRAME, (10.0, 10.0), reach_m=300.0)


@pytest.mark.parametrize("pitch", [1.4, 7.0, 25.0])
def test_a_single_pixel_that_stands_out_is_not_smoothed_away(tmp_path: Path, pitch: float) -> None:
    def spike(values: Any) -> None:
        middle = values.shape[0] // 2
        values[middle + 3, middle - 5] += 80.0

    file = write(tmp_path / "dem.tif", FRAME, lambda e, s: np.full_like(e, 500.0), pitch=pitch, spoil=spike,
                 crs="EPSG:32632", reach_m=200.0)  # fmt: skip
    assert np.nanmax(read(file, TURNED).heights) == pytest.approx(80.0)  # void beyond the file


def test_a_surface_model_beside_a_ground_model_counts_where_it_is_higher(tmp_path: Path) -> None:
    ground = write(tmp_path / "dtm.tif", FRAME, slope)

    def with_trees(east: Floats, south: Floats) -> Floats:
        return slope(east, south) + 25.0 * (np.hypot(east - 410.0, south - 410.0) < 100.0)

    surface = write(tmp_path / "dsm.tif", FRAME, with_trees)
    both = read([surface, ground])
    assert both.launch_amsl_m == pytest.approx(slope(PLACES[:1, 0], PLACES[:1, 1])[0], abs=0.7)
    assert both.height_at(PLACES[:1])[0] >= 24.0
