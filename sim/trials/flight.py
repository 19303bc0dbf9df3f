"""Flights in seconds: planners over areas and priors, false alarms and aircraft, each by the same exact ruler.

A *scene* is an area with its prior, anew for each seed: a uniform square and a uniform L, with the start drawn over the
area; a trail, along which a lost walker is; and the paper's priors in three families. One job flies one planner over
one seed's scene with one p_tn, and times it for every aircraft: a planner that knows no motion flies the same cells
with any, one that plans by it flies for each. See `sim.ruler_seconds` for what is measured.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from roisearch import FieldOfView, Motion, Planner, bounds, make_planner
from roisearch.decision import Cell
from sim.ruler_seconds import How, TimedFlight, fly
from sim.scenario import PAPER_START, paper_prior, trail_prior
from sim.trials.campaign import Job

FLIGHT, LEAST = "flight", "least"
IN_STEPS = "default-in-steps"
DEFAULT = "default"
PLANNERS = ("survey", "coverage", "index", "spiral", IN_STEPS, DEFAULT)
BY_MOTION = ("survey", DEFAULT)
"""The planners that plan by the motion."""
SCENES = ("uniform", "L", "trail", "height", "mass", "drawn")
PAPER = {"height": "height", "mass": "mass", "drawn": "neither"}
"""Those of `SCENES` that are the paper's, and what their Gaussians have in common."""
SHARES = (0.5, 0.75, 0.9)
HELD_OUT = 5000
"""The first of the seeds that nothing was developed on; development took those from 1000 on."""
CELL_M, SPEED_MPS, P_TP = 25.0, 8.0, 0.9
MINUTES = {"uniform": 100, "L": 100, "trail": 100, "height": 600, "mass": 600, "drawn": 600}
"""Where the mean of min(T, cap) is cut, in minutes of flight: ten times what the search takes, or more."""
PROVEN = ("uniform", "L")
"""The scenes for which the bound that counts travel is reckoned: with the paper's priors it takes too long."""
MORE = 4
"""One in fifty of what follows a first true hit takes half an hour, and decides the mean: with 640 of them over the
areas its standard error is as large as what is to be judged there."""
POINTS = 200


@dataclass(frozen=True)
class FlightCampaign:
    """All that decides the numbers.

    Attributes:
        planners: of `PLANNERS`. scenes: of `SCENES`.
        p_tns: for the areas and the trail; the paper's priors are flown with the first only.
        accelerations: of the aircraft, m/s2.
        trials: seeds; seed: the first of them.
        slow: seeds over which the default in steps, which takes longest, flies the areas and the trail, and for which
            the bound that counts travel is reckoned.
        side: rows, and columns, of the paper's priors.
        sequels: flights from a first true hit until FOUND, in each flight with false alarms; over the areas
            `MORE` times as many.
        stop_below: a flight ends when less than this is undetected, the rest counts as found at the cap.
    """

    planners: tuple[str, ...] = PLANNERS
    scenes: tuple[str, ...] = SCENES
    p_tns: tuple[float, ...] = (1.0, 0.99, 0.9)
    accelerations: tuple[float, ...] = (1.5, 3.0)
    trials: int = 20
    seed: int = HELD_OUT
    slow: int = 5
    side: int = 100
    sequels: int = 32
    stop_below: float = 0.02

    def __post_init__(self) -> None:
        for name, known in (("planners", PLANNERS), ("scenes", SCENES)):
            unknown = [each for each in getattr(self, name) if each not in known]
            if unknown or not getattr(self, name):
                raise ValueError(f"{name} of flights are {', '.join(known)}, not '{', '.join(unknown)}'")
        if self.trials < 1:
            raise ValueError(f"a campaign needs at least one trial, not {self.trials}")
        if self.side < 20:
            raise ValueError(f"the paper's priors need at least 20 cells on a side, not {self.side}")

    def to_dict(self) -> dict[str, Any]:
        """The settings as plain JSON values."""
        return {"preset": "flight"} | {
            key: list(value) if isinstance(value, tuple) else value for key, value in asdict(self).items()
        }

    def search_of(self, job: Job) -> Job | None:
        """No result comes with another's."""
        return None

    def conditions(self) -> list[tuple[str, float]]:
        """The pairs of scene and p_tn, in the order of the report."""
        return [
            (scene, p_tn)
            for scene in self.scenes
            for p_tn in (self.p_tns[:1] if scene in PAPER else self.p_tns)
        ]

    def jobs(self) -> list[Job]:
        """Every job, seed by seed, so that an interrupted campaign holds whole comparisons."""
        jobs = []
        for trial in range(self.seed, self.seed + self.trials):
            jobs += [Job(LEAST, "", scene, trial) for scene in self.scenes]
            for scene, p_tn in self.conditions():
                jobs += [
                    Job(FLIGHT, planner, f"{scene} {p_tn:g}", trial)
                    for planner in self.planners
                    if planner != IN_STEPS or scene in PAPER or trial < self.seed + self.slow
                ]
        return jobs

    def sequels_of(self, scene: str, p_tn: float) -> int:
        """How many are flown in each flight."""
        if p_tn >= 1.0:
            return 0
        return self.sequels * (MORE if scene in PROVEN else 1)

    @staticmethod
    def fov(p_tn: float) -> FieldOfView:
        """What the aircraft sees: the cell that it is over."""
        return FieldOfView.point(P_TP, p_tn)

    def motions(self) -> list[Motion]:
        """The aircraft."""
        return [
            Motion(cell_m=CELL_M, speed_mps=SPEED_MPS, acceleration_mps2=acceleration)
            for acceleration in self.accelerations
        ]


