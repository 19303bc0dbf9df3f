"""A mock over ground that is not flat: it takes off, measures, lands on it and crashes into it; and a fresh battery."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import rasterio
from rasterio.transform import from_origin

from sim.autopilot import cli
from sim.autopilot.control import state_of
from sim.autopilot.ground import Relief, read_ground
from sim.autopilot.settings import Settings
from tests.conformance.wire import mav
from tests.sim.autopilot.hovering import Flight, flavor

__all__ = ["flavor"]

HOME = (47.0512, 8.3093, 489.0)


def slope(per_m: float) -> Relief:
    """Ground that rises to the north."""
    north = np.linspace(400.0, -400.0, 81)
    return Relief(np.repeat((700.0 + per_m * north)[:, None], 81, axis=1), 10.0)


def over(flavor: str, ground: Relief) -> Flight:
    """A mock that hovers 20 m over home."""
    return Flight(flavor, settings=Settings(flavor=flavor, seed=3, ground=ground, rangefinder=True))


def raster(path: Path, heights: np.ndarray, **options: object) -> Path:
    """A GeoTIFF around home."""
    profile = {"driver": "GTiff", "height": heights.shape[0], "width": heights.shape[1], "count": 1,
               "dtype": "float32", "crs": "EPSG:4326",
               "transform": from_origin(HOME[1] - 0.02, HOME[0] + 0.02, 0.0002, 0.0002), **options}  # fmt: skip
    with rasterio.open(path, "w", **profile) as file:
        file.write(heights.astype(np.float32), 1)
    return path


def test_heights_count_from_the_ground_at_home() -> None:
    ground = slope(0.2)
    assert ground.height(0.0, 0.0) == 0.0
    assert ground.height(105.0, 33.0) == pytest.approx(21.0)
    assert ground.height(5000.0, 0.0) == pytest.approx(80.0)  # as at its edge
    other = ground.from_home(50.0, 0.0)
    assert other.height(0.0, 0.0) == 0.0
    assert other.height(20.0, 0.0) == pytest.approx(ground.height(70.0, 0.0) - ground.height(50.0, 0.0))


def test_a_raster_is_read_in_metres_around_home(tmp_path: Path) -> None:
    rows = 700.0 + np.arange(200, 0, -1)[:, None] * np.ones((1, 200))  # a metre a row, higher to the north
    ground = read_ground(raster(tmp_path / "hill.tif", rows), HOME)
    metres = 0.0002 * 111_195.0
    assert ground.height(10 * metres, 0.0) == pytest.approx(10.0, abs=0.3)
    assert ground.height(0.0, 500.0) == pytest.approx(0.0, abs=0.3)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"crs": None}, "does not say where on the globe it lies"),
        ({"transform": from_origin(10.0, 50.0, 0.0002, 0.0002)}, "is not on the ground of"),
        ({"nodata": 700.0}, "has no height at home"),
    ],
)
def test_a_raster_that_is_no_ground_for_it_is_refused(tmp_path: Path, options: dict, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        read_ground(raster(tmp_path / "bad.tif", np.full((200, 200), 700.0), **options), HOME)


def test_a_file_that_is_no_raster_is_one_sentence(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "ground.tif"
    path.write_text("hills")
    assert cli.main(["--ground", str(path)]) == 2
    assert "cannot read the ground in" in capsys.readouterr().err


def test_it_measures_the_ground_below_and_meets_it(flavor: str) -> None:
    flight = over(flavor, slope(0.2))
    flight.long(mav.MAV_CMD_SET_MESSAGE_INTERVAL, mav.MAVLINK_MSG_ID_DISTANCE_SENSOR, 1e5)
    flight.go(50, 0)
    flight.listen(1.0)
    assert flight.latest["DISTANCE_SENSOR"].current_distance == pytest.approx(1000, abs=150)
    assert not flight.autopilot.vehicle.crashed
    flight.go(200, 0, wait=0)
    flight.listen(30.0)
    assert flight.autopilot.vehicle.crashed
    assert not flight.armed
    state = state_of(flight.autopilot)
    assert state["crashed"]
    assert state["above_ground"] == pytest.approx(0.0, abs=0.1)
    assert 80.0 < state["north"] < 130.0
    assert flight.said("Crash: Disarming")


def test_it_lands_on_a_slope_without_a_crash(flavor: str) -> None:
    flight = over(flavor, slope(0.2))
    flight.go(50, 0)
    flight.long(mav.MAV_CMD_NAV_LAND)
    assert flight.wait(lambda: not flight.armed, 60.0)
    assert not flight.autopilot.vehicle.crashed
    assert flight.autopilot.vehicle.body.up == pytest.approx(10.0, abs=1.5)


def test_on_flat_ground_it_neither_crashes_nor_measures(flavor: str) -> None:
    flight = Flight(flavor)
    flight.long(mav.MAV_CMD_SET_MESSAGE_INTERVAL, mav.MAVLINK_MSG_ID_DISTANCE_SENSOR, 1e5)
    flight.long(mav.MAV_CMD_NAV_LAND)
    assert flight.wait(lambda: not flight.armed, 60.0)
    assert not flight.autopilot.vehicle.crashed
    assert "DISTANCE_SENSOR" not in flight.latest
    assert math.isclose(flight.autopilot.vehicle.body.up, 0.0)


def test_on_the_ground_it_gets_a_full_battery_and_starts_again(flavor: str) -> None:
    flight = Flight(flavor, settings=Settings(flavor=flavor, seed=3, swap_battery_s=20.0))
    flight.fault("battery", percent=30.0)
    flight.listen(30.0)
    assert flight.autopilot.vehicle.battery.percent < 31  # not in the air
    flight.long(mav.MAV_CMD_NAV_LAND)
    flight.wait(lambda: not flight.armed, 60.0)
    flight.listen(15.0)
    assert flight.autopilot.vehicle.battery.percent < 31
    flight.wait(lambda: flight.autopilot.vehicle.battery.percent > 99, 20.0)
    assert flight.autopilot.vehicle.battery.percent == 100
    assert flight.autopilot.vehicle.time < 5.0
    flight.listen(10.0)
    assert flight.autopilot.vehicle.time > 5.0  # once is enough
