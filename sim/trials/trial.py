"""One job: a search for a drawn target, the detection curve of a planner's path, or a bound.

A *search* draws a target from the prior and ends when it is found, or at the cap. A *curve* runs the planner as
if the target stayed undetected and adds up what each look would have detected: F(t), the distribution of the
detection time over all targets and true detections. False alarms are drawn in both, from the detector's generator;
in a curve every look can raise one, in a search a look at the target cannot. The two therefore agree exactly
without false alarms, and with them up to what false alarms at the target's own cell do.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from roisearch import Belief, SearchState, bounds, segment_regions
from roisearch.fov import HEADINGS, MOVES, FieldOfView
from sim.trials.campaign import BOUND, CURVE, SEARCH, Campaign, Job, Scenario
from sim.trials.world import Ground, Sight, Truth, View, look

LEVELS = (0.05, 0.25, 0.5, 0.75, 0.95)
GRID_POINTS = 240
_DRAWS = 2048
_REFERENCE_DRAWS = 2
_BOUND_STEPS = 4096
_HEADING_OF = {move: number for number, move in enumerate(MOVES)}
_warm: set[tuple[str, str]] = set()


def run_job(campaign: Campaign, job: Job) -> list[dict[str, Any]]:
    """Do one job; the results are made of plain values, the times they took under "timing".

    When being in view is being found, the path of a search is the beginning of the path of an undetected target:
    then a curve gives the search of the same trial as well, and there are two results.

    Raises:
        RuntimeError: when a planner makes a move that is none.
    """
    began = time.perf_counter()
    scenario = campaign.scenario(job.trial)
    if job.kind == BOUND:
        result = {**_head(job), **_bound(campaign, job, scenario)}
        return [{**result, "timing": {"seconds": time.perf_counter() - began}}]
    key = (job.planner.partition(":")[0], job.fov)
    if key not in _warm:
        campaign.warm_up(job.planner, job.fov)
        _warm.add(key)
        began = time.perf_counter()
    follow = job.kind == CURVE
    also = campaign.search_of(job)
    target = _draw_target(campaign, job, scenario) if also or not follow else -1
    run = _Run(campaign, job, scenario, target, follow)
    run.fly()
    results = []
    if follow:
        left = 1.0 - float(run.detected[-1])
        curve = {**describe(run.detected), "left": left, "steps": run.tally.steps}
        results.append({**_head(job), **curve, "timing": run.tally.timing(began)})
        job = also or job
    if job.kind == SEARCH:
        results.append({**_head(job), **_search(scenario, run, target), "timing": run.search.timing(began)})
    return results


def _head(job: Job) -> dict[str, Any]:
    return {"kind": job.kind, "planner": job.planner, "fov": job.fov, "trial": job.trial}


def _draw_target(campaign: Campaign, job: Job, scenario: Scenario) -> int:
    """A cell drawn from the prior, flat index."""
    edges = np.cumsum(scenario.prior.ravel())
    draw = campaign.rng(job.trial, 1).random() * edges[-1]
    return min(int(np.searchsorted(edges, draw, side="right")), edges.size - 1)


def _search(scenario: Scenario, run: _Run, target: int) -> dict[str, Any]:
    prior = scenario.prior
    regions = segment_regions(prior, searchable=prior > 0.0)
    return {
        "found": run.found,
        "steps": run.search.steps,
        "seen": run.search.cells / prior.size,
        "false_alarms": run.search.false_alarms,
        "target": [target // prior.shape[1], target % prior.shape[1]],
        "in_region": bool(regions.labels.ravel()[target] > 0),
        "regions": int(regions.count),
    }


def grid(cap: int) -> NDArray[np.int64]:
    """The steps at which detection curves are kept: 0, then evenly spaced in the logarithm up to `cap`."""
    return np.unique(np.concatenate([[0], np.round(np.geomspace(1, cap, GRID_POINTS))])).astype(np.int64)


@dataclass
class _Tally:
    """What a run has counted up to some step; `planning` and `slowest` in seconds of the processor."""

    steps: int = 0
    cells: int = 0
    false_alarms: int = 0
    planning: float = 0.0
    slowest: float = 0.0

    def timing(self, began: float) -> dict[str, float]:
        """The times as they are written down."""
        return {
            "seconds": time.perf_counter() - began,
            "plan_ms": 1e3 * self.planning / max(self.steps, 1),
            "slowest_ms": 1e3 * self.slowest,
        }


class _Run:
    """A planner on its way over one map.

    Args:
        target: flat index of the target's cell, or -1.
        follow: follow the curve of an undetected target; else end when the target is found.
    """

    def __init__(self, campaign: Campaign, job: Job, scenario: Scenario, target: int, follow: bool) -> None:
        self.campaign, self.job, self.scenario = campaign, job, scenario
        self.target, self.follow = target, follow
        self.tally = _Tally()  # of the curve when there is one
        self.search = _Tally()  # when the target was found, or at the cap
        self.found = False
        self.detected = np.zeros(campaign.cap + 1 if follow else 0)

    def fly(self) -> None:
        """Fly until the target is found and the curve followed to its tail, or to the cap."""
        campaign, job, now = self.campaign, self.job, _Tally()
        prior = self.scenario.prior
        fov = campaign.fov(job.fov)
        planner = campaign.planner(job.planner, job.fov, self.scenario.flyable)
        belief = Belief(prior)
        k = len(fov.p_tp)
        truth = Truth(self.target, campaign.found == "covered", self.follow)
        view, sight = View(fov.offsets, fov.p_tp, fov.p_tn), Sight.of(k)
        ground = Ground(np.array(prior, order="C"), np.zeros(prior.shape, dtype=np.bool_))
        noise, rng = campaign.rng(job.trial, 2), campaign.rng(job.trial, 3)
        draws, first = noise.random(_DRAWS * k), 0
        state = SearchState(campaign.start, HEADINGS[0])
        deadline = campaign.deadline_s
        following, left = self.follow, 1.0
        clock = time.thread_time  # planning is one thread; wall time would count the other workers
        while now.steps < campaign.cap:
            began = clock()
            decision = planner.plan(belief, state, rng, deadline_s=deadline)
            spent = clock() - began
            now.planning += spent
            now.slowest = max(now.slowest, spent)
            cell = decision.path[0]
            heading = self._heading(state.cell, cell)
            state = SearchState(cell, HEADINGS[heading])
            if first == draws.size:
                draws, first = noise.random(_DRAWS * k), 0
            count, found, gained, fresh, false = look(
                cell, heading, truth, view, draws[first : first + k], ground, sight
            )
            first += k
            now.steps += 1
            now.cells += fresh
            now.false_alarms += false
            left -= gained
            if found and not self.found:
                self.found = True
                self.search = replace(now)
                if not following:
                    break
            if following:
                self.detected[now.steps] = 1.0 - left
                if left < campaign.tail:
                    following = False
                    self._end_curve(now)
                    if self.found or self.target < 0:
                        break
            cells, hits, tp, tn = (part[:count] for part in sight)
            belief.observe(cells, hits, tp, tn)
        if following:
            self._end_curve(now)
        if not self.found:
            self.search = replace(now)

    def _end_curve(self, now: _Tally) -> None:
        """What is undetected now counts as never detected."""
        self.tally = replace(now)
        self.detected[now.steps :] = self.detected[now.steps]

    def _heading(self, here: tuple[int, int], there: tuple[int, int]) -> int:
        """The number of the move from `here` to `there`."""
        heading = _HEADING_OF.get((there[0] - here[0], there[1] - here[1]))
        rows, cols = self.scenario.prior.shape
        flyable = self.scenario.flyable
        if (
            heading is None
            or not (0 <= there[0] < rows and 0 <= there[1] < cols)
            or (flyable is not None and not flyable[there])
        ):
            raise RuntimeError(
                f"{self.job.planner} wants to go from {here} to {there}, which is no legal move"
            )
        return heading


def _bound(campaign: Campaign, job: Job, scenario: Scenario) -> dict[str, Any]:
    """What no searcher beats on this map, and the teleporting searchers beside it.

    With found = "covered" one look is enough, so the bounds are those of a perfect detector.
    """
    fov = campaign.fov(job.fov)
    p_tp = 1.0 if campaign.found == "covered" else float(fov.p_tp.max())
    looks = len(fov.p_tp)
    result = describe(_least(campaign, scenario, fov, p_tp))
    result["teleport"] = bounds.expected_time(
        bounds.teleport(scenario.prior, p_tp, campaign.cap, looks=looks)
    )
    if campaign.p_tn < 1.0 and campaign.found == "hit":
        reference = bounds.teleport_reference(
            scenario.prior, p_tp, campaign.p_tn, campaign.cap, campaign.rng(job.trial, 2), looks=looks,
            draws=_REFERENCE_DRAWS,
        )  # fmt: skip
        result["reference"] = describe(reference)
    return result


def _least(campaign: Campaign, scenario: Scenario, fov: FieldOfView, p_tp: float) -> NDArray[np.float64]:
    """The bound's curve up to the cap; once it has reached one but for rounding, it is taken as one."""
    steps = min(_BOUND_STEPS, campaign.cap)
    while True:
        if fov.is_point:
            curve = bounds.release(scenario.prior, campaign.start, p_tp, steps, flyable=scenario.flyable)
        else:
            curve = bounds.multi_cell(scenario.prior, campaign.start, fov, p_tp, steps)
        if steps == campaign.cap or curve[-1] > 1.0 - 1e-9:
            return np.concatenate([curve, np.ones(campaign.cap - steps)])
        steps = min(2 * steps, campaign.cap)


def describe(curve: NDArray[np.float64]) -> dict[str, Any]:
    """E[T] up to the cap, quantiles (None where F does not get there) and F on the grid, as plain values."""
    quantiles = bounds.quantiles(curve, LEVELS)
    return {
        "expected": bounds.expected_time(curve),
        "quantiles": [None if np.isinf(q) else float(q) for q in quantiles],
        "curve": curve[grid(curve.size - 1)].tolist(),
    }
