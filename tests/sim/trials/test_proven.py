"""The default beside the bound that counts travel: one command, resumable, and a page that says what was missed."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from sim.scenario import paper_prior
from sim.trials.cli import main
from sim.trials.proven import ProvenCampaign, hills_of
from sim.trials.proven_report import page

WORDS = [
    "--preset",
    "proven",
    "--side",
    "40",
    "--trials",
    "1",
    "--seed",
    "1002",
    "--divisions",
    "1",
    "--jobs",
    "1",
]


def test_a_campaign_ends_with_a_page_and_is_not_flown_twice(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert main([*WORDS, "--out", str(tmp_path)]) == 0
    (row,) = json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))
    assert row["flown"] >= row["proven"] >= row["release"] > 0.0
    assert row["pos"] > 0.9
    journal = (tmp_path / "journal.jsonl").read_bytes()
    assert main([*WORDS, "--out", str(tmp_path)]) == 0
    assert (tmp_path / "journal.jsonl").read_bytes() == journal
    assert f"| {row['hills']} | 1002 |" in (tmp_path / "PROVEN.md").read_text(encoding="utf-8")


def test_the_hills_of_a_seed_are_those_of_its_prior() -> None:
    """Peaks that stand apart can be counted."""
    for seed in (1000, 1003, 1006):
        prior = paper_prior(np.random.default_rng(seed), (200, 200))
        middle = prior[1:-1, 1:-1]
        others = [np.roll(prior, at, (0, 1))[1:-1, 1:-1] for at in ((1, 0), (-1, 0), (0, 1), (0, -1))]
        peaks = (np.all([middle >= each for each in others], axis=0) & (middle > 1e-3 * prior.max())).sum()
        assert 1 <= peaks <= hills_of(seed)


def test_the_page_says_whether_what_was_aimed_at_was_met() -> None:
    row = {"trial": 5000, "steps": 2000, "release": 90.0, "proven": 100.0, "pos": 0.99}
    said = page(
        ProvenCampaign(), [{**row, "hills": 2, "flown": 102.0}, {**row, "hills": 4, "flown": 109.0}], "it"
    )
    assert (
        "1 to 2 hills, 1 priors: 1.020 of the proven bound on average, at worst 1.020; at most 1.03" in said
    )
    assert "at most 1.07 was aimed at: missed" in said
    assert "13.3% | 2.0% |" in said


def test_what_cannot_be_flown_is_refused_in_a_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([*WORDS, "--side", "3", "--out", str(tmp_path)]) == 2
    assert "20 cells on a side" in capsys.readouterr().err
