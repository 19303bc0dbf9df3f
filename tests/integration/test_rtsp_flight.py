"""A whole search with eyes: a camera under the mock aircraft, over RTSP into the ONNX adapter, and to the public door.

The ground is an orthophoto with a red tarpaulin on it. Each picture is that photo as the camera sees it from where the
aircraft truly is, drawn by OpenCV: nothing here knows how the service projects, and nobody tells where the target is.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import cv2
import httpx
import numpy as np
from numpy.typing import NDArray
from pyproj import Geod

from service.journal import read_rows
from sim.autopilot.control import Control
from sim.autopilot.process import AutopilotProcess
from tests.integration.flight import FIELD, only_report, running, service_words, write_area
from tests.service.adapters.stage import write_model
from tests.service.adapters.streams import rtsp

SPEEDUP = 6.0
HOME = (47.0507, 8.3011)
TARGET = (47.0508, 8.3017)
SIZE_PX, FOV_DEG, TARPAULIN_M = 256, 60.0, 6.0
FOCAL_PX = 0.5 * SIZE_PX / math.tan(math.radians(0.5 * FOV_DEG))
SETTINGS = f"""
[flight]
altitude_m = 20
[sensor]
profile = "camera"
classes = ["person"]
horizontal_fov_deg = {FOV_DEG}
vertical_fov_deg = {FOV_DEG}
image_width_px = {SIZE_PX}
image_height_px = {SIZE_PX}
target_size_m = {TARPAULIN_M}
p_tn = 0.99
cell_m = 15
hover_look_s = 2
"""
PIXEL_M, REACH_M = 0.5, 400.0
"""Of the orthophoto, which reaches so far from home in each direction."""


def metres(place: tuple[float, float]) -> tuple[float, float]:
    """East and north of home."""
    bearing, _, far = Geod(ellps="WGS84").inv(HOME[1], HOME[0], place[1], place[0])
    return far * math.sin(math.radians(bearing)), far * math.cos(math.radians(bearing))


def orthophoto() -> NDArray[np.uint8]:
    """Grass, as one pixel for each so many metres, north up, with the tarpaulin on it; blue first."""
    side = round(2.0 * REACH_M / PIXEL_M)
    grass = np.random.default_rng(1).integers(80, 140, (side, side, 1), dtype=np.uint8)
    photo = np.concatenate([grass // 3, grass, grass // 3], axis=2)
    east, north = metres(TARGET)
    col, row = (REACH_M + east) / PIXEL_M, (REACH_M - north) / PIXEL_M
    half = 0.5 * TARPAULIN_M / PIXEL_M
    photo[round(row - half) : round(row + half), round(col - half) : round(col + half)] = (0, 0, 255)
    return photo


class Camera:
    """It hangs below the aircraft on a gimbal and looks straight down, the top of its image to the nose."""

    def __init__(self, control: Control) -> None:
        self._control, self._photo = control, orthophoto()

    def picture(self) -> NDArray[np.uint8]:
        """What it sees now."""
        pose = self._control.state()
        middle = np.array([REACH_M + pose["east"], REACH_M - pose["north"]]) / PIXEL_M  # below the aircraft
        scale = FOCAL_PX * PIXEL_M / max(pose["above_ground"], 1.0)
        turn = cv2.getRotationMatrix2D(tuple(middle), pose["heading"], scale)
        turn[:, 2] += 0.5 * SIZE_PX - middle
        return np.asarray(cv2.warpAffine(self._photo, turn, (SIZE_PX, SIZE_PX)), dtype=np.uint8)


def flown(folder: Path) -> dict[str, Any]:
    """The report of a search from take-off to the find."""
    (folder / "settings.toml").write_text(SETTINGS, encoding="utf-8")
    mock = AutopilotProcess(
        "px4", speedup=SPEEDUP, options=(f"--home={HOME[0]},{HOME[1]},400", "--control", "127.0.0.1:0")
    )
    with mock, Control(mock.control or "") as control, rtsp(Camera(control).picture) as video:
        link = ("--connect", mock.url.replace("udpin", "udpout"), "--takeoff", "--speedup", str(SPEEDUP))
        area = write_area(
            folder, {**FIELD, "features": FIELD["features"][:2]}
        )  # it takes off from where it stands
        words = service_words(
            area, folder / "runs", *link, "--flat", "--config", str(folder / "settings.toml")
        )
        with running(*words) as service:
            door = service.wait_for(r"listening on (http://\S+)").group(1)
            eyes = ["--model", str(write_model(folder / "red.onnx")), "--video", video, "--clock", "service"]
            more = ["--threshold", "0.5", "--rate", "10", "--latency", "0.1"]
            with running("service", "detector", "onnx", "--service", door, *eyes, *more) as adapter:
                try:
                    service.wait_for("→ RETURNING: found")  # how it flies home is for other tests
                    httpx.post(f"{door}/api/commands", json={"command": "abort"})
                    assert service.exit_code() == 0, service.said
                finally:
                    print("the adapter:", adapter.process.poll(), adapter.said)
    return only_report(folder / "runs")


def test_the_onnx_adapter_finds_over_rtsp_what_lies_below_the_aircraft(tmp_path: Path) -> None:
    report = flown(tmp_path)
    assert report["outcome"] == "found"
    found = (report["position"]["lat"], report["position"]["lon"])
    assert math.dist(metres(found), metres(TARGET)) < report["cell_m"]
    (journal,) = (tmp_path / "runs").glob("*/journal.sqlite")
    told = [row.body["report"] for row in read_rows(journal, "report")]
    assert any(not each["detections"] for each in told), "and it says where there is nothing"
    assert {hit["class"] for each in told for hit in each["detections"]} == {"person"}
