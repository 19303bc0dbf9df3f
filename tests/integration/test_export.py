"""A real search, exported by another process while it flies and after it: the same belief, and a run undisturbed."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from pathlib import Path

import httpx
import pytest

from service.export.run import read_run
from service.journal import read_rows
from tests.integration.flight import REPOSITORY, only_report, running, service_words, write_area

pytestmark = pytest.mark.timeout(600)


def export(run: Path, name: str, out: Path) -> str:
    """Export by the command, as a person would; what it said."""
    words = [sys.executable, "-m", "service", "export", str(run), "--format", name, "--out", str(out)]
    done = subprocess.run(words, cwd=REPOSITORY, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_a_search_is_exported_while_it_flies_and_after_it(tmp_path: Path) -> None:
    words = service_words(
        write_area(tmp_path), tmp_path / "runs", "--speedup", "20", "--cell", "20", "--seed", "3"
    )
    with running(*words) as service:
        door = service.wait_for(r"listening on (http://\S+)").group(1)
        service.wait_for("→ SEARCHING")
        (folder,) = (tmp_path / "runs").iterdir()
        deadline = time.monotonic() + 60
        while httpx.get(f"{door}/api/state").json()["pos"] <= 0.0:
            assert time.monotonic() < deadline, service.said
            time.sleep(0.05)
        # Held, so that the search does not end before it is exported; reports go on being written.
        httpx.post(f"{door}/api/commands", json={"command": "hold"}).raise_for_status()
        before = httpx.get(f"{door}/api/state").json()
        export(folder, "geojson", tmp_path / "live.geojson")
        after = httpx.get(f"{door}/api/state").json()
        live = json.loads((tmp_path / "live.geojson").read_bytes())
        assert before["pos"] <= live["run"]["pos"] <= after["pos"]
        assert after["reports"]["accepted"] > before["reports"]["accepted"]
        assert live["run"]["state"] == "HOLDING"
        assert any(feature["properties"]["role"] == "track" for feature in live["features"])
        httpx.post(f"{door}/api/commands", json={"command": "resume"}).raise_for_status()
        assert service.exit_code() == 0, service.said
    report = only_report(tmp_path / "runs")
    said = export(folder, "geojson", tmp_path / "over.geojson")
    over = json.loads((tmp_path / "over.geojson").read_bytes())
    (found,) = [each for each in over["features"] if each["properties"]["role"] == "found"]
    lon, lat = found["geometry"]["coordinates"]
    assert (lat, lon) == pytest.approx((report["position"]["lat"], report["position"]["lon"]), abs=1e-7)
    assert over["run"]["pos"] == pytest.approx(report["pos"])
    assert "found at" in said
    run = read_run(folder)
    rows = list(read_rows(folder / "journal.sqlite"))
    assert [row.seq for row in rows] == list(range(1, len(rows) + 1))
    assert run.looks == report["looks"]
    assert run.over
