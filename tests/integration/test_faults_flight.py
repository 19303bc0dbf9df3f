"""Energy, wind and the detector: what the service itself must notice."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.integration.scene import flight

pytestmark = pytest.mark.timeout(300)


def test_a_low_battery_flies_home_and_says_so(tmp_path: Path) -> None:
    with flight(tmp_path) as scene:
        scene.searching()
        scene.control.fault("battery", percent=18.0)
        scene.reaches("RETURNING", "battery at 18 %")
        code, report = scene.ends()
    assert code == 3
    assert "battery" in report["stopped_because"]


@pytest.mark.parametrize("flavor", ["px4", "ardupilot"])
def test_a_critical_battery_that_the_autopilot_flies_home_with_is_not_steered_against(
    flavor: str, tmp_path: Path
) -> None:
    with flight(tmp_path, flavor) as scene:
        scene.searching()
        scene.control.fault("battery_critical")
        deadline = time.monotonic() + 60.0
        while "RTL" not in scene.control.state()["mode"]:
            assert time.monotonic() < deadline, scene.service.said
            time.sleep(0.02)
        time.sleep(0.5)  # what was on its way
        before = len(scene.tap.motions)
        code, report = scene.ends()
        assert "MAV_CMD_DO_REPOSITION" not in [name for _, name in scene.tap.motions[before:]]
        assert not scene.control.state()["armed"]
    assert code in (3, 4)  # its own return, for the battery that it read, or the autopilot's
    assert "attery" in report["stopped_because"]


def test_it_flies_home_while_the_battery_has_what_that_needs(tmp_path: Path) -> None:
    with flight(tmp_path, options=("--endurance", "5")) as scene:
        scene.searching()
        row = scene.reaches("RETURNING", "the way home")
        assert "needs" in row.body["reason"]
        assert 5.0 < scene.door.get("/api/state").json()["battery"]["voltage_v"] < 30.0
        assert scene.control.state()["battery_percent"] > 25  # well before the fixed minimum
        code, report = scene.ends()
        assert code == 3
        assert report["stopped_because"] == row.body["reason"]
        assert 10 <= scene.control.state()["battery_percent"] <= 40  # the reserve, and no more than it


def test_an_aircraft_that_is_blown_out_of_the_area_flies_home(tmp_path: Path) -> None:
    with flight(tmp_path, "ardupilot") as scene:
        scene.searching()
        scene.control.fault(
            "wind", east=-35.0, seconds=20.0
        )  # across the area sooner than it counts as stuck
        scene.reaches("RETURNING", "outside the area and its margin")


def test_a_wind_that_it_cannot_fly_against_is_noticed(tmp_path: Path) -> None:
    with flight(tmp_path, "ardupilot", margin_m=5000.0) as scene:
        scene.searching()
        scene.control.fault("wind", east=-20.0)
        scene.reaches("HOLDING", "no progress towards the waypoint")


def test_a_wind_that_the_autopilot_tells_flies_home(tmp_path: Path) -> None:
    with flight(tmp_path) as scene:
        scene.searching()
        scene.tap.say(mavlink.MAVLink_wind_cov_message(0, 10.0, 10.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
        scene.reaches("RETURNING", "wind of 14 m/s")
        code, report = scene.ends()
    assert code == 4
    assert "wind of 14 m/s" in report["stopped_because"]


def test_a_silent_detector_clears_no_ground_and_the_search_comes_back_by_itself(tmp_path: Path) -> None:
    with flight(tmp_path) as scene:
        scene.searching()
        os.kill(scene.detector.process.pid, signal.SIGSTOP)
        scene.reaches("HOLDING", "the detector is silent")
        before = scene.map()
        scene.fly(30.0)
        assert scene.map()["digest"] == before["digest"]
        assert scene.state() == "HOLDING"
        os.kill(scene.detector.process.pid, signal.SIGCONT)
        scene.reaches("SEARCHING", "the detector reports again")
        scene.moves_again()
