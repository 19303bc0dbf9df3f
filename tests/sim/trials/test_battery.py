"""What one battery finds: one command, resumable, both home in time, and a page that says what was measured."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from roisearch import make_planner
from roisearch.endurance import straight_home
from sim.ruler_battery import Battery, BatteryWorld, cut, fly_battery, straight_cells
from sim.trials.battery import CUT, PLANNED, BatteryCampaign
from sim.trials.battery_report import page, summarise
from sim.trials.cli import main
from sim.trials.flight import scene_of

WORDS = [
    "--preset",
    "battery",
    "--scenes",
    "L",
    "--minutes",
    "4,6",
    "--trials",
    "1",
    "--seed",
    "1000",
    "--jobs",
    "1",
]
CAMPAIGN = BatteryCampaign(scenes=("L",), minutes=(4.0, 6.0), trials=1, seed=1000)


def test_a_campaign_ends_with_a_page_and_is_not_flown_twice(tmp_path: Path) -> None:
    assert main([*WORDS, "--out", str(tmp_path)]) == 0
    rows = json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))
    assert [(row["minutes"], row["seeds"]) for row in rows] == [(4.0, 1), (6.0, 1)]
    for row in rows:
        assert row["planned"]["pos"] > 0.9 * row["cut"]["pos"] > 0.0
        assert row["planned"]["with_home"] >= row["planned"]["pos"]
    journal = (tmp_path / "journal.jsonl").read_bytes()
    assert main([*WORDS, "--out", str(tmp_path)]) == 0
    assert (tmp_path / "journal.jsonl").read_bytes() == journal
    assert "| L | 4 | 1 |" in (tmp_path / "BATTERY.md").read_text(encoding="utf-8")


def test_a_flight_is_cut_before_the_first_cell_that_is_too_late_for_the_way_home() -> None:
    scene = scene_of("L", 1000, 20)
    world, battery = BatteryWorld(scene.prior, CAMPAIGN.fov(), CAMPAIGN.motion()), Battery(240.0, scene.start)
    assert scene.flyable is not None
    planner = make_planner("survey", fov=world.fov, motion=world.motion, flyable=scene.flyable)
    longer = fly_battery(planner, world, Battery(400.0, scene.start), np.random.default_rng(1))
    path = [(row, col) for row, col in longer.path.tolist()]
    sortie = cut(path, world, battery)
    home_s = straight_home(world.motion, scene.prior.shape, scene.start, battery.landing_s)
    ends = sortie.times + home_s[sortie.path[:, 0], sortie.path[:, 1]]
    assert (ends <= 240.0).all()
    beyond = path[len(sortie.path)]
    assert world.motion.arrivals(path, scene.start)[len(sortie.path)] + home_s[beyond] > 240.0
    looks = np.zeros(scene.prior.shape, dtype=int)
    np.add.at(looks, tuple(sortie.path.T), 1)
    assert sortie.pos == pytest.approx(float((scene.prior * (1.0 - 0.1**looks)).sum()))
    assert sortie.undetected.sum() == pytest.approx(1.0 - sortie.pos)


def test_the_straight_way_is_cell_by_cell_to_its_end() -> None:
    assert straight_cells((0, 0), (2, 4)) == [(0, 1), (1, 2), (2, 3), (2, 4)]
    assert straight_cells((3, 3), (3, 3)) == []


def told(pos: float) -> list[dict[str, float]]:
    return [{"pos": pos, "with_home": pos + 0.01, "mean_s": 200.0, "searched_s": 180.0}] * 2


def test_the_page_says_where_planning_gains_less_than_was_aimed_at_or_loses() -> None:
    jobs = {job.planner: job for job in CAMPAIGN.jobs()}
    rows = summarise(
        CAMPAIGN, {jobs[CUT]: {"batteries": told(0.5)}, jobs[PLANNED]: {"batteries": told(0.49)}}
    )
    assert rows[0]["worse"] == 1
    said = page(CAMPAIGN, rows, "the command")
    assert "in 0 of 2 rows; not in L with 4 minutes (-2.0%)" in said
    more = summarise(CAMPAIGN, {jobs[CUT]: {"batteries": told(0.5)}, jobs[PLANNED]: {"batteries": told(0.6)}})
    assert "At least 5% more is found in every row." in page(CAMPAIGN, more, "the command")


def test_what_cannot_be_flown_is_refused_in_a_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([*WORDS, "--scenes", "moon", "--out", str(tmp_path)]) == 2
    assert "scenes of flights are uniform" in capsys.readouterr().err
    assert main([*WORDS, "--minutes", "1", "--out", str(tmp_path)]) == 2
    assert "longer than two landings" in capsys.readouterr().err
