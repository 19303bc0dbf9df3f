"""One job: a search for a drawn target, the detection curve of a planner's path, or a bound.

A *search* draws a target from the prior and ends when it is found, or at the cap. A *curve* runs the planner as
if the target stayed undetected and adds up what each look would have detected: F(t), the distribution of the
detection time over all targets and true detections. False alarms are drawn in both, from the detector's generator;
in a curve every look can raise one, in a search a look at the target cannot. The two therefore agree exactly
without false alarms, and with them up to what false alarms at the target's own cell do.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from roisearch import Belief, SearchState, bounds, segment_regions
from roisearch.fov import HEADINGS, MOVES, FieldOfView
from sim.trials.campaign import BOUND, CURVE, Campaign, Job, Scenario
from sim.trials.world import look

LEVELS = (0.05, 0.25, 0.5, 0.75, 0.95)
GRID_POINTS = 240
_DRAWS = 2048
_REFERENCE_DRAWS = 2
_BOUND_STEPS = 4096
_HEADING_OF = {move: number for number, move in enumerate(MOVES)}
_warm: set[tuple[str, str]] = set()


def run_job(campaign: Campaign, job: Job) -> dict[str, Any]:
    """Do one job; the result is made of plain values, the times it took under "timing".

    Raises:
        RuntimeError: when a planner makes a move that is none.
    """
    began = time.perf_counter()
    scenario = campaign.scenario(job.trial)
    head = {"kind": job.kind, "planner": job.planner, "fov": job.fov, "trial": job.trial}
    if job.kind == BOUND:
        result = _bound(campaign, job, scenario)
        return {**head, **result, "timing": {"seconds": time.perf_counter() - began}}
    key = (job.planner.partition(":")[0], job.fov)
    if key not in _warm:
        campaign.planner(job.planner, job.fov, None).warm_up()
        _warm.add(key)
    run = _Run(campaign, job, scenario)
    result = run.curve() if job.kind == CURVE else run.search()
    timing = {
        "seconds": time.perf_counter() - began,
        "plan_ms": 1e3 * run.planning / max(run.steps, 1),
        "slowest_ms": 1e3 * run.slowest,
    }
    return {**head, **result, "timing": timing}


def grid(cap: int) -> NDArray[np.int64]:
    """The steps at which detection curves are kept: 0, then evenly spaced in the logarithm up to `cap`."""
    return np.unique(np.concatenate([[0], np.round(np.geomspace(1, cap, GRID_POINTS))])).astype(np.int64)


class _Run:
    """A planner on its way over one map."""

    def __init__(self, campaign: Campaign, job: Job, scenario: Scenario) -> None:
        self.campaign, self.job, self.scenario = campaign, job, scenario
        self.steps, self.false_alarms = 0, 0
        self.planning, self.slowest = 0.0, 0.0
        self.cells = 0

    def search(self) -> dict[str, Any]:
        """Look for a drawn target until it is found or the cap is reached."""
        prior = self.scenario.prior
        edges = np.cumsum(prior.ravel())
        draw = self.campaign.rng(self.job.trial, 1).random() * edges[-1]
        target = min(int(np.searchsorted(edges, draw, side="right")), prior.size - 1)
        regions = segment_regions(prior)
        found, _ = self._fly(target, np.zeros(0))
        return {
            "found": found,
            "steps": self.steps,
            "seen": self.cells / prior.size,
            "false_alarms": self.false_alarms,
            "target": [target // prior.shape[1], target % prior.shape[1]],
            "in_region": bool(regions.labels.ravel()[target] > 0),
            "regions": int(regions.count),
        }

    def curve(self) -> dict[str, Any]:
        """Follow the path of an undetected target; what is undetected at the end counts as never detected."""
        detected = np.zeros(self.campaign.cap + 1)
        _, left = self._fly(-1, detected)
        detected[self.steps :] = detected[self.steps]
        return {**describe(detected), "left": left, "steps": self.steps}

    def _fly(self, target: int, detected: NDArray[np.float64]) -> tuple[bool, float]:
        """Fly until the target is found, the curve is followed to its tail, or the cap is reached.

        detected: float [cap + 1], filled with F, or empty. Returns whether the target was found, and the
        probability left undetected.
        """
        campaign, job = self.campaign, self.job
        prior = self.scenario.prior
        cols = prior.shape[1]
        fov = campaign.fov(job.fov)
        planner = campaign.planner(job.planner, job.fov, self.scenario.flyable)
        belief = Belief(prior)
        k = len(fov.p_tp)
        cells, hits = np.zeros((k, 2), dtype=np.int64), np.zeros(k, dtype=np.bool_)
        tp, tn = np.zeros(k), np.zeros(k)
        undetected = np.ascontiguousarray(prior).ravel().copy()
        seen = np.zeros(prior.size, dtype=np.bool_)
        noise, rng = campaign.rng(job.trial, 2), campaign.rng(job.trial, 3)
        draws, first = noise.random(_DRAWS * k), 0
        state = SearchState(campaign.start, HEADINGS[0])
        covered, deadline = campaign.found == "covered", campaign.deadline_s
        follow = detected.size > 0
        left = 1.0
        clock = time.perf_counter
        while self.steps < campaign.cap:
            began = clock()
            decision = planner.plan(belief, state, rng, deadline_s=deadline)
            spent = clock() - began
            self.planning += spent
            if spent > self.slowest:
                self.slowest = spent
            cell = decision.path[0]
            heading = self._heading(state.cell, cell)
            state = SearchState(cell, HEADINGS[heading])
            if first == draws.size:
                draws, first = noise.random(_DRAWS * k), 0
            count, found, gained, fresh, false = look(
                cell[0], cell[1], heading, target, covered, fov.offsets, fov.p_tp, fov.p_tn, draws, first,
                undetected, seen, cols, cells, hits, tp, tn,
            )  # fmt: skip
            first += k
            self.steps += 1
            self.cells += fresh
            self.false_alarms += false
            left -= gained
            if follow:
                detected[self.steps] = 1.0 - left
                if left < campaign.tail:
                    break
            elif found:
                return True, left
            belief.observe(cells[:count], hits[:count], tp[:count], tn[:count])
        return False, left

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
