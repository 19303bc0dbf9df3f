"""The benchmark runs, compares equal decisions only, and writes what it says."""

from __future__ import annotations

from pathlib import Path

import pytest

from sim import bench
from sim.__main__ import main


def test_bench_prints_ratios_and_writes_table_and_plot(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["bench", "--steps", "20", "--largest", "200", "--out", str(tmp_path)]) == 0
    said = capsys.readouterr().out
    assert "times faster than its twin" in said
    assert "| 200 x 200 cells |" in said
    assert "| 1000 x 1000 cells |" not in said
    assert "200 x 200: 99.9% of 400 decisions took at most" in said
    assert "news after 10000 observations: believing them anew" in said
    assert "| iterations |" in (tmp_path / "bench.md").read_text(encoding="utf-8")
    assert (tmp_path / "bench.png").read_bytes().startswith(b"\x89PNG")


def test_the_planner_is_far_faster_than_its_twin() -> None:
    for _ in range(8):  # a machine that is busy with other things does not judge at the first try
        ratios = bench.against_twin(40, lambda line: None)
        if ratios["puct-regions-lite"] > 50 and ratios["BMDP-O / lite"] < bench.REGIONS_AT_MOST:
            return
    raise AssertionError(ratios)  # the first limit is a third of the target


def test_a_twin_that_decides_otherwise_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    # a twin that errs deep inside: none can be made to by what it is given
    monkeypatch.setattr(bench.TwinPlanner, "_roll_out", lambda self, cell, heading: float(cell[0]))
    with pytest.raises(AssertionError, match="decide differently"):
        bench.against_twin(40, lambda line: None)
