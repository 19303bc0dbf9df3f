"""Searches with a camera that looks ahead: found by the pixels' geometry, and an operator's word on it."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import httpx
import pytest

from service.journal import read_rows
from tests.integration.flight import REPOSITORY, only_report, running, service_words, write_area

pytestmark = pytest.mark.timeout(600)
CAMERA = REPOSITORY / "config" / "camera.toml"


def wait_for(door: httpx.Client, condition: Callable[[dict[str, Any]], bool], said: str) -> dict[str, Any]:
    """The first state of the service that fulfils a condition."""
    deadline = time.monotonic() + 200.0
    while not condition(state := door.get("/api/state").json()):
        assert time.monotonic() < deadline, (said, state)
        time.sleep(0.05)
    return state


def test_a_camera_finds_the_target_and_flies_home(tmp_path: Path) -> None:
    words = service_words(write_area(tmp_path), tmp_path / "runs", "--config", str(CAMERA))
    with running(*words, "--flavor", "ardupilot", "--seed", "3") as service:
        assert service.exit_code() == 0, service.said
    report = only_report(tmp_path / "runs")
    assert report["outcome"] == "found"
    assert report["simulated"]["error_cells"] <= 1.5
    ellipse = report["ellipse"]
    assert 0.0 < ellipse["semi_minor_m"] <= ellipse["semi_major_m"] < 1.5 * report["cell_m"]
    assert 0.0 <= ellipse["bearing_deg"] < 180.0


def test_an_operator_rejects_what_was_found_and_confirms_it_when_it_is_found_again(tmp_path: Path) -> None:
    file = tmp_path / "hover.toml"
    text = CAMERA.read_text(encoding="utf-8").replace("[sensor]", "[sensor]\nhover_look_s = 5.0")
    file.write_text(text + '\n[search]\non_found = "hover"\n', encoding="utf-8")
    words = service_words(write_area(tmp_path), tmp_path / "runs", "--config", str(file))
    with running(*words, "--flavor", "px4", "--seed", "3") as service:
        door = httpx.Client(base_url=service.wait_for(r"listening on (http://\S+)").group(1), timeout=30.0)
        found = wait_for(door, lambda state: state["state"] == "FOUND", service.said)
        assert found["found"]["probability"] >= 0.999
        assert set(found["found"]["ellipse"]) == {"semi_major_m", "semi_minor_m", "bearing_deg"}
        best = found["suspects"][0]
        assert best["hits"] >= 1
        assert (best["lat"], best["lon"]) == pytest.approx(
            (found["found"]["lat"], found["found"]["lon"]), abs=1e-3
        )
        before = door.get("/api/map").json()["digest"]
        answer = door.post("/api/commands", json={"command": "reject"}).json()
        assert answer == {"state": "SEARCHING"}
        assert door.get("/api/map").json()["digest"] != before
        wait_for(door, lambda state: state["state"] == "FOUND", service.said)
        wrong = {"command": "hold", "lat": 47.0, "lon": 8.0}
        assert door.post("/api/commands", json=wrong).status_code == 422
        assert door.post("/api/commands", json={"command": "confirm"}).status_code == 200
        assert service.exit_code() == 0, service.said
    (folder,) = (tmp_path / "runs").iterdir()
    states = [row.body["to"] for row in read_rows(folder / "journal.sqlite", "transition")]
    again = states.index("FOUND") + 1
    assert states[again] == "SEARCHING"
    assert states[-3:] == ["FOUND", "RETURNING", "DONE"]
    assert [row.body["confirmed"] for row in read_rows(folder / "journal.sqlite", "verdict")] == [False, True]
    assert only_report(tmp_path / "runs")["simulated"]["error_cells"] <= 1.5
