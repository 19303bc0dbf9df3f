"""A target that walks: what it is worth that the planner knows, beside the same planner that takes it as still.

Priors are the paper's, the aircraft starts in their north-west corner, and every *way* to search is flown over each
of them by the exact ruler (`sim.ruler_walking`):

- `knows`: the default planner on a belief that walks as the target does;
- `still`: the same planner on a belief that never moves;
- `survey`: the lanes that find a still target soonest, again and again;
- `teleport`: looks without ways between them, each where most is undetected. Nobody can fly that: it says how much
  there is to gain.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from roisearch import FieldOfView, Motion, Walk, make_planner
from roisearch.planners.base import Planner
from sim.ruler_walking import Chase, chase, teleported
from sim.scenario import paper_prior
from sim.trials.campaign import Job
from sim.trials.flight import CELL_M, HELD_OUT, P_TP, SPEED_MPS

WALKING = "walking"
KNOWS, STILL, SURVEY, TELEPORT = "knows", "still", "survey", "teleport"
WAYS = (KNOWS, STILL, SURVEY, TELEPORT)
POINTS = 121
"""Points at which a detection curve is kept, the beginning and the end among them."""
FIRST_S = 3600.0
"""The expected time is told restricted to this as well: what is searched for longer is another question."""


@dataclass(frozen=True)
class WalkingCampaign:
    """All that decides the numbers.

    Attributes:
        planners: of `WAYS`. minutes: of the batteries. hours: for how long each flight goes on in all.
        target_mps: how fast the target walks. straight_s: mean seconds between its turns. stops_per_hour: see `Walk`.
        trials: priors; seed: the first of them. side: rows, and columns, of a prior.
        stride: cells that are flown for a decision.
    """

    planners: tuple[str, ...] = WAYS
    minutes: tuple[float, ...] = (15.0, 25.0)
    hours: float = 8.0
    target_mps: float = 0.5
    straight_s: float = 60.0
    stops_per_hour: float = 0.0
    trials: int = 20
    seed: int = HELD_OUT
    side: int = 40
    stride: int = 3

    def __post_init__(self) -> None:
        unknown = [each for each in self.planners if each not in WAYS]
        if unknown or not self.planners:
            raise ValueError(f"ways to search are {', '.join(WAYS)}, not '{', '.join(unknown)}'")
        if not 0.0 < self.hours <= 24.0:
            raise ValueError(f"a flight lasts above 0 and at most 24 hours, not {self.hours}")
        if not self.minutes or not all(0.0 < each <= 60.0 * self.hours for each in self.minutes):
            raise ValueError(f"batteries end within the flight, after {60.0 * self.hours:g} minutes at most")
        if self.trials < 1 or self.stride < 1 or self.side < 2:
            raise ValueError(
                "a campaign needs a trial or more, a stride of 1 or more, and 2 cells a side or more"
            )
        self.walk()

    def to_dict(self) -> dict[str, Any]:
        """The settings as plain JSON values."""
        told = {
            key: list(value) if isinstance(value, tuple) else value for key, value in asdict(self).items()
        }
        return {"preset": WALKING, **told}

    def search_of(self, job: Job) -> Job | None:
        """No result comes with another's."""
        return None

    def jobs(self) -> list[Job]:
        """Every job, prior by prior, so that an interrupted campaign holds whole comparisons."""
        return [
            Job(WALKING, way, "point", trial)
            for trial in range(self.seed, self.seed + self.trials)
            for way in self.planners
        ]

    def walk(self) -> Walk:
        """The target."""
        return Walk(self.target_mps, CELL_M, straight_s=self.straight_s, stops_per_hour=self.stops_per_hour)

    def motion(self) -> Motion:
        """The aircraft: at full speed at once, as the ruler has it."""
        return Motion(cell_m=CELL_M, speed_mps=SPEED_MPS, acceleration_mps2=float("inf"))

    def planner(self, way: str) -> Planner:
        """A new planner."""
        name = "survey" if way == SURVEY else "puct-regions-lite"
        return make_planner(name, fov=FieldOfView.point(P_TP, 1.0), motion=self.motion())


def run_walking(campaign: WalkingCampaign, job: Job) -> list[dict[str, Any]]:
    """Do one job; its result is made of plain values, the time it took under "timing"."""
    began = time.thread_time()
    until = 3600.0 * campaign.hours
    prior = paper_prior(np.random.default_rng(job.trial), (campaign.side, campaign.side))
    how = Chase(campaign.walk(), campaign.motion(), p_tp=P_TP, until_s=until, believes=job.planner == KNOWS)
    if job.planner == TELEPORT:
        flown = teleported(prior, how)
    else:
        rng = np.random.default_rng((job.trial, 1))
        flown = chase(campaign.planner(job.planner), prior, rng, how, stride=campaign.stride)
    result = {
        "kind": job.kind, "planner": job.planner, "fov": job.fov, "trial": job.trial,
        "expected": flown.expected(until),
        "first": flown.expected(min(until, FIRST_S)),
        "end": flown.at(until),
        "found": [flown.at(60.0 * each) for each in campaign.minutes],
        "curve": [flown.at(each) for each in np.linspace(0.0, until, POINTS)],
    }  # fmt: skip
    return [result | {"timing": {"seconds": time.thread_time() - began}}]


def warm_up(campaign: WalkingCampaign, progress: Callable[[str], None]) -> None:
    """Compile what the planners need."""
    for way in set(campaign.planners) - {TELEPORT}:
        progress(way)
        campaign.planner(way).warm_up()
