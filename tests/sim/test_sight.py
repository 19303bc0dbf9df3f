"""What the ground hides: a straight line over a ridge, whatever the service takes for visible."""

from __future__ import annotations

from pathlib import Path

import pytest

from sim.autopilot.geo import LocalFrame
from sim.detector import Detector, main
from sim.grounds import GROUNDS, latlon, write_heights
from sim.sight import Point, Sight
from tests.sim.test_detector import state

HOME = (47.05, 8.3)


class Ridge:
    """30 m high, from 100 to 120 m east of home."""

    def height(self, north: float, east: float) -> float:
        return 30.0 if 100.0 <= east <= 120.0 else 0.0

    def from_home(self, north: float, east: float) -> Ridge:
        raise NotImplementedError


def at(north: float, east: float) -> Point:
    e7 = LocalFrame(*HOME).to_e7(north, east)
    return e7[0] * 1e-7, e7[1] * 1e-7


def pose(east: float, height_m: float) -> dict[str, float]:
    lat, lon = at(0.0, east)
    return {"lat": lat, "lon": lon, "height_m": height_m}


@pytest.mark.parametrize(
    ("east", "height_m", "seen"),
    [(0.0, 40.0, False), (0.0, 250.0, True), (110.0, 60.0, True), (160.0, 10.0, True)],
)
def test_a_ridge_hides_what_lies_behind_it_from_who_flies_low(
    east: float, height_m: float, seen: bool
) -> None:
    assert Sight(Ridge(), HOME).reaches(pose(east, height_m), at(0.0, 140.0)) is seen


def test_a_target_behind_the_ridge_is_not_reported_though_the_service_counts_its_cell() -> None:
    told = state(0)
    target = (0.4, 0.4)
    told["pose"] |= {"lat": 0.4, "lon": 0.4, "height_m": 40.0}

    class Wall(Sight):
        def __init__(self, seen: bool) -> None:
            self.seen = seen

        def reaches(self, pose: dict[str, float], place: Point) -> bool:
            assert place == target
            return self.seen

    for seen in (True, False):
        detector = Detector(target, 1.0, 1.0, 1, sight=Wall(seen))
        assert bool(detector.frame(told)["detections"]) is seen


def test_heights_count_from_home(tmp_path: Path) -> None:
    ridge, dem = GROUNDS["ridge"], tmp_path / "dem.tif"
    write_heights(ridge, dem)
    home = latlon(*ridge.launch)
    sight = Sight.over(dem, home)
    behind, (lat, lon) = latlon(560.0, 200.0), latlon(250.0, 200.0)
    assert not sight.reaches({"lat": lat, "lon": lon, "height_m": 60.0}, behind)
    assert sight.reaches({"lat": lat, "lon": lon, "height_m": 500.0}, behind)


def test_a_ground_without_a_home_is_one_sentence(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    assert main(["--service", "http://127.0.0.1:9", "--ground", str(tmp_path / "dem.tif")]) == 2
    assert "--ground needs --home LAT,LON" in capsys.readouterr().err
