"""How near the default comes to what no walk can beat: whole searches in steps beside the bound that counts travel.

A prior is the paper's, of 200 x 200 cells; how many hills it has, its seed decides. One job searches one prior with the
default and works the bound out, of which the walk just flown tells how far it needs to go.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from roisearch import FieldOfView, make_planner
from roisearch.bounds import expected_time, travel
from sim.ruler import Ruler, detection_curve
from sim.scenario import EQUAL, PAPER_SHAPE, PAPER_START, paper_prior
from sim.trials.campaign import Job
from sim.trials.flight import HELD_OUT, P_TP

PROVEN = "proven"
DEFAULT = "puct-regions-lite"
STEPS = {1: 1200, 2: 2000, 3: 2500, 4: 3000, 5: 3000}
"""How long is searched, by the hills there are: until little of them is left."""


@dataclass(frozen=True)
class ProvenCampaign:
    """All that decides the numbers.

    Attributes:
        equal: what the hills have in common, see `paper_prior`.
        divisions: how often the worst class of walks is divided; more is tighter.
        trials: priors; seed: the first of them. side: rows, and columns.
    """

    equal: str = "mass"
    divisions: int = 16
    trials: int = 12
    seed: int = HELD_OUT
    side: int = PAPER_SHAPE[0]

    def __post_init__(self) -> None:
        if self.equal not in EQUAL:
            raise ValueError(f"--equal is one of {', '.join(EQUAL)}, not '{self.equal}'")
        if self.trials < 1 or self.side < 20 or self.divisions < 0:
            raise ValueError("a campaign needs a trial, 20 cells on a side, and 0 divisions or more")

    def to_dict(self) -> dict[str, Any]:
        """The settings as plain JSON values."""
        return {"preset": PROVEN, "planners": [DEFAULT], **asdict(self)}

    def search_of(self, job: Job) -> Job | None:
        """No result comes with another's."""
        return None

    def jobs(self) -> list[Job]:
        """A prior each."""
        return [Job(PROVEN, DEFAULT, "point", trial) for trial in range(self.seed, self.seed + self.trials)]


def hills_of(seed: int) -> int:
    """How many hills the paper's prior of a seed has: the first that `paper_prior` draws."""
    return int(np.random.default_rng(seed).integers(1, 6))


def run_proven(campaign: ProvenCampaign, job: Job) -> list[dict[str, Any]]:
    """Do one job; its result is made of plain values, the time it took under "timing"."""
    began = time.thread_time()
    hills, view = hills_of(job.trial), FieldOfView.point(P_TP)
    shape = (campaign.side, campaign.side)
    prior = paper_prior(np.random.default_rng(job.trial), shape, equal=campaign.equal)
    steps = STEPS[hills]
    curve = detection_curve(
        make_planner(DEFAULT, fov=view), prior, PAPER_START, steps, Ruler(P_TP, fov=view, follow=True),
        np.random.default_rng((job.trial, 1)),
    )  # fmt: skip
    flown, flown_s = expected_time(curve), time.thread_time() - began
    bound = travel(prior, PAPER_START, P_TP, steps, divisions=campaign.divisions, known=flown)
    result = {
        "kind": PROVEN, "planner": DEFAULT, "fov": job.fov, "trial": job.trial, "hills": hills, "steps": steps,
        "flown": flown, "release": bound.release, "proven": bound.expected, "pos": float(curve[-1]),
    }  # fmt: skip
    return [result | {"timing": {"flown_s": flown_s, "bound_s": time.thread_time() - began - flown_s}}]


def warm_up(progress: Callable[[str], None]) -> None:
    """Compile what the planner needs."""
    progress(DEFAULT)
    make_planner(DEFAULT, fov=FieldOfView.point(P_TP)).warm_up()
