"""What one battery finds: the default, cut off where the way home must begin, beside the default that plans its end.

A scene is that of the flights in seconds (`sim.trials.flight`), with the launch point where it starts. One job flies
one of both over one seed's scene, for every battery: what is cut off flies the longest, and is cut at each.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from roisearch import FieldOfView, Motion, make_planner
from roisearch.planners.ending import EndingPlanner
from roisearch.planners.ending.settings import EndingSettings
from sim.ruler_battery import Battery, BatteryWorld, Sortie, cut, fly_battery
from sim.trials.campaign import Job
from sim.trials.flight import CELL_M, HELD_OUT, P_TP, SCENES, SPEED_MPS, Scene, scene_of

BATTERY = "battery"
CUT, PLANNED = "cut off", "planned"
ACCELERATION_MPS2 = 1.5


@dataclass(frozen=True)
class BatteryCampaign:
    """All that decides the numbers.

    Attributes:
        scenes: of those of the flights in seconds. minutes: of the batteries, the way home included.
        p_tn: of the detector. landing_s: what climbing to the height of the return and landing take, seconds.
        horizon_s: when the end begins, seconds.
        trials: seeds; seed: the first of them. side: rows, and columns, of the paper's priors.
    """

    scenes: tuple[str, ...] = ("uniform", "trail", "mass")
    minutes: tuple[float, ...] = (15.0, 25.0)
    p_tn: float = 1.0
    landing_s: float = 45.0
    horizon_s: float = EndingSettings.horizon_s
    trials: int = 20
    seed: int = HELD_OUT
    side: int = 60

    def __post_init__(self) -> None:
        unknown = [each for each in self.scenes if each not in SCENES]
        if unknown or not self.scenes:
            raise ValueError(f"scenes of flights are {', '.join(SCENES)}, not '{', '.join(unknown)}'")
        if not self.minutes or not all(60.0 * each > 2.0 * self.landing_s for each in self.minutes):
            raise ValueError(f"a battery lasts longer than two landings, {2.0 * self.landing_s:g} s")
        if self.trials < 1 or self.side < 20:
            raise ValueError("a campaign needs at least one trial, and 20 cells on a side")

    def to_dict(self) -> dict[str, Any]:
        """The settings as plain JSON values."""
        told = {
            key: list(value) if isinstance(value, tuple) else value for key, value in asdict(self).items()
        }
        return {"preset": BATTERY, "planners": [CUT, PLANNED], **told}

    def search_of(self, job: Job) -> Job | None:
        """No result comes with another's."""
        return None

    def jobs(self) -> list[Job]:
        """Every job, seed by seed, so that an interrupted campaign holds whole comparisons."""
        return [
            Job(BATTERY, planner, scene, trial)
            for trial in range(self.seed, self.seed + self.trials)
            for scene in self.scenes
            for planner in (CUT, PLANNED)
        ]

    def fov(self) -> FieldOfView:
        """What the aircraft sees: the cell that it is over."""
        return FieldOfView.point(P_TP, self.p_tn)

    def motion(self) -> Motion:
        """The aircraft."""
        return Motion(cell_m=CELL_M, speed_mps=SPEED_MPS, acceleration_mps2=ACCELERATION_MPS2)

    def planner(self, scene: Scene, name: str) -> Any:
        """A new planner for a scene."""
        options = {} if scene.flyable is None else {"flyable": scene.flyable}
        default = make_planner("puct-regions-lite", fov=self.fov(), motion=self.motion(), **options)
        if name == CUT:
            return default
        settings = EndingSettings(horizon_s=self.horizon_s)
        return EndingPlanner(default, fov=self.fov(), motion=self.motion(), settings=settings, **options)


def run_battery(campaign: BatteryCampaign, job: Job) -> list[dict[str, Any]]:
    """Do one job; its result is made of plain values, the time it took under "timing"."""
    began = time.thread_time()
    scene = scene_of(job.fov, job.trial, campaign.side)
    world = BatteryWorld(scene.prior, campaign.fov(), campaign.motion())
    batteries = [Battery(60.0 * each, scene.start, campaign.landing_s) for each in campaign.minutes]

    def flown(battery: Battery) -> Sortie:
        rng = np.random.default_rng((job.trial, 1))
        return fly_battery(campaign.planner(scene, job.planner), world, battery, rng)

    if job.planner == CUT:
        path = [(row, col) for row, col in flown(max(batteries, key=lambda each: each.seconds)).path.tolist()]
        sorties = [cut(path, world, battery) for battery in batteries]
    else:
        sorties = [flown(battery) for battery in batteries]
    result = {"kind": BATTERY, "planner": job.planner, "fov": job.fov, "trial": job.trial,
              "batteries": [_told(*each) for each in zip(sorties, batteries, strict=True)]}  # fmt: skip
    return [result | {"timing": {"seconds": time.thread_time() - began}}]


def _told(sortie: Sortie, battery: Battery) -> dict[str, float]:
    last = float(sortie.times[-1]) if sortie.times.size else 0.0
    mean = float(sortie.times @ sortie.found) + (1.0 - sortie.pos) * battery.seconds
    return {"pos": sortie.pos, "with_home": sortie.pos + sortie.homeward, "mean_s": mean, "searched_s": last}


def warm_up(campaign: BatteryCampaign, progress: Callable[[str], None]) -> None:
    """Compile what the planners need."""
    progress(PLANNED)
    campaign.planner(Scene(np.ones((20, 20)), None, (0, 0)), PLANNED).warm_up()
