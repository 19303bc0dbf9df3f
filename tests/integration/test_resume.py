"""A killed service that is started again: the same belief to the last bit, nothing lost, nothing twice."""

from __future__ import annotations

import time
from pathlib import Path

import httpx
import pytest

from roisearch import Belief
from service.area import build_grid, read_area
from service.evidence.observe import Observation
from service.journal import read_rows
from tests.integration.flight import only_report, running, service_words, write_area
from tests.integration.scene import TARGET, flight

pytestmark = pytest.mark.timeout(600)


def replayed(folder: Path, cell_m: float, count: int | None = None) -> tuple[str, int]:
    """The digest of the belief after the first `count` journalled reports (None: all), and how many there are."""
    grid = build_grid(read_area(folder / "area.geojson"), cell_m)
    belief = Belief(grid.prior, searchable=grid.searchable, outside=grid.outside)
    rows = list(read_rows(folder / "journal.sqlite", "report"))[:count]
    for row in rows:
        if row.body["observation"]:
            o = Observation.from_dict(row.body["observation"])
            belief.observe(o.cells, o.hits, o.p_tp, o.p_tn)
    return belief.digest(), len(rows)


def test_a_killed_search_goes_on_with_the_same_belief_to_the_last_bit(tmp_path: Path) -> None:
    words = service_words(write_area(tmp_path), tmp_path / "runs", "--speedup", "10", "--cell", "20")
    with running(*words) as service:
        door = service.wait_for(r"listening on (http://\S+)").group(1)
        service.wait_for("→ SEARCHING")
        deadline = time.monotonic() + 60
        while (seen := httpx.get(f"{door}/api/map").json())["reports"] < 25:
            assert time.monotonic() < deadline
            time.sleep(0.05)
        service.process.kill()
    (folder,) = (tmp_path / "runs").iterdir()
    assert replayed(folder, 20.0, seen["reports"])[0] == seen["digest"]
    digest, count = replayed(folder, 20.0)
    again = ["service", "--resume", str(folder), "--http", "127.0.0.1:0", "--speedup", "40"]
    with running(*again) as service:
        door = service.wait_for(r"listening on (http://\S+)").group(1)
        first = httpx.get(f"{door}/api/map").json()
        assert (first["digest"], first["reports"]) == (digest, count)
        assert service.exit_code() == 0, service.said
    assert only_report(tmp_path / "runs")["simulated"]["error_cells"] <= 1.5
    ids = [row.body["report"]["id"] for row in read_rows(folder / "journal.sqlite", "report")]
    assert len(ids) == len(set(ids)) > count


def test_a_run_that_was_killed_on_its_way_home_ends_there_and_not_with_another_search(tmp_path: Path) -> None:
    with flight(tmp_path, "ardupilot", target=TARGET) as scene:
        scene.reaches("RETURNING", "found")
        while scene.control.state()["mode"] != "RTL":
            time.sleep(0.02)
        scene.service.process.kill()
        motions = len(scene.tap.motions)
        (folder,) = scene.runs.iterdir()
        again = [
            "service",
            "--resume",
            str(folder),
            "--http",
            "127.0.0.1:0",
            "--speedup",
            f"{scene.speedup:g}",
        ]
        with running(*again) as service:
            assert service.exit_code() == 0, service.said
        assert scene.tap.motions[motions:] == []  # the autopilot was bringing it home
        assert not scene.control.state()["armed"]
    report = only_report(tmp_path / "runs")
    assert report["outcome"] == "found"
    assert report["position"]["lat"] == pytest.approx(47.0508, abs=3e-4)


def test_resuming_what_is_no_run_is_one_clear_line(tmp_path: Path) -> None:
    with running("service", "--resume", str(tmp_path)) as service:
        assert service.exit_code() == 2
    assert "there is no journal here" in service.said
