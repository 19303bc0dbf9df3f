"""What a single job counts, and how jobs are summed up."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from roisearch import FieldOfView, bounds, make_planner
from sim.ruler import Ruler, detection_curve
from sim.trials import published
from sim.trials.campaign import BOUND, CURVE, FOVS, SEARCH, Campaign, Job, load_prior
from sim.trials.claims import weigh
from sim.trials.summary import percentiles, ratio, summarise
from sim.trials.trial import grid, run_job
from sim.trials.world import Ground, Sight, Truth, View, look

SMALL = Campaign(planners=("index",), trials=4, cap=600, shape=(16, 16))


def without_times(results):
    return [{key: value for key, value in result.items() if key != "timing"} for result in results]


def plain_look(cell, heading, target, covered, silent, fov, draws, undetected, seen):
    """The slow twin of the kernel `look`."""
    offsets = fov.offsets[heading]
    shape = undetected.shape
    found, gained, fresh, alarms, observation = False, 0.0, 0, 0, []
    for i, (dr, dc) in enumerate(offsets):
        at = (cell[0] + int(dr), cell[1] + int(dc))
        if not (0 <= at[0] < shape[0] and 0 <= at[1] < shape[1]):
            continue
        detects = 1.0 if covered and fov.p_tp[i] > 0 else fov.p_tp[i]
        gained += detects * undetected[at]
        undetected[at] -= detects * undetected[at]
        fresh += not seen[at]
        seen[at] = True
        there = at == target
        found |= there and draws[i] < detects
        hit = draws[i] < detects if there and not silent else draws[i] >= fov.p_tn[i]
        alarms += hit and not there
        observation.append((*at, hit))
    return found, gained, fresh, alarms, observation


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from(FOVS), st.booleans(), st.booleans(), st.booleans())
def test_the_look_kernel_agrees_with_its_slow_twin(seed, name, covered, silent, somewhere):
    rng = np.random.default_rng(seed)
    makers = {"point": FieldOfView.point, "donut": FieldOfView.donut, "wide-angle": FieldOfView.wide_angle}
    fov = makers[name](0.8, 0.7)
    rows, cols, k = 5, 6, len(fov.p_tp)
    cell, heading = (int(rng.integers(rows)), int(rng.integers(cols))), int(rng.integers(4))
    target = (int(rng.integers(rows)), int(rng.integers(cols))) if somewhere else (-1, -1)
    undetected, seen = rng.random((rows, cols)), rng.random((rows, cols)) < 0.5
    draws = rng.random(k)
    left, marked = undetected.copy(), seen.copy()
    sight, truth = Sight.of(k), Truth(target[0] * cols + target[1] if somewhere else -1, covered, silent)
    view, ground = View(fov.offsets, fov.p_tp, fov.p_tn), Ground(left, marked)
    count, found, gained, fresh, alarms = look(cell, heading, truth, view, draws, ground, sight)
    plain = plain_look(cell, heading, target, covered, silent, fov, draws, undetected, seen)
    assert (found, fresh, alarms) == (plain[0], plain[2], plain[3])
    assert gained == pytest.approx(plain[1], rel=1e-12)
    assert [(*sight.cells[i].tolist(), bool(sight.hits[i])) for i in range(count)] == plain[4]
    assert np.allclose(left, undetected, rtol=1e-12)
    assert (marked == seen).all()


@pytest.mark.parametrize("fov", FOVS)
@pytest.mark.parametrize("planner", ["greedy", "puct-regions-lite@paper"])
def test_a_covered_search_is_the_beginning_of_its_curve(planner, fov):
    campaign = replace(SMALL, planners=(planner,), fovs=(fov,), found="covered", curves=4)
    for trial in range(2):
        curve, search = without_times(run_job(campaign, Job(CURVE, planner, fov, trial)))
        assert [search] == without_times(run_job(campaign, Job(SEARCH, planner, fov, trial)))
        assert [curve] == without_times(run_job(replace(campaign, trials=0), Job(CURVE, planner, fov, trial)))


@pytest.mark.parametrize("found", ["hit", "covered"])
@pytest.mark.parametrize("fov", FOVS)
def test_no_curve_is_above_the_bound_of_its_prior(fov, found):
    campaign = replace(SMALL, fovs=(fov,), trials=0, curves=2, found=found)
    for trial in range(2):
        (curve,) = run_job(campaign, Job(CURVE, "index", fov, trial))
        (bound,) = run_job(campaign, Job(BOUND, "", fov, trial))
        assert (np.array(curve["curve"]) <= np.array(bound["curve"]) + 1e-9).all()
        assert curve["expected"] >= bound["expected"] >= bound["teleport"] - 1e-9


@pytest.mark.parametrize("fov", FOVS)
def test_a_curve_is_that_of_the_plain_ruler(fov):
    campaign = replace(SMALL, fovs=(fov,), trials=0, curves=1, p_tn=1.0, tail=0.0)
    (curve,) = run_job(campaign, Job(CURVE, "index", fov, 0))
    view = campaign.fov(fov)
    plain = detection_curve(
        make_planner("index", fov=view), campaign.scenario(0).prior, campaign.start, campaign.cap,
        Ruler(0.9, fov=view), np.random.default_rng(0),
    )  # fmt: skip
    assert curve["expected"] == pytest.approx(bounds.expected_time(plain), rel=1e-9)
    assert np.allclose(curve["curve"], plain[grid(campaign.cap)], atol=1e-9)


@pytest.mark.parametrize("p_tn", [1.0, 0.7])
def test_the_curve_of_a_perfect_detector_ends_when_nothing_is_left(p_tn):
    prior, view = np.full((4, 5), 1 / 20), FieldOfView.point(1.0, p_tn)
    planner, rng = make_planner("index", fov=view), np.random.default_rng(0)
    curve = detection_curve(planner, prior, (0, 0), 400, Ruler(1.0, p_tn, view), rng)
    assert curve[-1] == pytest.approx(1.0)
    assert (np.diff(curve) >= 0.0).all()


def test_searches_are_found_as_often_as_the_curve_says():
    campaign = replace(SMALL, planners=("coverage",), p_tn=1.0, trials=300, cap=200)
    (curve,) = run_job(replace(campaign, trials=0, curves=1), Job(CURVE, "coverage", "point", 0))
    expected = []
    for trial in range(120):
        (one,) = run_job(campaign, Job(SEARCH, "coverage", "point", trial))
        (own,) = run_job(replace(campaign, trials=0, curves=120), Job(CURVE, "coverage", "point", trial))
        expected.append((one["steps"], own["expected"]))
    steps, mean = np.array(expected).T
    error = np.std(steps - mean, ddof=1) / np.sqrt(len(steps))
    assert curve["expected"] == expected[0][1]
    assert abs(steps.mean() - mean.mean()) < 4 * error


def test_a_searchs_regions_are_those_of_the_planners(tmp_path):
    prior = np.zeros((8, 10))
    prior[:, 5:] = 1.0  # flat where the target can be, and so no hill
    np.save(tmp_path / "flat.npy", prior)
    campaign = Campaign(planners=("index",), trials=1, cap=5, **load_prior(tmp_path / "flat.npy"))
    (search,) = run_job(campaign, Job(SEARCH, "index", "point", 0))
    assert (search["regions"], search["in_region"]) == (0, False)


def test_what_is_undetected_at_the_end_counts_as_never_detected():
    campaign = replace(SMALL, trials=0, curves=1, tail=0.2, p_tn=1.0)
    (short,) = run_job(campaign, Job(CURVE, "index", "point", 0))
    (long,) = run_job(replace(campaign, tail=1e-6), Job(CURVE, "index", "point", 0))
    assert 0.0 < short["left"] < 0.2
    assert short["steps"] < long["steps"]
    assert short["expected"] > long["expected"]
    assert short["curve"][-1] == pytest.approx(1.0 - short["left"])


def test_the_summary_of_a_hand_made_campaign():
    campaign = Campaign(planners=("puct",), trials=4, curves=1, cap=100, shape=(10, 10), preset="paper")
    curve = np.minimum(np.array(grid(100)) / 50, 1.0)
    results = {}
    for trial, (steps, found, bound) in enumerate(
        [(10, 1, 10.0), (20, 1, 20.0), (30, 1, 20.0), (100, 0, 30.0)]
    ):
        results[Job(SEARCH, "puct", "point", trial)] = {
            "trial": trial, "fov": "point", "steps": steps, "found": bool(found), "seen": 0.1 * trial,
            "in_region": trial < 3, "timing": {"plan_ms": float(trial), "slowest_ms": 10.0 + trial},
        }  # fmt: skip
        results[Job(BOUND, "", "point", trial)] = {
            "trial": trial, "fov": "point", "expected": bound, "teleport": 5.0, "curve": curve.tolist(),
        }  # fmt: skip
    results[Job(CURVE, "puct", "point", 0)] = {
        "trial": 0, "fov": "point", "expected": 15.0, "left": 0.0, "curve": (curve / 2).tolist(),
        "timing": {"plan_ms": 1.0, "slowest_ms": 1.0},
    }  # fmt: skip
    summary = summarise(campaign, results)
    (row,) = summary["scenarios"]
    assert (row["sampled"]["trials"], row["sampled"]["found"]) == (4, 3)
    assert row["sampled"]["steps"]["mean"] == 40.0
    assert row["sampled"]["steps"]["p50"] == 25.0
    assert row["sampled"]["above_bound"] == pytest.approx(1.0)  # 40 against 20
    assert row["sampled"]["seen_median"] == pytest.approx(0.15)
    assert row["sampled"]["outside_regions"] == 0.25
    assert row["sampled"]["outside_regions_slowest"] == 1.0
    assert row["curve"]["above_bound"] == pytest.approx(0.5)  # 15 against 10, the bound of the same prior
    assert row["time_per_step_ms"]["p50"] == 1.5
    assert row["time_per_step_ms"]["slowest"] == 13.0
    assert summary["bounds"]["point"]["expected"] == 20.0
    assert summary["bounds"]["point"]["curve"]["expected"] == 10.0


def test_percentiles_and_the_ratio_of_means_by_hand():
    assert percentiles(range(101)) == {"p5": 5.0, "p25": 25.0, "p50": 50.0, "p75": 75.0, "p95": 95.0}
    above, error = ratio(np.array([2.0, 4.0, 6.0]), np.array([1.0, 2.0, 3.0]))
    assert (above, error) == (1.0, 0.0)
    above, error = ratio(np.array([1.0, 3.0]), np.array([1.0, 1.0]))
    assert above == 1.0
    assert error == pytest.approx(1.0)


def test_claims_are_weighed_only_for_the_papers_preset_and_judge_the_numbers():
    planners = ("puct-regions-lite", "puct-regions", "puct")
    campaign = Campaign(planners=planners, trials=4, cap=1000, preset="paper")
    steps = {
        "puct-regions-lite": (161,) * 4,
        "puct-regions": (100,) * 4,
        "puct": (400,) * 4,
    }
    results = {
        Job(SEARCH, planner, "point", trial): {
            "trial": trial,
            "fov": "point",
            "steps": taken,
            "found": True,
            "seen": 0.0596,
            "in_region": True,
            "timing": {"plan_ms": 1.0, "slowest_ms": 1.0},
        }
        for planner, all_taken in steps.items()
        for trial, taken in enumerate(all_taken)
    }
    claims = {claim.said: claim for claim in weigh(campaign, results, summarise(campaign, results))}
    more = next(claim for said, claim in claims.items() if "61 % more steps" in said)
    assert more.verdict == "holds"
    assert more.measured == "+61% (161 against 100; 95 % interval +61% to +61%)"
    cheaper = next(claim for said, claim in claims.items() if "57 % less time" in said)
    assert cheaper.verdict == "does not hold"
    assert weigh(replace(campaign, preset="default"), results, summarise(campaign, results)) == []


def test_the_bound_of_a_covered_search_is_that_of_a_perfect_detector():
    campaign = replace(SMALL, found="covered")
    (bound,) = run_job(campaign, Job(BOUND, "", "point", 0))
    prior = campaign.scenario(0).prior
    perfect = bounds.release(prior, campaign.start, 1.0, campaign.cap)
    assert bound["expected"] == pytest.approx(bounds.expected_time(perfect), abs=1e-6)
    assert "reference" not in bound


def test_published_numbers_are_found_whatever_is_asked_of_a_planner():
    assert published.time_per_step("puct@paper:iterations=40") == published.TIME_PER_STEP_MS["puct"]
    assert published.time_per_step("index") is None
    assert published.shown("puct-regions-lite@paper") == "PUCT Regions Lite @paper"


@pytest.mark.parametrize("planner", ["puct-regions-lite@paper", "index"])
def test_a_deadline_bounds_a_decision_instead_of_iterations(planner):
    campaign = replace(SMALL, planners=(planner,), trials=1, cap=20, deadline_s=0.002)
    assert not campaign.deterministic
    (result,) = run_job(campaign, Job(SEARCH, planner, "point", 0))
    assert 1 <= result["steps"] <= 20
    if "paper" in planner:
        assert campaign.planner(planner, "point", None).settings.iterations is None
