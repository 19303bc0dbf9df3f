"""The simulated detector: one verdict per cell and pass, with the rates it was told."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import httpx
import pytest

from sim.detector import Detector, contains, follow, main, of_aircraft

SQUARE = [[1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.0, 0.0]]


def state(row: int, counts: bool = True, p_tp: float = 0.9) -> dict[str, Any]:
    corners = [[lat - row, lon] for lat, lon in SQUARE]
    worth = {"counts": counts, "covered": 1.0, "p_tp": p_tp, "p_tn": 0.9}
    cell = {"row": row, "col": 0, "lat": 0.5 - row, "lon": 0.5, "corners": corners, **worth}
    nominal = {"counts": counts, "covered": 1.0, "p_tp": 0.9, "p_tn": 0.9}
    return {"pose": {"time": float(row)}, "footprint": {**nominal, "cells": [cell]}}


def rate(target: tuple[float, float] | None, p_tp: float, p_tn: float) -> float:
    """Share of 2000 passes over cell 0 with a detection."""
    detector = Detector(target, p_tp, p_tn, seed=3)
    reported = 0
    for _ in range(2000):
        reported += bool(detector.frame(state(0))["detections"])
        detector.frame(state(1))
    return reported / 2000


def test_it_reports_the_target_as_often_as_it_was_told() -> None:
    assert rate((0.4, 0.4), 0.7, 0.95) == pytest.approx(0.7, abs=0.04)


def test_it_raises_false_alarms_as_often_as_it_was_told() -> None:
    assert rate((-40.0, 0.4), 0.7, 0.95) == pytest.approx(0.05, abs=0.02)
    assert rate(None, 0.7, 0.8) == pytest.approx(0.2, abs=0.04)


def test_a_target_that_walks_is_reported_where_it_is_by_then() -> None:
    detector = Detector(lambda seconds: (0.4 - seconds, 0.4), 1.0, 1.0, seed=3)
    before, first, gone = state(0, counts=False), state(0), state(0)
    before["pose"]["time"], first["pose"]["time"], gone["pose"]["time"] = 50.0, 100.0, 101.0
    assert not detector.frame(before)["detections"]  # its walk begins at the first look
    assert detector.frame(first)["detections"][0]["lat"] == 0.4
    there = state(1)
    there["pose"]["time"] = 101.0
    assert detector.frame(there)["detections"][0]["lat"] == pytest.approx(-0.6)
    assert not detector.frame(gone)["detections"]


@pytest.mark.parametrize("text", ["[[0, 47.0]]", "[[5, 47, 8], [1, 47, 8]]", "nothing", "[[0, NaN, 8]]"])
def test_a_walk_that_is_none_is_refused(
    text: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "walk.json"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(SystemExit):
        main(["--service", "http://127.0.0.1:9", "--walk", str(file)])
    assert str(file) in capsys.readouterr().err


def test_an_attached_detector_is_gone_when_whoever_started_it_is_killed(tmp_path: Path) -> None:
    words = [sys.executable, "-m", "sim", "detector", "--service", "http://127.0.0.1:9", "--patience", "600"]
    code = f"""
