"""Flights in seconds: one command, resumable, never above the bound, and a page that says where the default loses."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from sim.scenario import trail_prior
from sim.trials.cli import main
from sim.trials.flight import DEFAULT, MORE, FlightCampaign, planner_of, scene_of
from sim.trials.flight_report import losses, targets

WORDS = ["--preset", "flight", "--planners", "survey,index", "--scenes", "L,mass", "--trials", "2", "--side", "20",
         "--seed", "1000", "--slow", "1", "--jobs", "1"]  # fmt: skip


@pytest.fixture(scope="module")
def once(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The campaign, run to its end."""
    folder = tmp_path_factory.mktemp("once")
    assert main([*WORDS, "--out", str(folder)]) == 0
    return folder


def test_a_campaign_that_was_cut_goes_on_to_the_same_numbers(once: Path, tmp_path: Path) -> None:
    lines = (once / "journal.jsonl").read_bytes().splitlines(keepends=True)
    folder = tmp_path / "again"
    folder.mkdir()
    (folder / "campaign.json").write_bytes((once / "campaign.json").read_bytes())
    (folder / "journal.jsonl").write_bytes(b"".join(lines[: len(lines) // 2]) + lines[-1][:20])
    assert main([*WORDS, "--out", str(folder)]) == 0
    assert (folder / "summary.json").read_bytes() == (once / "summary.json").read_bytes()
    kept = (folder / "journal.jsonl").read_bytes().splitlines(keepends=True)
    assert kept[: len(lines) // 2] == lines[: len(lines) // 2]
    assert len(kept) == len(lines)


def test_no_flight_is_above_the_bound_and_found_is_never_before_the_first_hit(once: Path) -> None:
    rows = json.loads((once / "summary.json").read_text(encoding="utf-8"))
    assert {(row["scene"], row["p_tn"]) for row in rows} == {
        ("L", 1.0),
        ("L", 0.99),
        ("L", 0.9),
        ("mass", 1.0),
    }
    assert all(row["above_bound"] > 0.0 and row["seeds"] == 2 for row in rows)
    for row in rows:  # only the areas have the bound that counts travel
        assert (row["above_proven"] is None) == (row["scene"] == "mass")
        assert row["scene"] == "mass" or 0.0 < row["above_proven"] < row["above_bound"]
    assert all(row["means"][1] >= row["means"][0] for row in rows)
    alarms = [row for row in rows if row["p_tn"] == 0.9]
    assert all(row["means"][1] > row["means"][0] + 10.0 and row["sequels"] == 64 * MORE for row in alarms)
    page = (once / "FLIGHT.md").read_text(encoding="utf-8")
    assert "Not complete" not in page
    assert (
        page.index("## Where the default loses")
        < page.index("## The targets")
        < page.index("## Uniform over an L")
    )
    assert (once / "flight-L.png").read_bytes().startswith(b"\x89PNG")


def row(planner: str, value: float | None, scene: str = "uniform", p_tn: float = 1.0) -> dict[str, object]:
    return {
        "scene": scene, "p_tn": p_tn, "acceleration": 1.5, "planner": planner,
        "default_of_it": [(value, 0.01)] + [(1.0, None)] * 4,
    }  # fmt: skip


def test_the_page_says_where_the_default_loses_the_worst_first() -> None:
    said = losses([row("survey", 1.02), row("index", 1.2), row("spiral", 0.7), row(DEFAULT, 1.0)])
    first, second = said.splitlines()
    assert first.startswith("- 1.200 ± 0.010 of `index`: uniform")
    assert second.startswith("- 1.020 ± 0.010 of `survey`: uniform")
    assert losses([row("survey", 0.99)]).startswith("Nowhere")


def test_a_target_is_judged_by_its_worst_condition() -> None:
    said = targets([row("survey", 0.99), row("survey", 1.01, "L", 0.9), row("index", 2.0)])
    assert "of `survey` ≤ 1.00 | 1.010: L, p_tn 0.9, 1.5 m/s2 | **no** |" in said
    assert "| yes |" in said  # the times to POS


def test_the_default_plans_by_the_motion_and_the_default_in_steps_does_not() -> None:
    campaign = FlightCampaign()
    motion = campaign.motions()[0]
    fov = FlightCampaign.fov(0.9)
    assert type(planner_of("default", fov, motion, None)) is not type(
        planner_of("default-in-steps", fov, motion, None)
    )
    paper = [job for job in campaign.jobs() if job.planner == "default-in-steps" and job.fov == "mass 1"]
    areas = [job for job in campaign.jobs() if job.planner == "default-in-steps" and job.fov == "uniform 1"]
    assert (len(paper), len(areas)) == (campaign.trials, campaign.slow)


def test_scenes_are_the_same_for_a_seed_and_start_where_one_can_fly() -> None:
    for name in ("uniform", "L", "trail", "height"):
        one, again, other = (scene_of(name, seed, 20) for seed in (7, 7, 8))
        np.testing.assert_array_equal(one.prior, again.prior)
        assert one.start == again.start
        assert one.flyable is None or one.flyable[one.start]
        assert one.start != other.start or (one.prior != other.prior).any()
    trail = trail_prior(np.random.default_rng(1), (40, 40))
    assert trail.sum() == pytest.approx(1.0)
    assert (trail.max(axis=0) > 0.4 * trail.max()).all()  # it goes through every column


def test_what_cannot_be_flown_is_refused_in_a_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([*WORDS, "--scenes", "moon", "--out", str(tmp_path)]) == 2
    assert "scenes of flights are uniform" in capsys.readouterr().err
