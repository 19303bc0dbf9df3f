"""From settings to a sensor: the cell size, what cannot be, and the example's camera."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from service.area import build_grid, read_area
from service.camera import Looks
from service.camera.sensor import CameraSensor
from service.config import Settings, read_settings
from service.errors import BadInput
from service.evidence.mask import Sensor
from service.evidence.sensors import cell_size, field_of_view, make_sensor
from tests.integration.flight import write_area

CAMERA = Path(__file__).parents[3] / "config" / "camera.toml"


def camera(**changed: Any) -> Settings:
    settings = read_settings(CAMERA, environment={})
    return Settings.model_validate(
        {"flight": settings.flight.model_dump(), "sensor": {**settings.sensor.model_dump(), **changed}}
    )


def test_the_examples_cells_are_half_as_deep_as_its_footprint() -> None:
    """60 m up, tilted 30 degrees, 43 degrees from bottom to top: from tan(8.5) to tan(51.5) of the height."""
    depth = 60.0 * (math.tan(math.radians(51.5)) - math.tan(math.radians(8.5)))
    assert cell_size(camera()) == pytest.approx(0.5 * 0.8 * depth, abs=1.0)
    assert cell_size(camera(cell_m=40.0)) == 40.0


def test_every_profile_has_a_sensor_and_a_field_of_view(tmp_path: Path) -> None:
    area = read_area(write_area(tmp_path))
    for settings in (
        camera(),
        *(Settings.model_validate({"sensor": {"profile": p}}) for p in ("point", "donut")),
    ):
        sensor = make_sensor(settings, build_grid(area, cell_size(settings)))
        assert isinstance(sensor, CameraSensor if settings.sensor.profile == "camera" else Sensor)
        assert field_of_view(settings, cell_size(settings)).p_tp.max() <= 0.9


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"camera_pitch_deg": -5.0}, "tilt the camera down"),
        ({"max_range_m": 50.0}, "tilt the camera down"),
        ({"target_size_m": 0.1}, "fly lower or take a longer lens"),
        ({"cell_m": 90.0}, "smaller cells"),
        ({"min_p_tp": 0.95}, "sensor.min_p_tp = 0.95 is above sensor.p_tp = 0.9"),
        ({"calibration_file": "no-such.csv"}, "no-such.csv"),
    ],
)
def test_a_camera_that_cannot_be_is_told_before_anything_starts(
    tmp_path: Path, changed: dict[str, Any], words: str
) -> None:
    grid = build_grid(read_area(write_area(tmp_path)), changed.get("cell_m", 20.0))
    with pytest.raises(BadInput, match=words):
        make_sensor(camera(**changed), grid)


def test_a_cell_size_of_a_camera_that_sees_nothing_well_enough_is_refused_in_words(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    with pytest.raises(BadInput, match=r"sensor\.min_p_tp = 0\.95 is above"):
        cell_size(camera(min_p_tp=0.95))
    nothing = Looks(np.empty((0, 2), dtype=np.int64), np.empty(0), np.empty(0))
    monkeypatch.setattr("service.evidence.sensors.look_at_cells", lambda *_, **__: nothing)
    with pytest.raises(BadInput, match="nothing is in view from 60 m well enough to count"):
        cell_size(camera())
