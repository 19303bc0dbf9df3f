"""A search for a target that walks: found where it is by then, and the same again from the journal."""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any

import pytest

from service.resume import retrace_all, stored_run
from service.search import Search
from tests.integration.flight import FIELD, only_report, running, service_words, write_area

pytestmark = pytest.mark.timeout(600)
CORNER = [[8.3, 47.05], [8.301, 47.05], [8.301, 47.0507], [8.3, 47.0507], [8.3, 47.05]]
"""The field's corner with the launch point, 76 x 78 m: a target that walks slowly is found there within minutes."""


def test_a_target_that_walks_is_found_where_it_has_got_to(tmp_path: Path) -> None:
    area: dict[str, Any] = copy.deepcopy(FIELD)
    area["features"][0]["geometry"]["coordinates"] = [CORNER]
    area["features"][1]["geometry"]["coordinates"] = [8.3006, 47.0504]
    area["features"][0]["properties"]["target"] = {"moves": "walks", "speed_mps": 0.2, "stops_per_hour": 0.3}
    config = tmp_path / "sure.toml"
    config.write_text("[sensor]\np_tn = 0.999\n", encoding="utf-8")
    more = ("--config", str(config), "--seed", "3", "--speedup", "20")
    words = service_words(write_area(tmp_path, area), tmp_path / "runs", *more)
    with running(*words) as service:
        assert service.exit_code() == 0, service.said
    report = only_report(tmp_path / "runs")
    assert report["outcome"] == "found"
    assert report["simulated"]["error_cells"] <= 1.5
    (folder,) = (tmp_path / "runs").iterdir()
    settings, _, grid, _ = stored_run(folder)
    digests = set()
    for _ in range(2):
        search = Search(grid, settings)
        retrace_all(folder / "journal.sqlite", search)
        assert search.belief.walks is not None
        assert search.record.pos == report["pos"]
        digests.add(search.belief.digest())
    assert len(digests) == 1