import subprocess, time
child = subprocess.Popen({[*words, "--attached"]!r}, stdin=subprocess.PIPE, start_new_session=True)
print(child.pid, flush=True)
time.sleep(600)
"""
    parent = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    assert parent.stdout is not None
    child = int(parent.stdout.readline())
    os.kill(child, 0)
    parent.kill()
    parent.wait()
    deadline = time.monotonic() + 60.0
    while _runs(child):
        assert time.monotonic() < deadline, "the detector has outlived who started it"
        time.sleep(0.05)


def _runs(process: int) -> bool:
    try:
        stat = Path(f"/proc/{process}/stat").read_text(encoding="ascii")
    except OSError:
        return False
    return stat.rpartition(")")[2].split()[0] != "Z"


def test_frames_of_one_pass_repeat_its_verdict() -> None:
    detector = Detector((0.4, 0.4), 0.5, 0.5, seed=1)
    for _ in range(50):
        verdicts = {bool(detector.frame(state(0))["detections"]) for _ in range(10)}
        assert len(verdicts) == 1
        detector.frame(state(1))


def test_a_better_view_in_the_same_pass_finds_as_many_as_it_would_alone() -> None:
    detector = Detector((0.4, 0.4), 0.9, 0.9, seed=2)
    poor = better = 0
    for _ in range(2000):
        poor += bool(detector.frame(state(0, p_tp=0.45))["detections"])
        better += bool(detector.frame(state(0))["detections"])
        # what it remembers of the pass is compared with what it says: it is not to say less than it knows
        assert bool(detector.frame(state(0, p_tp=0.45))["detections"]) == bool(detector._hits)
        detector.frame(state(1))
    assert poor / 2000 == pytest.approx(0.45, abs=0.04)
    assert better / 2000 == pytest.approx(0.9, abs=0.03)


def test_a_cell_that_stays_in_view_is_looked_at_anew_after_the_time_that_was_set() -> None:
    detector = Detector((0.4, 0.4), 0.5, 0.5, seed=1, again_s=10.0)
    verdicts = []
    for second in range(400):
        seen = {**state(0), "pose": {"time": float(second)}}
        verdicts.append(bool(detector.frame(seen)["detections"]))
    assert all(len(set(verdicts[i : i + 10])) == 1 for i in range(0, 400, 10))
    assert 10 <= sum(verdicts[::10]) <= 30


def test_a_frame_between_cells_reports_that_nothing_was_seen() -> None:
    detector = Detector((0.4, 0.4), 1.0, 0.5, seed=1)
    assert detector.frame(state(0, counts=False))["detections"] == []


def test_of_several_aircraft_it_follows_its_own_and_nobody_before_that_is_there() -> None:
    mine = {"name": "south", "pose": {"time": 7.0}, "footprint": {"cells": []}}
    whole = {**state(0), "aircraft": [{"name": "north", **state(1)}, mine]}
    assert of_aircraft(whole, "south")["pose"] == {"time": 7.0}
    assert of_aircraft(whole, "")["pose"] == {"time": 0.0}
    assert of_aircraft({**whole, "aircraft": []}, "south")["pose"] is None


def test_ids_are_never_repeated() -> None:
    detector = Detector(None, 0.9, 0.9, seed=1)
    assert len({detector.frame(state(0))["id"] for _ in range(20)}) == 20


def test_a_detection_is_where_the_target_is_and_a_false_alarm_in_its_cell() -> None:
    detector = Detector((0.4, 0.3), 1.0, 0.5, seed=1)
    report = detector.frame(state(0))
    assert (report["detections"][0]["lat"], report["detections"][0]["lon"]) == (0.4, 0.3)
    assert contains(SQUARE, (0.4, 0.3))
    assert not contains(SQUARE, (1.4, 0.3))
    assert contains(SQUARE[::-1], (0.4, 0.3))


@pytest.mark.parametrize("text", ["here", "95,8", "47.1"])
def test_a_wrong_target_is_refused_in_words(text: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["--service", "http://127.0.0.1:1", "--target", text])
    assert text in capsys.readouterr().err


class FlakyService:
    """A service whose first answers to reports are faults, though it has the reports."""

    def __init__(self, faults: int) -> None:
        self.faults, self.reports, self.time = faults, [], 0.0  # type: ignore[var-annotated]

    def __call__(self, request: httpx.Request) -> httpx.Response:
        if request.method == "GET":
            self.time += 1.0
            over = len(self.reports) >= self.faults + 3
            footprint = state(0)["footprint"]
            pose = {"time": self.time}
            running = {"state": "DONE" if over else "SEARCHING", "speedup": 100.0}
            return httpx.Response(200, json={**running, "pose": pose, "footprint": footprint})
        self.reports.append(json.loads(request.content))
        if len(self.reports) <= self.faults:
            if self.faults % 2:
                raise httpx.ReadError("the connection has ended")
            return httpx.Response(503)
        return httpx.Response(200, json=[])


@pytest.mark.parametrize("faults", [1, 2])
def test_a_report_without_an_answer_is_sent_again_as_it_was(faults: int) -> None:
    service = FlakyService(faults)
    with httpx.Client(transport=httpx.MockTransport(service), base_url="http://service") as client:
        assert follow(client, Detector(None, 0.9, 0.9, seed=1), rate_hz=10.0, patience_s=30.0) == 0
    again, others = service.reports[: faults + 1], service.reports[faults:]
    assert all(report == again[0] for report in again)
    assert len({report["id"] for report in others}) == len(others)


@pytest.mark.parametrize("module", ["sim.detector", "sim.autopilot.cli"])
def test_what_starts_beside_every_flight_imports_no_compiler(module: str) -> None:
    program = f"import sys, {module}; print(*sorted(sys.modules))"
    said = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout
    assert {name.split(".")[0] for name in said.split()} & {
        "numba",
        "llvmlite",
        "skimage",
        "roisearch",
    } == set()
