"""Several searchers on the paper's priors: how much sooner they find the target together, and beside which baselines.

All start in one corner, see one cell and take a second a step. A *way* to search together is flown with each number of
searchers over each prior, by the exact ruler (`sim.ruler_fleet`):

- `fleet`: `roisearch.Fleet`, which with one searcher is the plain default planner;
- `independent`: as many default planners on one belief, which see what all have looked at and know of no other;
- `strips`: the area cut into equal strips of rows, with a lawnmower in each, along the lanes that find it soonest;
- `bound`: `roisearch.bounds.release_together`, which none of them can beat.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from roisearch import Belief, FieldOfView, Fleet, Motion, SearchState, bounds, make_planner
from roisearch.decision import Cell
from roisearch.planners.lanes import lawnmowers
from roisearch.planners.ways import Ways, soonest
from sim.ruler_fleet import Aircraft, Decide, expected_of_first, fly_together
from sim.scenario import PAPER_START, paper_prior
from sim.trials.campaign import Job

FLEET, INDEPENDENT, STRIPS, BOUND = "fleet", "independent", "strips", "bound"
WAYS = (BOUND, FLEET, INDEPENDENT, STRIPS)
P_TP = 0.9
ALLOCATED_S = (0.0, 0.0, 0.0, 25.0, 50.0, 100.0, 200.0, 400.0)
"""When a fleet shares its search out anew: thrice before it sets out, and seldom later."""
FIRST = 5004
"""The first prior unless told; several searchers were developed looking at the four before it."""


@dataclass(frozen=True)
class FleetCampaign:
    """All that decides the numbers.

    Attributes:
        planners: of `WAYS`. searchers: how many search together, each a number of its own; one is always flown.
        trials: priors; seed: the first of them. side: rows and columns of a prior.
        slow: over so many of them those fly that know of no other, which takes longest: each searches all of it.
        stride: cells that are flown for a decision. iterations: of a decision.
        tail: what is undetected in the end, and left out of the means; see `sim.ruler_fleet`.
        most_s: seconds after which a flight ends in any case.
    """

    planners: tuple[str, ...] = WAYS
    searchers: tuple[int, ...] = (2, 3, 4)
    trials: int = 20
    seed: int = FIRST
    slow: int = 5
    side: int = 200
    stride: int = 4
    iterations: int = 4
    tail: float = 0.01
    most_s: float = 1_000_000.0

    def __post_init__(self) -> None:
        unknown = [each for each in self.planners if each not in WAYS]
        if unknown or not self.planners:
            raise ValueError(f"ways to search together are {', '.join(WAYS)}, not '{', '.join(unknown)}'")
        if not self.searchers or not all(1 <= each <= 16 for each in self.searchers):
            raise ValueError(f"--searchers takes numbers from 1 to 16, not {list(self.searchers)}")
        if self.trials < 1 or self.stride < 1 or self.side < 20:
            raise ValueError(
                "a campaign needs a trial or more, a stride of 1 or more, and 20 cells a side or more"
            )

    def to_dict(self) -> dict[str, Any]:
        """The settings as plain JSON values."""
        return {"preset": "fleet"} | {
            key: list(value) if isinstance(value, tuple) else value for key, value in asdict(self).items()
        }

    def search_of(self, job: Job) -> Job | None:
        """No result comes with another's."""
        return None

    def jobs(self) -> list[Job]:
        """Every job, prior by prior, so that an interrupted campaign holds whole comparisons."""
        alone = [(way, 1) for way in (BOUND, FLEET) if way in self.planners]
        together = [(way, n) for n in self.searchers if n > 1 for way in self.planners]
        return [
            Job("fleet", way, str(n), trial)
            for trial in range(self.seed, self.seed + self.trials)
            for way, n in alone + together
            if way != INDEPENDENT or trial < self.seed + self.slow
        ]


