"""A prior from a GeoTIFF: mass is conserved whatever the raster's CRS and pixel size."""

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pyproj
import pytest
import rasterio
from rasterio.transform import from_origin

from service.area import Grid, build_grid, read_geotiff_prior
from service.errors import BadInput
from tests.service.area.files import HERE, collection, parse, square

UTM = "EPSG:32632"


@pytest.fixture
def grid() -> Grid:
    return build_grid(parse(collection(square())), 25.0)


def write(
    path: Path,
    values: Any,
    *,
    crs: str | None = UTM,
    pixel: float = 10.0,
    half: float = 300.0,
    **options: Any,
) -> Path:
    """A north-up raster whose north-west corner is `half` units west and north of the test area's middle."""
    band = np.atleast_3d(np.asarray(values)).transpose(2, 0, 1)
    x, y = HERE[::-1]
    if crs is not None:
        x, y = pyproj.Transformer.from_crs("EPSG:4326", crs, always_xy=True).transform(x, y)
    profile = {"driver": "GTiff", "count": len(band), "height": band.shape[1], "width": band.shape[2]}
    with rasterio.open(
        path,
        "w",
        crs=crs,
        dtype=band.dtype,
        transform=from_origin(x - half, y + half, pixel, pixel),
        **profile,
        **options,
    ) as raster:
        raster.write(band)
    return path


def bumps(size: int) -> np.ndarray[Any, Any]:
    """A prior with two hills, float [size, size]."""
    y, x = np.mgrid[0:size, 0:size] / size
    return np.exp(-((x - 0.6) ** 2 + (y - 0.4) ** 2) / 0.01) + 0.5 * np.exp(
        -((x - 0.35) ** 2 + (y - 0.6) ** 2) / 0.02
    )


