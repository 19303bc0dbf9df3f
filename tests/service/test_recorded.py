"""Yesterday's runs after an update: flights that each released version flew itself, read by this one.

`recorded/` holds a run's folder of each version as that one left it: area, journal and, to compare with, its own
report. The flight of 0.1.0 was given up after its pilot had taken it, the others found the target.
"""

from __future__ import annotations

import json
import zipfile
from pathlib import Path
from typing import Any

import pytest

from service.cli import main
from service.export.run import read_run
from service.resume import stored_run
from service.survey import JOURNAL
from service.view.replay import ReplayView

RECORDED = Path(__file__).parent / "recorded"
VERSIONS = [each.stem for each in sorted(RECORDED.glob("*.zip"))]
Run = tuple[Path, dict[str, Any]]


@pytest.fixture(scope="module", params=VERSIONS)
def run(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Run:
    """A run's folder, and what its own version reported of it."""
    folder = tmp_path_factory.mktemp("runs") / str(request.param)
    with zipfile.ZipFile(RECORDED / f"{request.param}.zip") as packed:
        packed.extractall(folder)
    return folder, json.loads((folder / "report.json").read_text())


def test_every_released_version_has_left_a_run() -> None:
    changelog = (Path(__file__).parents[2] / "CHANGELOG.md").read_text(encoding="utf-8")
    released = {line.split()[1] for line in changelog.splitlines() if line.startswith("## 0.")}
    assert released <= set(VERSIONS), "record a flight of the new version, so that the next ones can read it"


def test_it_is_exported_as_it_was_reported(run: Run) -> None:
    folder, report = run
    exported = read_run(folder)
    assert exported.pos == pytest.approx(report["pos"], rel=1e-9)
    assert exported.belief.outside == pytest.approx(report["outside"], rel=1e-9)
    assert (exported.looks, len(exported.area.polygon.geoms)) == (report["looks"], 1)
    found = exported.find and {"lat": exported.find.lat, "lon": exported.find.lon}
    assert found == (report["position"] and pytest.approx(report["position"], abs=1e-6))


def test_its_replay_ends_where_it_ended(run: Run) -> None:
    folder, report = run
    state = ReplayView(folder).state()
    assert state["state"] == "DONE"
    if "sorties" in report:  # 0.1.0 journalled no cell that it flew over without a look
        assert state["steps"] == report["steps"]
    assert state["pos"] == pytest.approx(report["pos"], rel=1e-9)
    assert len(state["sorties"]) == len(report.get("sorties", []))


@pytest.mark.parametrize("kind", ["html", "geojson", "kml", "gpx", "geotiff", "csv"])
def test_every_export_of_it_is_written(run: Run, kind: str, tmp_path: Path) -> None:
    assert main(["export", str(run[0]), "--format", kind, "--out", str(tmp_path / "out")]) == 0
    assert (tmp_path / "out").stat().st_size > 500


def test_one_that_is_not_over_can_be_gone_on_with_and_one_that_is_cannot(
    run: Run, capsys: pytest.CaptureFixture[str]
) -> None:
    folder, report = run
    if report["outcome"] == "aborted":
        settings, _, _, entries = stored_run(folder)
        assert settings.flight.speed_mps > 0.0
        assert len(entries) > 1000
    else:
        before = (folder / JOURNAL).read_bytes()
        assert main(["--resume", str(folder)]) == 2
        assert "this run is over (found at 56.60897" in " ".join(capsys.readouterr().err.split())
        assert (folder / JOURNAL).read_bytes() == before
