"""Results as typed tables, and a campaign that takes a planner later, also one from outside."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from sim.trials.cli import main
from sim.trials.table import load

WORDS = [
    "--trials",
    "3",
    "--curves",
    "2",
    "--ruler",
    "both",
    "--size",
    "12,12",
    "--cap",
    "200",
    "--seed",
    "5",
]
OURS = "tests.roisearch.planners.test_outside:Wanderer"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A campaign of one planner, to which two came later."""
    out = tmp_path_factory.mktemp("campaign")
    assert main([*WORDS, "--planners", "index", "--jobs", "1", "--out", str(out)]) == 0
    first = (out / "journal.jsonl").read_bytes()
    assert main([*WORDS, "--planners", f"greedy,{OURS}", "--jobs", "1", "--out", str(out)]) == 0
    assert (out / "journal.jsonl").read_bytes().startswith(first)  # nothing was done again
    return out


def test_a_planner_that_comes_later_flies_over_the_same_maps(folder: Path) -> None:
    trials = load(folder)
    assert trials.planners() == ("index", "greedy", OURS)
    for planner in trials.planners():
        mine = trials.searches[trials.searches["planner"] == planner]
        assert mine["trial"].tolist() == [0, 1, 2]
        assert (
            mine["target_row"].tolist() == trials.searches[:: len(trials.planners())]["target_row"].tolist()
        )
    assert OURS in (folder / "report.md").read_text()


def test_tables_have_types_and_say_what_the_journal_says(folder: Path) -> None:
    trials = load(folder)
    assert trials.searches.dtype["found"] == np.bool_
    assert trials.searches.dtype["steps"] == np.int64
    lines = [json.loads(line) for line in (folder / "journal.jsonl").read_text().splitlines()]
    said = {(r["planner"], r["trial"]): r for r in lines if r["kind"] == "search"}
    for row in trials.searches:
        assert row["steps"] == said[row["planner"], row["trial"]]["steps"]
        assert row["plan_ms"] == said[row["planner"], row["trial"]]["timing"]["plan_ms"]
    assert len(trials.curves) == 3 * 2
    assert len(trials.bounds) == 3
    assert (trials.curves["expected"] > 0).all()
    curve = trials.detection["index", "point", 0]
    assert (np.diff(curve) >= 0).all()


def test_a_folder_without_a_campaign_is_refused_by_name(folder: Path, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="holds no campaign"):
        load(tmp_path)
    for name in ("campaign.json", "journal.jsonl"):
        (tmp_path / name).write_bytes((folder / name).read_bytes())
    with (tmp_path / "journal.jsonl").open("a") as file:
        file.write("{}\n")
    with pytest.raises(ValueError, match=r"line \d+ of .*journal\.jsonl is damaged"):
        load(tmp_path)


def test_another_seed_is_another_campaign_whatever_its_planners(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = [word if word != "5" else "6" for word in WORDS]
    assert main([*words, "--planners", "coverage", "--jobs", "1", "--out", str(folder)]) == 2
    assert "seed = 5, not 6" in capsys.readouterr().err