@pytest.mark.parametrize(("pixel", "size"), [(1.0, 600), (10.0, 60), (60.0, 10), (300.0, 2), (1500.0, 2)])
def test_mass_of_each_part_arrives_whatever_the_pixel_size(
    tmp_path: Path, grid: Grid, pixel: float, size: int
) -> None:
    """The raster's mass in the area's north-east quarter is the grid's mass there."""
    values = np.ones((size, size)) / size**2
    values[: size // 2, size // 2 :] *= 3
    path = write(tmp_path / "prior.tif", values, pixel=pixel, half=pixel * size / 2)
    prior = read_geotiff_prior(path, grid.frame, grid.covered)
    assert prior.sum() == pytest.approx(1)
    assert prior[:8, 8:].sum() == pytest.approx(0.5, abs=0.02)
    assert prior[8:, :8].sum() == pytest.approx(1 / 6, abs=0.02)


def test_raster_in_degrees_and_in_utm_agree(tmp_path: Path, grid: Grid) -> None:
    values = bumps(240)
    utm = read_geotiff_prior(write(tmp_path / "utm.tif", values, pixel=2.5), grid.frame, grid.covered)
    x, y = pyproj.Transformer.from_crs("EPSG:4326", UTM, always_xy=True).transform(*HERE[::-1])
    step = 1e-5
    rows, cols = np.mgrid[0:700, 0:1000]
    lon, lat = HERE[1] - 0.005 + (cols + 0.5) * step, HERE[0] + 0.0035 - (rows + 0.5) * step
    east, north = pyproj.Transformer.from_crs("EPSG:4326", UTM, always_xy=True).transform(lon, lat)
    row, col = ((y + 300 - north) / 2.5).astype(int), ((east - x + 300) / 2.5).astype(int)
    inside = (row >= 0) & (row < 240) & (col >= 0) & (col < 240)
    same = np.where(inside, values[row.clip(0, 239), col.clip(0, 239)], 0.0)
    path = tmp_path / "degrees.tif"
    with rasterio.open(
        path,
        "w",
        driver="GTiff",
        count=1,
        height=700,
        width=1000,
        dtype="float64",
        crs="EPSG:4326",
        transform=from_origin(HERE[1] - 0.005, HERE[0] + 0.0035, step, step),
    ) as raster:
        raster.write(same, 1)
    degrees = read_geotiff_prior(path, grid.frame, grid.covered)
    assert degrees == pytest.approx(utm, abs=2e-4)
    assert utm.max() > 0.01


def test_peak_lands_in_the_right_cell(tmp_path: Path, grid: Grid) -> None:
    values = np.zeros((60, 60), dtype=np.float32)
    values[28, 31] = 1.0
    prior = read_geotiff_prior(write(tmp_path / "prior.tif", values), grid.frame, grid.covered)
    to_degrees = pyproj.Transformer.from_crs(UTM, "EPSG:4326", always_xy=True)
    x, y = pyproj.Transformer.from_crs("EPSG:4326", UTM, always_xy=True).transform(*HERE[::-1])
    lon, lat = to_degrees.transform(x + 15, y + 15)
    row, col = grid.frame.to_cells([[lat, lon]])[0]
    assert prior[row, col] == pytest.approx(1.0)


def test_nodata_and_nan_count_as_nothing(tmp_path: Path, grid: Grid) -> None:
    values = np.ones((60, 60))
    values[:, :30] = -9999.0
    values[:30, 30:] = np.nan
    prior = read_geotiff_prior(
        write(tmp_path / "prior.tif", values, nodata=-9999.0), grid.frame, grid.covered
    )
    assert prior[:, :7].sum() == 0
    assert prior[:7].sum() == 0
    assert prior.sum() == pytest.approx(1)


def test_only_the_covered_part_of_a_cell_gets_mass(tmp_path: Path, grid: Grid) -> None:
    covered = grid.covered.copy()
    covered[:, :8] = 0.0
    covered[0, 8:] = 0.5
    prior = read_geotiff_prior(write(tmp_path / "prior.tif", np.ones((60, 60))), grid.frame, covered)
    assert prior[:, :8].sum() == 0
    assert prior[0, 10] / prior[5, 10] == pytest.approx(0.5, rel=0.05)


def test_integer_raster_is_fine_and_becomes_the_grids_prior(tmp_path: Path, grid: Grid) -> None:
    values = (255 * bumps(60) / bumps(60).max()).astype(np.uint8)
    prior = read_geotiff_prior(write(tmp_path / "prior.tif", values), grid.frame, grid.covered)
    assert grid.with_prior(prior).prior == pytest.approx(prior)


REFUSED: dict[str, tuple[Any, dict[str, Any], str]] = {
    "negative": (
        np.full((60, 60), -9999.0),
        {},
        "pixel row 8, column 8 is -9999; give probabilities of 0 or more",
    ),
    "infinite": (np.full((60, 60), np.inf), {}, "is inf; give probabilities"),
    "all zero": (np.zeros((60, 60)), {}, "the raster has no probability inside the area"),
    "elsewhere": (
        np.ones((60, 60)),
        {"half": -90_000.0},
        "no probability inside the area; check that it covers",
    ),
    "three bands": (np.ones((60, 60, 3)), {}, "the raster has 3 bands; give one band of probabilities"),
    "coarse": (
        np.ones((9, 9)),
        {"pixel": 2e4, "half": 9e4},
        "a pixel is wider than 64 cells of 25 m; resample",
    ),
    "no crs": (np.ones((60, 60)), {"crs": None}, "the raster has no coordinate reference system; set one"),
    "complex": (np.ones((60, 60), dtype=np.complex64), {}, "complex numbers; give probabilities"),
}


@pytest.mark.filterwarnings("ignore::rasterio.errors.NotGeoreferencedWarning")
@pytest.mark.parametrize("name", REFUSED)
def test_unusable_raster_is_refused_with_the_fix(tmp_path: Path, grid: Grid, name: str) -> None:
    values, options, words = REFUSED[name]
    path = write(tmp_path / "prior.tif", values, **options)
    with pytest.raises(BadInput) as caught:
        read_geotiff_prior(path, grid.frame, grid.covered)
    assert str(caught.value).startswith(f"{path}: ")
    assert words in str(caught.value)


def test_file_that_is_no_raster_is_refused(tmp_path: Path, grid: Grid) -> None:
    path = tmp_path / "prior.tif"
    path.write_text("not a raster")
    with pytest.raises(BadInput, match="not a readable GeoTIFF"):
        read_geotiff_prior(path, grid.frame, grid.covered)
    with pytest.raises(BadInput, match="there is no such file; check the path"):
        read_geotiff_prior(tmp_path / "nowhere.tif", grid.frame, grid.covered)


def test_missing_rasterio_says_what_to_install(
    tmp_path: Path, grid: Grid, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "rasterio", None)
    with pytest.raises(BadInput, match=r"needs rasterio; run pip install 'roisearch\[geotiff\]'"):
        read_geotiff_prior(tmp_path / "prior.tif", grid.frame, grid.covered)
