"""Trials with a target that walks: one command, resumable, a page that says what was met, and the optimum beside."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from sim.trials.cli import main
from sim.trials.walking import KNOWS, STILL, WAYS, WalkingCampaign
from sim.trials.walking_optimum import AIM, expected_and_best

WORDS = ["--preset", "walking", "--trials", "1", "--side", "12", "--hours", "0.1", "--minutes", "2,6"]
WORDS += ["--seed", "1000", "--jobs", "1"]


@pytest.fixture(scope="module")
def once(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The campaign, run to its end."""
    folder = tmp_path_factory.mktemp("once")
    assert main([*WORDS, "--out", str(folder)]) == 0
    return folder


def test_the_page_compares_every_way_with_the_still_planner(once: Path) -> None:
    lines = [json.loads(line) for line in (once / "journal.jsonl").read_text(encoding="utf-8").splitlines()]
    by_way = {line["planner"]: line for line in lines}
    assert set(by_way) == set(WAYS)
    for line in lines:
        assert 0.0 < line["found"][0] < line["found"][1] < 1.0
        assert line["curve"][0] == 0.0
        assert line["curve"] == sorted(line["curve"])
        assert 0.0 < line["expected"] < 360.0
    page = (once / "WALKING.md").read_text(encoding="utf-8")
    less = 1.0 - by_way[KNOWS]["expected"] / by_way[STILL]["expected"]
    assert f"takes the target as still: {less:.1%}: " in page
    assert "1 priors of 1 are complete" in page
    assert (once / "walking.png").read_bytes().startswith(b"\x89PNG")


def test_a_campaign_that_was_cut_goes_on_to_the_same_numbers(once: Path, tmp_path: Path) -> None:
    lines = (once / "journal.jsonl").read_bytes().splitlines(keepends=True)
    folder = tmp_path / "again"
    folder.mkdir()
    (folder / "campaign.json").write_bytes((once / "campaign.json").read_bytes())
    (folder / "journal.jsonl").write_bytes(lines[2] + lines[1][:20])
    assert main([*WORDS, "--out", str(folder)]) == 0
    rows = [
        sorted(
            json.dumps(json.loads(line) | {"timing": None})
            for line in (each / "journal.jsonl").read_bytes().splitlines()
        )
        for each in (once, folder)
    ]
    assert rows[0] == rows[1]


def test_the_planner_is_near_the_optimum_on_a_tiny_map() -> None:
    table = np.array([expected_and_best(WalkingCampaign(), (3, 3), seed, (KNOWS,)) for seed in (1000, 1001)])
    assert (table[:, 0] >= table[:, 1] - 1e-9).all()
    assert table[:, 0].sum() <= (1.0 + AIM) * table[:, 1].sum()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--planners", "magic"], "magic"),
        (["--minutes", "90", "--hours", "1"], "within the flight"),
        (["--target-mps", "0"], "speed_mps"),
    ],
)
def test_what_cannot_be_is_refused_in_one_sentence(
    words: list[str], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["--preset", "walking", *words, "--out", str(tmp_path)]) == 2
    assert said in capsys.readouterr().err
