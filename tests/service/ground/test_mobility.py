"""How well the ground is walked: rings of lost persons keep to it ring by ring, and a target that walks does too."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from roisearch import Belief
from service.area.model import RING_MASS
from service.config import Settings
from service.errors import BadInput
from service.preview.priors import added_up
from service.survey import survey
from tests.service.area.files import Json, at, box, collection, feature, point, polygon, square
from tests.service.ground.rasters import Floats, write

RINGS = (50.0, 100.0, 150.0, 250.0)
IPP = feature(point(at(0, 0)), role="ipp", rings_m=list(RINGS))
SIDE_M = 600.0


def west_is_scrub(east: Floats, south: Floats) -> Floats:
    """0.25 in the west half of the ground, 1 in the east half."""
    return np.where(east < SIDE_M, 0.25, 1.0)


def settings_with(folder: Path, mobility: object, document: Json) -> Settings:
    """Settings, an area file, and a raster over its grid."""
    (folder / "area.geojson").write_text(json.dumps(document))
    frame = survey(folder / "area.geojson", None, SETTINGS)[1].frame
    file = write(folder / "mobility.tif", frame, mobility, pitch=5.0, reach_m=20.0)  # type: ignore[arg-type]
    return Settings.model_validate({**SETTINGS_TABLES, "ground": {"mobility_file": str(file)}})


SETTINGS_TABLES = {"sensor": {"cell_m": 10.0}}
SETTINGS = Settings.model_validate(SETTINGS_TABLES)


def test_each_ring_keeps_its_part_and_lies_where_it_is_walked(tmp_path: Path) -> None:
    settings = settings_with(tmp_path, west_is_scrub, collection(square(SIDE_M), IPP))
    _, grid = survey(tmp_path / "area.geojson", None, settings)
    metres = (np.indices(grid.prior.shape).transpose(1, 2, 0) + 0.5) * 10.0 - SIDE_M
    away = np.hypot(metres[..., 0], metres[..., 1])
    for radius, held in zip((*RINGS, 500.0), np.cumsum(RING_MASS), strict=True):
        assert grid.prior[away < radius].sum() == pytest.approx(held, abs=0.025)
    west = grid.prior[:, metres[0, :, 1] < 0].sum()
    assert west == pytest.approx(0.25 / 1.25, abs=0.01)
    assert grid.prior.sum() == pytest.approx(1.0)
    assert not any("changes nothing" in note for note in grid.notes)


def test_a_ring_that_nobody_can_walk_in_is_lost_and_the_others_grow(tmp_path: Path) -> None:
    def lake(east: Floats, south: Floats) -> Floats:
        return np.where(np.hypot(east - SIDE_M, south - SIDE_M) < 120.0, 0.0, 1.0)

    settings = settings_with(tmp_path, lake, collection(square(SIDE_M), IPP))
    _, grid = survey(tmp_path / "area.geojson", None, settings)
    metres = (np.indices(grid.prior.shape).transpose(1, 2, 0) + 0.5) * 10.0 - SIDE_M
    assert grid.prior[np.hypot(metres[..., 0], metres[..., 1]) < 100.0].sum() == 0.0
    assert grid.prior.sum() == pytest.approx(1.0)


def test_priors_of_other_kinds_stay_as_they_are_and_add_up_in_the_preview(tmp_path: Path) -> None:
    wood = feature(polygon(box(-400, -400, -300, -300)), role="prior", weight=1)
    document = collection(square(SIDE_M), IPP, wood)
    settings = settings_with(tmp_path, west_is_scrub, document)
    area, grid = survey(tmp_path / "area.geojson", None, settings)
    parts = added_up(area, grid)
    assert [part.sum() for _, part in parts] == pytest.approx([0.5, 0.5])
    assert sum(part for _, part in parts) == pytest.approx(grid.prior)
    _, as_drawn = survey(tmp_path / "area.geojson", None, SETTINGS)
    plain = added_up(area, as_drawn)
    assert parts[1][1] == pytest.approx(plain[1][1])
    assert not np.allclose(parts[0][1], plain[0][1])


def test_a_target_that_walks_keeps_to_it(tmp_path: Path) -> None:
    walking = square(SIDE_M)
    walking["properties"] = {"target": {"moves": "walks", "speed_mps": 1.0}}
    settings = settings_with(tmp_path, west_is_scrub, collection(walking))
    _, grid = survey(tmp_path / "area.geojson", None, settings)
    belief = Belief(grid.prior, searchable=grid.searchable, walk=grid.walk)
    half = grid.prior.shape[1] // 2
    assert belief.probability()[:, :half].sum() == pytest.approx(0.5, abs=0.01)
    belief.drift(1e5)
    assert belief.probability()[:, :half].sum() == pytest.approx(0.2, abs=0.01)


def test_a_raster_that_changes_nothing_is_told(tmp_path: Path) -> None:
    settings = settings_with(tmp_path, west_is_scrub, collection(square(SIDE_M)))
    _, grid = survey(tmp_path / "area.geojson", None, settings)
    assert [note for note in grid.notes if "changes nothing: the area has no ipp" in note]


def test_what_is_no_mobility_is_refused(tmp_path: Path) -> None:
    settings = settings_with(tmp_path, lambda east, south: east, collection(square(SIDE_M), IPP))
    with pytest.raises(BadInput, match=r"has the factor .*; give how well the ground is walked, from 0 \("):
        survey(tmp_path / "area.geojson", None, settings)
    settings = settings_with(tmp_path, lambda east, south: 0.0 * east, collection(square(SIDE_M), IPP))
    with pytest.raises(BadInput, match="no mass on any cell that is searched and can be walked"):
        survey(tmp_path / "area.geojson", None, settings)
    (tmp_path / "mobility.tif").write_bytes(b"no raster")
    with pytest.raises(BadInput, match="not a readable raster of mobility"):
        survey(tmp_path / "area.geojson", None, settings)
