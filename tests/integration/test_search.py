"""Whole searches: the service as a process, the mock autopilot and the detector behind real sockets."""

from __future__ import annotations

import itertools
import json
import os
import signal
import sqlite3
import subprocess
import time
from pathlib import Path

import httpx
import pytest
from pydantic import TypeAdapter

from service.journal import read_rows
from service.view.state import RunState
from tests.integration.flight import FIELD, only_report, running, service_words, write_area

pytestmark = pytest.mark.timeout(600)
FLAVORS = ("px4", "ardupilot")


@pytest.mark.parametrize("flavor", FLAVORS)
def test_the_embedded_search_ends_found_where_the_target_is(flavor: str, tmp_path: Path) -> None:
    words = service_words(write_area(tmp_path), tmp_path / "runs", "--flavor", flavor, "--seed", "3")
    with running(*words) as service:
        assert service.exit_code() == 0, service.said
    assert "nothing real moves" in service.said
    assert "puct-regions-lite plans in seconds of flight, to eight neighbours" in service.said
    report = only_report(tmp_path / "runs")
    assert report["outcome"] == "found"
    assert report["probability"] >= 0.999
    assert report["simulated"]["error_cells"] <= 1.5
    assert set(report) >= {"position", "steps", "flight_time_s", "pos", "area", "planner", "seed"}
    (folder,) = (tmp_path / "runs").iterdir()
    assert (folder / "map.png").read_bytes().startswith(b"\x89PNG")
    track = json.loads((folder / "track.geojson").read_text())
    assert {"track", "found"} <= {feature["properties"]["role"] for feature in track["features"]}
    states = [row.body["to"] for row in read_rows(folder / "journal.sqlite", "transition")]
    assert states[:3] == ["READY", "TAKEOFF", "SEARCHING"]
    assert states[-3:] == ["FOUND", "RETURNING", "DONE"]
    paths = [row.body["path"] for row in read_rows(folder / "journal.sqlite", "decision")]
    moves = {(b[0] - a[0], b[1] - a[1]) for path in paths for a, b in itertools.pairwise(path)}
    assert any(abs(down) == abs(right) == 1 for down, right in moves)  # it plans to eight neighbours
    assert all(max(abs(down), abs(right)) == 1 for down, right in moves)


def test_a_search_on_a_given_link_without_a_target_ends_not_found(tmp_path: Path) -> None:
    area = {**FIELD, "features": [dict(feature) for feature in FIELD["features"]]}
    area["features"][0] = {**area["features"][0], "properties": {"name": "field", "outside": 0.4}}
    settings = tmp_path / "settings.toml"
    settings.write_text("[search]\nstop_at_pos = 0.7\n[sensor]\np_tn = 0.99\n")
    mock = ["sim", "autopilot", "--flavor", "ardupilot", "--listen", "udpin://127.0.0.1:0"]
    with running(*mock, "--home=47.0501,8.3001,400", "--speedup", "40") as autopilot:
        url = autopilot.wait_for(r"listening on (udpin://\S+)").group(1).replace("udpin", "udpout")
        words = service_words(write_area(tmp_path, area), tmp_path / "runs", "--connect", url)
        with running(*words, "--takeoff", "--config", str(settings)) as service:
            door = service.wait_for(r"listening on (http://\S+)").group(1)
            with running("sim", "detector", "--service", door, "--p-tn", "0.99"):
                assert service.exit_code() == 3, service.said
    report = only_report(tmp_path / "runs")
    assert report["outcome"] == "not_found"
    assert report["position"] is None
    assert report["pos"] >= 0.7 * 0.6
    assert report["outside"] > 0.55
    assert "simulated" not in report


def test_nothing_is_armed_on_a_given_link_without_takeoff(tmp_path: Path) -> None:
    mock = ["sim", "autopilot", "--flavor", "px4", "--listen", "udpin://127.0.0.1:0"]
    with running(*mock, "--home=47.0501,8.3001,400", "--speedup", "40") as autopilot:
        url = autopilot.wait_for(r"listening on (udpin://\S+)").group(1).replace("udpin", "udpout")
        words = service_words(write_area(tmp_path), tmp_path / "runs", "--connect", url)
        with running(*words) as service:
            door = service.wait_for(r"listening on (http://\S+)").group(1)
            service.wait_for("take off and select Hold")
            with pytest.raises(AssertionError):
                service.wait_for("TAKEOFF|SEARCHING", patience_s=3.0)
            assert httpx.post(f"{door}/api/commands", json={"command": "abort"}).json() == {
                "state": "ABORTED"
            }
            assert service.exit_code() == 4
    assert only_report(tmp_path / "runs")["outcome"] == "aborted"


