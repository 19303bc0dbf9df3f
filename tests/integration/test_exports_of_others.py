"""Areas that other programs drew are flown as they are: the service as a process, with its mock and its detector.

All kinds of file are read in tests/service/area; two are flown.
"""

from __future__ import annotations

import json
import time
from pathlib import Path

import httpx
import pytest

from service.area import build_grid, read_area
from service.survey import is_of
from tests.integration.flight import only_report, running, service_words

pytestmark = pytest.mark.timeout(600)
EXPORTS = Path(__file__).parents[1] / "service" / "area" / "exports"
CELL_M = 40.0


@pytest.mark.parametrize("name", ["caltopo.json", "survey.plan"])
def test_an_area_of_another_program_is_searched(name: str, tmp_path: Path) -> None:
    given = EXPORTS / name
    words = service_words(given, tmp_path / "runs", "--cell", f"{CELL_M:g}", "--seed", "3", "--speedup", "10")
    with running(*words) as service:
        door = service.wait_for(r"listening on (http://\S+)").group(1)
        deadline = time.monotonic() + 240.0
        while (state := httpx.get(f"{door}/api/state", timeout=60.0).json())["steps"] < 3 or not state[
            "pos"
        ] > 0:
            assert time.monotonic() < deadline, service.said
            time.sleep(0.2)
        httpx.post(f"{door}/api/commands", json={"command": "abort"}, timeout=60.0).raise_for_status()
        assert service.exit_code() == 4, service.said
    (folder,) = (tmp_path / "runs").iterdir()
    kept, first = read_area(folder / "area.geojson"), read_area(given)
    assert (build_grid(kept, CELL_M).prior == build_grid(first, CELL_M).prior).all()
    assert (folder / f"area-as-given{given.suffix}").read_bytes() == given.read_bytes()
    assert is_of(folder, given)
    report = only_report(tmp_path / "runs")
    assert json.loads((folder / "area.geojson").read_text(encoding="utf-8"))["name"] == report["area"]