def run_fleet(campaign: FleetCampaign, job: Job) -> list[dict[str, Any]]:
    """Do one job; its result is made of plain values, the time it took under "timing"."""
    began = time.thread_time()
    count = int(job.fov)
    prior = paper_prior(np.random.default_rng(job.trial), (campaign.side, campaign.side))
    if job.planner == BOUND:
        expected, slowest = _bound(campaign, prior, count), 0.0
    else:
        pilot = _Pilot(campaign, job, prior, count)
        aircraft = [Aircraft(PAPER_START)] * count
        flights = fly_together(aircraft, prior, pilot.decide, tail=campaign.tail, most_s=campaign.most_s)
        expected, slowest = flights.expected(campaign.tail), pilot.percentile()
    result = {
        "kind": job.kind,
        "planner": job.planner,
        "fov": job.fov,
        "trial": job.trial,
        "expected": expected,
    }
    return [result | {"timing": {"seconds": time.thread_time() - began, "slowest_ms": slowest}}]


def _bound(campaign: FleetCampaign, prior: NDArray[np.float64], count: int) -> float:
    """What no `count` searchers beat on average."""
    steps = 1 + int(8 * prior.size / count)
    curve = bounds.release_together(prior, [bounds.Start(PAPER_START)] * count, P_TP, steps)
    return expected_of_first(np.arange(1.0, steps + 1.0), np.diff(curve), campaign.tail)


class _Pilot:
    """Decides for all searchers of a job, in its way."""

    def __init__(self, campaign: FleetCampaign, job: Job, prior: NDArray[np.float64], count: int) -> None:
        self._rng = np.random.default_rng((job.trial, 1))
        self._stride, self._took = campaign.stride, [0.0]
        fov = FieldOfView.point(P_TP, 1.0)
        options: dict[str, Any] = {"iterations": campaign.iterations}
        self._decide: Decide
        if job.planner == STRIPS:
            lanes = [strip_path(prior, i, count) for i in range(count)]
            self._stride = max(len(each) for each in lanes)
            self._decide = lambda i, belief, states, now: lanes[i]
        elif job.planner == INDEPENDENT:
            planners = [make_planner("puct-regions-lite", fov=fov, **options) for _ in range(count)]
            self._decide = lambda i, belief, states, now: planners[i].plan(belief, states[i], self._rng).path
        else:
            self._fleet, self._allocate_at = Fleet(size=count, **options), list(ALLOCATED_S)
            for i in range(count):
                self._fleet.join(str(i), fov=fov)
            self._decide = self._with_fleet

    def decide(self, i: int, belief: Belief, states: Sequence[SearchState], now: float) -> Sequence[Cell]:
        """See `sim.ruler_fleet.Decide`."""
        began = time.thread_time()
        cells = self._decide(i, belief, states, now)
        if now > 0.0:  # the first decision sets the map up
            self._took.append(time.thread_time() - began)
        return cells[: self._stride]

    def percentile(self) -> float:
        """What 99 of 100 decisions took at most, milliseconds of processor time."""
        return 1e3 * float(np.percentile(self._took, 99))

    def _with_fleet(
        self, i: int, belief: Belief, states: Sequence[SearchState], now: float
    ) -> Sequence[Cell]:
        """All are free at the same moments, so the first to decide then may share the search out for all."""
        while i == 0 and self._allocate_at and now >= self._allocate_at[0]:
            self._allocate_at.pop(0)
            everybody = {str(number): state for number, state in enumerate(states)}
            self._fleet.allocate(belief, everybody, self._rng, now_s=now)
        return self._fleet.plan(str(i), belief, states[i], self._rng, now_s=now).path


def strip_path(prior: NDArray[np.float64], number: int, count: int, passes: int = 4) -> list[Cell]:
    """From the start over strip `number` of `count` by a lawnmower, so many times one after the other."""
    shape = prior.shape
    strip, everywhere = np.zeros(shape, dtype=bool), np.ones(shape, dtype=bool)
    rows = np.linspace(0, shape[0], count + 1).round().astype(int)
    strip[rows[number] : rows[number + 1]] = True
    ways, motion = Ways(everywhere, False), Motion.steps()
    at, path = PAPER_START[0] * shape[1] + PAPER_START[1], []
    orders = lawnmowers(strip, everywhere)
    for _ in range(passes):
        order = soonest(orders, prior.ravel(), ways, motion, at)
        flown = ways.joined(at, order, 0)
        path += flown.tolist()
        at = path[-1]
    return [divmod(cell, shape[1]) for cell in path]