def test_the_door_answers_bad_reports_in_words_and_counts_none_of_them_twice(tmp_path: Path) -> None:
    words = service_words(write_area(tmp_path), tmp_path / "runs", "--speedup", "10")
    with running(*words) as service:
        door = httpx.Client(base_url=service.wait_for(r"listening on (http://\S+)").group(1), timeout=30.0)
        assert door.get("/healthz").text == "ok\n"
        service.wait_for("SEARCHING")
        state = TypeAdapter(RunState).validate_json(door.get("/api/state").content)
        assert state["pose"] is not None
        report = {"id": "mine", "captured_at": state["pose"]["time"]}
        assert door.post("/api/reports", json=report).json()[0]["status"] == "accepted"
        again = [{**report, "captured_at": state["pose"]["time"] - 1}, report]
        assert [answer["status"] for answer in door.post("/api/reports", json=again).json()] == [
            "duplicate"
        ] * 2
        old = door.post("/api/reports", json={"id": "old", "captured_at": 12.0}).json()[0]
        assert old["status"] == "refused"
        assert "no position" in old["reason"]
        for wrong in (
            {"id": "x"},
            {**report, "detections": [{"lat": 91, "lon": 0}]},
            {**report, "colour": 1},
            [],
            "x",
        ):
            answer = door.post("/api/reports", json=wrong)
            assert answer.status_code == (200 if wrong == [] else 422)
        assert door.post("/api/commands", json={"command": "explode"}).status_code == 422
        assert "roisearch_pos" in door.get("/metrics").text
        assert door.get("/api/map.png").content.startswith(b"\x89PNG")
        grid = door.get("/api/map").json()
        total = sum(p for row in grid["probability"] for p in row if p is not None)
        assert total + grid["outside"] == pytest.approx(1.0)
        assert door.post("/api/commands", json={"command": "hold"}).json() == {"state": "HOLDING"}
        assert door.post("/api/commands", json={"command": "resume"}).json() == {"state": "SEARCHING"}
        assert door.post("/api/commands", json={"command": "return"}).json() == {"state": "RETURNING"}
        assert door.post("/api/commands", json={"command": "finish"}).json() == {"state": "RETURNING"}
        assert service.exit_code() == 3


def test_bad_input_is_one_line_exit_code_2_and_nothing_started(tmp_path: Path) -> None:
    (tmp_path / "area.geojson").write_text("{ this is not JSON")
    words = service_words(tmp_path / "area.geojson", tmp_path / "runs")
    with running(*words) as service:
        assert service.exit_code() == 2
    assert len(service.said.strip().splitlines()) == 1
    assert "area.geojson" in service.said
    assert not (tmp_path / "runs").exists()


def test_the_journal_of_a_run_is_complete(tmp_path: Path) -> None:
    words = service_words(write_area(tmp_path), tmp_path / "runs", "--seed", "5")
    with running(*words) as service:
        assert service.exit_code() == 0, service.said
    (path,) = (tmp_path / "runs").glob("*/journal.sqlite")
    rows = list(read_rows(path))
    assert [row.seq for row in rows] == list(range(1, len(rows) + 1))
    kinds = {row.kind for row in rows}
    assert {"transition", "decision", "command", "report", "found"} <= kinds
    sent = [row for row in rows if row.kind == "command" and row.body["command"] == "reposition"]
    report = only_report(tmp_path / "runs")
    assert len(sent) >= report["waypoints"] > 0
    with sqlite3.connect(path) as database:
        assert database.execute("PRAGMA integrity_check").fetchone() == ("ok",)


def test_ctrl_c_flies_the_aircraft_home(tmp_path: Path) -> None:
    words = service_words(write_area(tmp_path), tmp_path / "runs", "--speedup", "20")
    with running(*words) as service:
        service.wait_for("→ SEARCHING")
        service.process.send_signal(signal.SIGINT)
        service.wait_for("→ RETURNING")
        assert service.exit_code() == 4
    assert "RETURNING → DONE" in service.said


def test_a_mock_that_dies_ends_the_run(tmp_path: Path) -> None:
    words = service_words(write_area(tmp_path), tmp_path / "runs", "--speedup", "20")
    with running(*words) as service:
        service.wait_for("→ SEARCHING")
        children = subprocess.run(
            ["pgrep", "-P", str(service.process.pid), "-f", "sim autopilot"], capture_output=True, text=True
        )
        os.kill(int(children.stdout), signal.SIGKILL)
        assert service.exit_code() == 4
    assert "the mock autopilot has ended" in service.said
    assert only_report(tmp_path / "runs")["outcome"] == "aborted"


def test_the_mock_does_not_outlive_a_killed_service(tmp_path: Path) -> None:
    with running(*service_words(write_area(tmp_path), tmp_path / "runs")) as service:
        service.wait_for("→ TAKEOFF")
        find = ["pgrep", "-P", str(service.process.pid), "-f", "sim autopilot"]
        mock = int(subprocess.run(find, capture_output=True, text=True).stdout)
        service.process.kill()
        service.process.wait()
        deadline = time.monotonic() + 20
        while Path(f"/proc/{mock}/cmdline").exists() and Path(f"/proc/{mock}/cmdline").read_bytes():
            assert time.monotonic() < deadline, "the mock autopilot goes on alone"
            time.sleep(0.1)
