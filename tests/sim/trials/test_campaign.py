"""What can be asked of a campaign, and what is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sim.__main__ import main
from sim.trials.campaign import BOUND, CURVE, SEARCH, Campaign, Job, load_prior, parse_planner
from sim.trials.cli import campaign_from, parser
from sim.trials.journal import Journal, Refused


def asked(*words):
    return campaign_from(parser().parse_args([*words, "--out", "unused"]))


def test_the_papers_preset_is_the_papers_experiment():
    campaign = asked("--preset", "paper")
    assert campaign.trials == 250
    assert campaign.cap == 40_000
    assert campaign.found == "covered"
    assert campaign.shape == (200, 200)
    assert [pair for pair in campaign.scenarios() if pair[1] == "point"] == [
        (planner, "point")
        for planner in ("puct-regions-lite", "puct-regions", "puct", "direct-policy-search", "greedy")
    ]
    assert ("puct-regions-lite", "donut") in campaign.scenarios()
    assert ("greedy", "donut") not in campaign.scenarios()
    assert campaign.curves > 0


def test_naming_the_fields_of_view_flies_every_planner_with_each():
    assert ("greedy", "donut") in asked("--preset", "paper", "--fov", "point,donut").scenarios()


def test_what_is_given_overrides_the_papers_preset():
    campaign = asked("--preset", "paper", "--planners", "index", "--trials", "3", "--found", "hit")
    assert (campaign.planners, campaign.trials, campaign.found) == (("index",), 3, "hit")


def test_rulers_choose_between_searches_and_curves():
    assert (asked("--planners", "index", "--trials", "60").curves) == 0
    asked_for = asked("--planners", "index", "--trials", "20", "--curves", "10")
    assert (asked_for.trials, asked_for.curves) == (20, 10)
    both = asked("--planners", "index", "--trials", "60", "--ruler", "both")
    assert (both.trials, both.curves) == (60, 40)
    curve = asked("--planners", "index", "--ruler", "curve", "--curves", "7")
    assert (curve.trials, curve.curves) == (0, 7)
    assert {job.kind for job in curve.jobs()} == {BOUND, CURVE}


@pytest.mark.parametrize(
    ("words", "names"),
    [
        (["--planners", "hunch"], "hunch"),
        (["--planners", "greedy@paper"], "greedy"),
        (["--planners", "puct:iterations"], "iterations"),
        (["--planners", "puct:colour=3"], "colour"),
        (["--planners", "index", "--fov", "fisheye"], "fisheye"),
        (["--planners", "index,index"], "twice"),
        (["--planners", "index", "--trials", "0"], "trial"),
        (["--planners", "index", "--start", "5,200"], "start"),
        (["--planners", "index", "--p-tp", "0"], "p_tp"),
        (
            ["--planners", "index", "--size", "1,9", "--start", "0,0"],
            "at least 2 rows and 2 columns, not 1 x 9",
        ),
        (["--planners", "index", "--cap", "0"], "cap"),
        (["--planners", "index", "--prior", "nowhere.npy"], "nowhere.npy"),
        (["--planners", "index", "--jobs", "0"], "--jobs"),
        ([], "--planners"),
    ],
)
def test_bad_input_is_one_sentence_and_exit_code_2(words, names, tmp_path, capsys):
    assert main(["trials", *words, "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert names in said
    assert said.count("\n") == 1


def test_planner_specifications_are_read():
    assert parse_planner("puct") == ("puct", "", {})
    spec = "puct-regions-lite@paper:iterations=400:commit=never:penalty=none:explore=0.25:fades=true"
    name, preset, options = parse_planner(spec)
    assert (name, preset) == ("puct-regions-lite", "paper")
    assert options == {"iterations": 400, "commit": "never", "penalty": None, "explore": 0.25, "fades": True}


def test_a_trial_draws_the_same_whatever_else_is_in_the_campaign():
    one = Campaign(planners=("index",), trials=3, shape=(12, 12))
    many = Campaign(
        planners=("greedy", "index"), fovs=("donut", "point"), trials=50, curves=9, shape=(12, 12)
    )
    assert (one.scenario(2).prior == many.scenario(2).prior).all()
    assert (one.scenario(1).prior != many.scenario(2).prior).any()
    assert one.rng(2, 1).random() == many.rng(2, 1).random()
    assert one.rng(2, 1).random() != one.rng(2, 2).random()
    assert one.rng(2, 1).random() != replace(one, seed=2).rng(2, 1).random()


def test_a_given_map_is_searched(tmp_path):
    prior = np.zeros((6, 9))
    prior[4, 7] = 3.0
    np.savez(tmp_path / "map.npz", prior=prior, flyable=np.ones((6, 9), dtype=bool))
    given = load_prior(tmp_path / "map.npz")
    campaign = Campaign(planners=("index",), start=(0, 0), **given)
    assert campaign.shape == (6, 9)
    assert campaign.scenario(0).prior[4, 7] == 1.0
    assert campaign.scenario(5).flyable.all()


@pytest.mark.parametrize(
    "arrays", [{"map": np.ones((3, 3))}, {"prior": np.zeros((3, 3))}, {"prior": np.ones(3)}]
)
def test_a_file_without_a_map_is_refused_by_name(arrays, tmp_path):
    np.savez(tmp_path / "bad.npz", **arrays)
    with pytest.raises(ValueError, match=r"bad\.npz"):
        load_prior(tmp_path / "bad.npz")


def test_a_folder_refuses_another_campaign_and_names_what_differs(tmp_path):
    campaign = Campaign(planners=("index",), trials=3)
    with Journal(tmp_path, campaign):
        pass
    with Journal(tmp_path, campaign):
        pass
    with pytest.raises(Refused, match="seed = 1, not 7"):
        Journal(tmp_path, replace(campaign, seed=7))


def test_a_cut_last_line_is_dropped_and_a_damaged_one_is_refused(tmp_path):
    campaign = Campaign(planners=("index",), trials=3)
    result = {"kind": SEARCH, "planner": "index", "fov": "point", "trial": 0, "steps": 4}
    with Journal(tmp_path, campaign) as journal:
        journal.add([result])
    path = tmp_path / "journal.jsonl"
    whole = path.read_bytes()
    path.write_bytes(whole + whole[: len(whole) // 2])
    with Journal(tmp_path, campaign) as journal:
        assert journal.results == {Job(SEARCH, "index", "point", 0): result}
    assert path.read_bytes() == whole
    path.write_bytes(b"nonsense\n" + whole)
    with pytest.raises(Refused, match="line 1"):
        Journal(tmp_path, campaign)


def test_a_search_that_comes_with_a_curve_is_no_job_of_its_own(tmp_path):
    campaign = Campaign(planners=("index",), trials=3, curves=2, found="covered")
    with Journal(tmp_path, campaign) as journal:
        left = journal.left(campaign.jobs(), campaign)
        assert [job.trial for job in left if job.kind == SEARCH] == [2]
        journal.add([{"kind": CURVE, "planner": "index", "fov": "point", "trial": 0}])
        assert Job(SEARCH, "index", "point", 0) in journal.left(campaign.jobs(), campaign)
    hit = replace(campaign, found="hit")
    assert len([job for job in hit.jobs() if hit.search_of(job)]) == 0
