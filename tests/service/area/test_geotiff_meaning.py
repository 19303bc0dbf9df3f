"""What the numbers of a GeoTIFF mean: scaled and shifted ones are read as meant, others are refused with the fix."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from rasterio.enums import ColorInterp

from service.area import Grid, build_grid, read_geotiff_prior
from service.errors import BadInput
from tests.service.area.files import collection, parse, square
from tests.service.area.test_geotiff import bumps, write

LEVELS = np.rint(bumps(60) / bumps(60).max() * 200).astype(np.uint8)


@pytest.fixture
def grid() -> Grid:
    return build_grid(parse(collection(square())), 25.0)


def told(path: Path, values: Any, **meaning: Any) -> Path:
    """A raster with something said about its band, such as scales, offsets or units."""
    nodata = meaning.pop("nodata", None)
    write(path, values, nodata=nodata)
    with rasterio.open(path, "r+") as raster:
        for name, value in meaning.items():
            setattr(raster, name, value)
    return path


def test_a_scale_and_an_offset_are_applied(tmp_path: Path, grid: Grid) -> None:
    plain = write(tmp_path / "plain.tif", LEVELS.astype(np.float64) * 0.005 + 0.1)
    packed = told(tmp_path / "packed.tif", LEVELS, scales=(0.005,), offsets=(0.1,))
    expected = read_geotiff_prior(plain, grid.frame, grid.covered)
    assert read_geotiff_prior(packed, grid.frame, grid.covered) == pytest.approx(expected, abs=1e-12)
    unpacked = write(tmp_path / "unpacked.tif", LEVELS)  # which an ignored offset would give
    assert np.abs(read_geotiff_prior(unpacked, grid.frame, grid.covered) - expected).max() > 1e-4


def test_nodata_is_nothing_and_not_the_offset(tmp_path: Path, grid: Grid) -> None:
    holes = LEVELS.copy()
    holes[20:40, 20:40] = 255
    prior = read_geotiff_prior(
        told(tmp_path / "holes.tif", holes, nodata=255, scales=(0.005,), offsets=(0.1,)),
        grid.frame,
        grid.covered,
    )
    dense = np.where(holes == 255, 0.0, holes * 0.005 + 0.1)
    expected = read_geotiff_prior(write(tmp_path / "dense.tif", dense), grid.frame, grid.covered)
    assert prior == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("unit", ["", "%", "percent", "1"])
def test_percent_are_probabilities_too(unit: str, tmp_path: Path, grid: Grid) -> None:
    raster = told(tmp_path / "percent.tif", LEVELS, units=(unit,))
    assert read_geotiff_prior(raster, grid.frame, grid.covered).sum() == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("meaning", "words"),
    [
        ({"units": ("m",)}, r"the raster's unit is 'm'; give probabilities"),
        ({"units": ("dB",)}, r"the raster's unit is 'dB'; give probabilities"),
        ({"colorinterp": (ColorInterp.palette,)}, r"those of a palette's colours; give the probabilities"),
        (
            {"scales": (0.0,), "offsets": (1.0,)},
            r"scale is 0 and its offset 1; give probabilities as they are",
        ),
        ({"offsets": (-1.0,)}, r"pixel row \d+, column \d+ is -\d.*; give probabilities of 0 or more"),
    ],
)
def test_numbers_that_are_no_probabilities_are_refused(
    meaning: dict[str, Any], words: str, tmp_path: Path, grid: Grid
) -> None:
    path = tmp_path / "other.tif"
    told(path, LEVELS, **meaning)
    if "colorinterp" in meaning:
        with rasterio.open(path, "r+") as raster:
            raster.write_colormap(1, {level: (level, 0, 0, 255) for level in range(256)})
    with pytest.raises(BadInput, match=words):
        read_geotiff_prior(path, grid.frame, grid.covered)
