"""Trials of several searchers: one command, resumable, never above the bound, with a page that says what was met."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from roisearch import bounds
from sim.ruler_fleet import Aircraft, expected_of_first, fly_together
from sim.trials.campaign import Job
from sim.trials.cli import main
from sim.trials.fleet import FleetCampaign, strip_path
from sim.trials.fleet_cli import report_of

WORDS = [
    "--searchers",
    "2",
    "--trials",
    "1",
    "--side",
    "30",
    "--iterations",
    "1",
    "--seed",
    "1000",
    "--jobs",
    "1",
]


@pytest.fixture(scope="module")
def once(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The campaign, run to its end."""
    folder = tmp_path_factory.mktemp("once")
    assert main([*WORDS, "--out", str(folder)]) == 0
    return folder


def test_nobody_is_sooner_than_the_bound_and_two_are_sooner_than_one(once: Path) -> None:
    lines = [json.loads(line) for line in (once / "journal.jsonl").read_text(encoding="utf-8").splitlines()]
    expected = {(line["planner"], line["fov"]): line["expected"] for line in lines}
    assert len(expected) == 6
    for (way, n), mean in expected.items():
        assert mean >= expected["bound", n] - 1e-9, way
    assert expected["fleet", "2"] < expected["fleet", "1"]
    page = (once / "FLEET.md").read_text(encoding="utf-8")
    assert "1 priors of 1 are complete" in page
    assert "below strips over 1 priors: met" in page


def test_a_campaign_that_was_cut_goes_on_to_the_same_numbers(once: Path, tmp_path: Path) -> None:
    lines = (once / "journal.jsonl").read_bytes().splitlines(keepends=True)
    folder = tmp_path / "again"
    folder.mkdir()
    (folder / "campaign.json").write_bytes((once / "campaign.json").read_bytes())
    (folder / "journal.jsonl").write_bytes(b"".join(lines[:-1]) + lines[-1][:20])
    assert main([*WORDS, "--out", str(folder)]) == 0
    rows = [
        [json.loads(line) | {"timing": None} for line in (each / "journal.jsonl").read_bytes().splitlines()]
        for each in (once, folder)
    ]
    assert rows[0] == rows[1]


def test_what_flies_over_fewer_priors_is_compared_over_those_alone() -> None:
    campaign = FleetCampaign(searchers=(2,), trials=2, seed=7, slow=1)
    took = {("bound", "1"): (80.0, 200.0), ("bound", "2"): (40.0, 150.0), ("fleet", "1"): (100.0, 900.0),
            ("fleet", "2"): (50.0, 400.0), ("strips", "2"): (70.0, 800.0),
            ("independent", "2"): (60.0, 0.0)}  # fmt: skip
    results = {
        job: {"expected": took[job.planner, job.fov][job.trial - 7], "timing": {"slowest_ms": 1.0}}
        for job in campaign.jobs()
    }
    assert len(results) == 11
    page = report_of(campaign, results, "command")
    assert "| 2 | independent | 1 | 60.0 | 0.600 | 1.500 | 1.0 |" in page
    assert "| 2 | fleet | 2 | 225.0 | 0.450 | 2.368 | 1.0 |" in page
    assert "2 searchers, below independent over 1 priors: met" in page
    results[Job("fleet", "fleet", "2", 7)]["expected"] = 61.0
    assert "2 searchers, below independent over 1 priors: MISSED" in report_of(campaign, results, "command")


def test_looks_of_all_are_merged_and_none_counts_twice() -> None:
    prior = np.zeros((3, 6))
    prior[1, 1:5] = 0.25
    walks = [[(1, 1), (1, 2), (1, 3)], [(1, 4), (1, 3), (1, 2)]]
    crew = [Aircraft((1, 0)), Aircraft((1, 5), step_s=1.5)]
    flights = fly_together(crew, prior, lambda i, belief, states, now: walks[i], tail=0.01, most_s=2.5)
    np.testing.assert_allclose(flights.times, [1.0, 1.5, 2.0, 3.0, 3.0])
    np.testing.assert_allclose(flights.found, [0.225, 0.225, 0.225, 0.225, 0.0225])
    curve = bounds.release_together(prior, [bounds.Start((1, 0)), bounds.Start((1, 5), pace=1.5)], 0.9, 3)
    for step in (1, 2, 3):
        assert flights.found[flights.times <= step].sum() <= curve[step] + 1e-12


def test_the_mean_of_the_first_is_that_of_those_that_are_found_by_then() -> None:
    times, found = np.array([1.0, 2.0, 10.0]), np.array([0.5, 0.3, 0.2])
    assert expected_of_first(times, found, 0.2) == pytest.approx((0.5 + 0.6) / 0.8)
    assert expected_of_first(times, found, 0.0) == pytest.approx(0.5 + 0.6 + 2.0)
    assert expected_of_first(times, 0.5 * found, 0.2) == np.inf


def test_strips_together_look_at_every_cell_and_each_at_its_own() -> None:
    prior = np.ones((31, 20)) / 620.0
    seen = set()
    for number in range(3):
        path = strip_path(prior, number, 3, passes=1)
        rows = range(round(31 * number / 3), round(31 * (number + 1) / 3))
        mine = {(row, col) for row in rows for col in range(20)}
        assert mine <= set(path)
        seen |= mine
    assert len(seen) == 620


def test_what_cannot_be_is_refused_in_one_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for words, said in (
        (["--searchers", "0"], "1 to 16"),
        (["--searchers", "2", "--planners", "magic"], "magic"),
    ):
        assert main([*words, "--out", str(tmp_path)]) == 2
        assert said in capsys.readouterr().err
