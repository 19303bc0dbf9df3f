"""Detectors that lie beside a real service: about where they look, and about when."""

from __future__ import annotations

import itertools
import time
from pathlib import Path
from typing import Any

import pytest

from service.journal import read_rows
from sim.soak.clocked import CLOCK_FILE, SteppedClock
from tests.integration.scene import Scene, flight


def report(scene: Scene, number: int, **more: Any) -> dict[str, Any]:
    """Send a report; its receipt."""
    answer = scene.door.post("/api/reports", json={"id": f"r{number}", "source": "lying", **more})
    receipt: dict[str, Any] = answer.raise_for_status().json()[0]
    return receipt


def test_a_detector_that_places_everything_at_0_0_clears_no_ground_and_stops_the_search(
    tmp_path: Path,
) -> None:
    with flight(tmp_path, speedup=2.0) as scene:  # on a busy machine, three reports come before it is silent
        scene.searching()
        scene.detector.stop()
        before = scene.map()["digest"]
        seen = {"detections": [{"class": "person", "score": 0.95, "lat": 0.0, "lon": 0.0}]}
        for number in itertools.count():
            state = scene.door.get("/api/state").json()
            if state["state"] not in ("SEARCHING", "CONFIRMING"):
                break
            receipt = report(scene, number, captured_at=state["pose"]["time"], clock="service", **seen)
            assert (receipt["status"], receipt["looks"]) == ("refused", 0)
            time.sleep(0.1)
        scene.reaches("HOLDING", "reports are refused: lying: a detection at 0.000000, 0.000000")
        assert "0/0 is what a camera without a position tells" in state["reports"]["last_refusal"]
        assert scene.map()["digest"] == before


def test_a_clock_that_steps_in_flight_moves_no_frame(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    clock, off, steps_s = SteppedClock(tmp_path / "clock"), 0.0, {20: -45.0, 40: 400 * 86_400.0}
    monkeypatch.setenv(CLOCK_FILE, str(clock.path))
    with flight(tmp_path, speedup=1.0, module="sim.soak.clocked") as scene:
        scene.searching()
        scene.detector.stop()
        for number in range(60):
            if number in steps_s:
                clock.step(steps_s[number])
                off += steps_s[number]
            receipt = report(scene, number, captured_at=time.time() + off - 0.1)
            assert receipt["status"] == "accepted", receipt
            time.sleep(0.25)
        rows = [row for row in read_rows(scene.journal, "report") if row.body["report"]["source"] == "lying"]
        assert len(rows) == 60
        assert all(0.0 <= row.time - row.body["captured"] < 3.0 for row in rows)
        steps = [row.body["step_s"] for row in read_rows(scene.journal, "clock")]
        assert steps == pytest.approx([0.0, *steps_s.values()], abs=1.0)
