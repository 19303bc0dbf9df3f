"""A campaign says how long it will take as soon as it can know."""

from __future__ import annotations

from sim.trials.campaign import BOUND, CURVE, SEARCH, Campaign, Job
from sim.trials.forecast import Forecast

CAMPAIGN = Campaign(planners=("index", "greedy"), trials=20, curves=10)
SECONDS = {
    (BOUND, ""): 1.0,
    (CURVE, "index"): 10.0,
    (CURVE, "greedy"): 30.0,
    (SEARCH, "index"): 2.0,
    (SEARCH, "greedy"): 4.0,
}


def took(job: Job, seconds: float = 0.0) -> list[dict[str, dict[str, float]]]:
    return [{"timing": {"seconds": seconds or SECONDS[job.kind, job.planner]}}]


def test_it_is_told_once_when_each_kind_of_job_has_been_seen_and_weighs_each_by_its_own_time() -> None:
    jobs = CAMPAIGN.jobs()
    forecast = Forecast(jobs, workers=2)
    told = [forecast.done(job, took(job)) for job in jobs]
    assert all(each is None for each in told[:4])
    (said,) = [each for each in told if each]
    left = sum(SECONDS[job.kind, job.planner] for job in jobs[told.index(said) + 1 :]) / 2
    assert said.startswith(f"about {round(left / 60)} min to go")


def test_a_campaign_that_is_done_with_its_first_jobs_has_nothing_to_tell() -> None:
    jobs = [Job(SEARCH, "index", "point", 0)]
    assert Forecast(jobs, 1).done(jobs[0], took(jobs[0])) is None


def test_what_was_done_before_counts_for_nothing() -> None:
    jobs = [job for job in CAMPAIGN.jobs() if job.trial >= 15]
    forecast = Forecast(jobs, workers=1)
    said = next(each for job in jobs if (each := forecast.done(job, took(job))))
    assert said.startswith("about 28 s to go")