@dataclass(frozen=True, eq=False)
class Scene:
    """A prior, float [rows, cols], where the aircraft may fly (None: anywhere), and where it starts."""

    prior: NDArray[np.float64]
    flyable: NDArray[np.bool_] | None
    start: Cell


def scene_of(name: str, seed: int, side: int) -> Scene:
    """The scene of that name for one seed; `side`: of the paper's priors, in cells."""
    rng = np.random.default_rng(seed)
    if name in PAPER:
        return Scene(paper_prior(rng, (side, side), equal=PAPER[name]), None, PAPER_START)
    if name == "trail":
        return Scene(trail_prior(rng, (40, 40)), None, (0, 0))
    area = np.ones((21, 21) if name == "uniform" else (20, 20), dtype=bool)
    if name == "L":
        area[:10, 10:] = False
    cells = np.argwhere(area)
    row, col = cells[rng.integers(len(cells))]
    return Scene(area / area.sum(), None if area.all() else area, (int(row), int(col)))


def planner_of(name: str, fov: FieldOfView, motion: Motion, flyable: NDArray[np.bool_] | None) -> Planner:
    """A new planner by one of the names of `PLANNERS`."""
    options: dict[str, Any] = {} if flyable is None else {"flyable": flyable}
    if name in BY_MOTION:
        options["motion"] = motion
    return make_planner("puct-regions-lite" if name in (DEFAULT, IN_STEPS) else name, fov=fov, **options)


def run_flight(campaign: FlightCampaign, job: Job) -> list[dict[str, Any]]:
    """Do one job; its result is made of plain values, the time it took under "timing"."""
    began = time.thread_time()
    name, _, chance = job.fov.partition(" ")
    scene = scene_of(name, job.trial, campaign.side)
    work = _least if job.kind == LEAST else _flights
    result = {
        "kind": job.kind, "planner": job.planner, "fov": job.fov, "trial": job.trial,
        "aircraft": work(campaign, job, scene, float(chance or 1.0)),
    }  # fmt: skip
    return [result | {"timing": {"seconds": time.thread_time() - began}}]


def _least(campaign: FlightCampaign, job: Job, scene: Scene, p_tn: float) -> list[dict[str, Any]]:
    """The release bound in seconds, for each aircraft; of some scenes and seeds, the one that counts travel too."""
    proven = job.fov in PROVEN and job.trial < campaign.seed + campaign.slow
    cap, results = 60.0 * MINUTES[job.fov], []
    for motion in campaign.motions():
        times, found = bounds.release_seconds(scene.prior, scene.start, P_TP, motion, cap)
        reached = [float(times[np.argmax(found >= share)]) for share in SHARES]
        at = np.clip(np.searchsorted(times, grid(job.fov), side="right") - 1, 0, None)
        results.append(
            {
                "expected": bounds.expected_seconds(times, found, cap),
                "to": reached,
                "curve": found[at].tolist(),
                "proven": _proven(scene, motion, times, found, cap) if proven else None,
            }
        )
    return results


def _proven(
    scene: Scene, motion: Motion, times: NDArray[np.float64], found: NDArray[np.float64], cap: float
) -> float:
    """The bound that counts travel and turns, in seconds, of a scene that is one hill: it has nothing to divide.

    It is reckoned up to a third of the cap, when nearly everything is found; what is left then, the release bound says.
    """
    most = cap / 3.0
    bound = bounds.travel_seconds(
        scene.prior, scene.start, P_TP, motion, most, divisions=0, flyable=scene.flyable
    )
    later = bounds.expected_seconds(times, found, cap) - bounds.expected_seconds(times, found, most)
    return bound.expected + later


def _flights(campaign: FlightCampaign, job: Job, scene: Scene, p_tn: float) -> list[dict[str, Any]]:
    """What one planner does with each aircraft."""
    fov = campaign.fov(p_tn)
    how = How(
        start=scene.start, fov=fov, stop_below=campaign.stop_below,
        follow=job.planner in (DEFAULT, IN_STEPS), sequels=campaign.sequels_of(job.fov.split()[0], p_tn),
    )  # fmt: skip
    results: list[dict[str, Any]] = []
    flight: TimedFlight | None = None
    for motion in campaign.motions():
        again = flight is None or job.planner in BY_MOTION
        if again:
            planner = planner_of(job.planner, fov, motion, scene.flyable)
            rng = np.random.default_rng((job.trial, 1))
            flight = fly(planner, scene.prior, motion, rng, how)
        assert flight is not None
        timed = flight if again else flight.timed_by(motion, how)
        results.append(_told(timed, job.fov.split()[0]))
    return results


def _told(flight: TimedFlight, scene: str) -> dict[str, Any]:
    cap = 60.0 * MINUTES[scene]
    reached = [flight.time_to(share) for share in SHARES]
    total = np.concatenate([[0.0], np.cumsum(flight.found)])
    curve = total[np.searchsorted(flight.times, grid(scene), side="right")]
    return {
        "expected": flight.expected(cap),
        "until_found": flight.expected_found(cap),
        "after": [None if np.isinf(value) else round(value, 1) for value in flight.after],
        "wrong": sum(each.wrong for each in flight.sequels),
        "to": [None if np.isinf(value) else value for value in reached],
        "cells": len(flight.path),
        "curve": [round(float(value), 5) for value in curve],
    }


def grid(scene: str) -> NDArray[np.float64]:
    """The seconds at which curves are kept."""
    return np.concatenate([[0.0], np.geomspace(10.0, 60.0 * MINUTES[scene], POINTS)])


def warm_up(campaign: FlightCampaign, progress: Callable[[str], None]) -> None:
    """Compile what the planners need."""
    for name in campaign.planners:
        progress(name)
        planner_of(name, campaign.fov(0.9), campaign.motions()[0], None).warm_up()
