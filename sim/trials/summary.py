"""Counting: from the results of single jobs to one row a scenario (a planner with a field of view)."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim.trials.campaign import BOUND, CURVE, SEARCH, Campaign, Job
from sim.trials.trial import LEVELS, grid

PERCENTILES = ("p5", "p25", "p50", "p75", "p95")
Results = Mapping[Job, dict[str, Any]]


def summarise(campaign: Campaign, results: Results) -> dict[str, Any]:
    """The campaign in numbers.

    Searches that did not find the target have flown to the cap, and count so, in means and in percentiles.
    "above_bound" is the ratio of the mean steps (of E[T], for curves) to the mean E[T] of the bound over the same
    priors, less one: 0.12 is 12 % above the bound. Its standard error is that of a ratio of paired means.
    "bounds" has the mean over all priors and, under "curve", over those that have detection curves.
    """
    bounds = {(job.fov, job.trial): result for job, result in results.items() if job.kind == BOUND}
    scenarios = []
    for planner, fov in campaign.scenarios():
        mine = {job: r for job, r in results.items() if job.planner == planner and job.fov == fov}
        row: dict[str, Any] = {"planner": planner, "fov": fov}
        row["sampled"] = _sampled(_of(mine, SEARCH), bounds)
        row["curve"] = _curves(_of(mine, CURVE), bounds)
        row["time_per_step_ms"] = _times(_of(mine, SEARCH) or _of(mine, CURVE))
        if row["sampled"] or row["curve"]:
            scenarios.append(row)
    return {
        "campaign": campaign.to_dict(),
        "scenarios": scenarios,
        "bounds": {
            fov: _bounds([r for (of, _), r in bounds.items() if of == fov], campaign.curves)
            for fov in campaign.fovs
        },
        "grid": grid(campaign.cap).tolist(),
    }


def percentiles(values: Iterable[float]) -> dict[str, float]:
    """The five percentiles of the paper's figures and table, linear between values."""
    found = np.percentile(np.asarray(list(values), dtype=np.float64), [100 * level for level in LEVELS])
    return dict(zip(PERCENTILES, found.tolist(), strict=True))


def ratio(values: NDArray[np.float64], to: NDArray[np.float64]) -> tuple[float, float]:
    """Mean of `values` over mean of `to`, less one, and its standard error (pairs [n]; delta method)."""
    quotient = float(values.mean() / to.mean())
    if len(values) < 2:
        return quotient - 1.0, math.nan
    spread = float(np.std(values - quotient * to, ddof=1))
    return quotient - 1.0, spread / math.sqrt(len(values)) / float(to.mean())


def _of(results: Results, kind: str) -> list[dict[str, Any]]:
    rows = [result for job, result in results.items() if job.kind == kind]
    return sorted(rows, key=lambda row: int(row["trial"]))


def _above(
    rows: list[dict[str, Any]], key: str, bounds: Mapping[tuple[str, int], dict[str, Any]]
) -> dict[str, float | None]:
    """How far the mean of `key` is above the mean bound of the same priors, as far as those are known."""
    pairs = [
        (float(row[key]), float(bounds[row["fov"], row["trial"]]["expected"]))
        for row in rows
        if (row["fov"], row["trial"]) in bounds
    ]
    if not pairs:
        return {"above_bound": None, "above_bound_error": None}
    values, least = np.array(pairs).T
    above, error = ratio(values, least)
    return {"above_bound": above, "above_bound_error": None if math.isnan(error) else error}


def _sampled(
    rows: list[dict[str, Any]], bounds: Mapping[tuple[str, int], dict[str, Any]]
) -> dict[str, Any] | None:
    if not rows:
        return None
    steps = [float(row["steps"]) for row in rows]
    slow = [row for row in rows if row["steps"] >= np.percentile(steps, 95)]
    return {
        "trials": len(rows),
        "found": sum(row["found"] for row in rows),
        "steps": {**percentiles(steps), "mean": float(np.mean(steps))},
        "seen_median": float(np.median([row["seen"] for row in rows])),
        "outside_regions": float(np.mean([not row["in_region"] for row in rows])),
        "outside_regions_slowest": float(np.mean([not row["in_region"] for row in slow])),
        **_above(rows, "steps", bounds),
    }


def _curves(
    rows: list[dict[str, Any]], bounds: Mapping[tuple[str, int], dict[str, Any]]
) -> dict[str, Any] | None:
    if not rows:
        return None
    expected = np.array([row["expected"] for row in rows])
    return {
        "priors": len(rows),
        "expected": float(expected.mean()),
        "left_at_end": float(np.mean([row["left"] for row in rows])),
        "detected": np.mean([row["curve"] for row in rows], axis=0).tolist(),
        **_above(rows, "expected", bounds),
        **_reference(rows, bounds),
    }


def _reference(
    rows: list[dict[str, Any]], bounds: Mapping[tuple[str, int], dict[str, Any]]
) -> dict[str, float]:
    """How far E[T] is above the teleporting searcher that has the same false alarms; nothing without any."""
    pairs = [
        (float(row["expected"]), float(bounds[row["fov"], row["trial"]]["reference"]["expected"]))
        for row in rows
        if "reference" in bounds.get((row["fov"], row["trial"]), {})
    ]
    if not pairs:
        return {}
    values, reference = np.array(pairs).T
    return {"above_reference": ratio(values, reference)[0]}


def _times(rows: list[dict[str, Any]]) -> dict[str, float] | None:
    """Percentiles over searches (or curves) of the mean time that a step's planning took."""
    if not rows:
        return None
    slowest = max(float(row["timing"]["slowest_ms"]) for row in rows)
    return {**percentiles(row["timing"]["plan_ms"] for row in rows), "slowest": slowest}


def _bounds(rows: list[dict[str, Any]], curves: int) -> dict[str, Any] | None:
    if not rows:
        return None
    summary = _mean_bound(rows)
    followed = [row for row in rows if row["trial"] < curves]
    if followed:
        summary["curve"] = {
            **_mean_bound(followed),
            "detected": np.mean([row["curve"] for row in followed], axis=0).tolist(),
        }
        references = [row["reference"]["curve"] for row in followed if "reference" in row]
        if references:
            summary["curve"]["reference_detected"] = np.mean(references, axis=0).tolist()
    return summary


def _mean_bound(rows: list[dict[str, Any]]) -> dict[str, Any]:
    mean: dict[str, Any] = {
        "priors": len(rows),
        "expected": float(np.mean([row["expected"] for row in rows])),
        "teleport": float(np.mean([row["teleport"] for row in rows])),
    }
    references = [row["reference"]["expected"] for row in rows if "reference" in row]
    if references:
        mean["reference"] = float(np.mean(references))
    return mean
