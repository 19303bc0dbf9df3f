"""How far the planner is from the best there is, after a target that walks, on maps where that is known.

The expected time to the first detection, restricted to the flight, beside that of the best flight of all
(`roisearch.bounds.best_flight`): the same map, start, steps and walk, four neighbours, no time for turns. The planner
is the default in seconds, that of every flight with a point field of view.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from rich.console import Console

from roisearch import FieldOfView
from roisearch.bounds import Hunt, best_flight
from roisearch.planners.tour.planner import TourPlanner
from sim.ruler_walking import Chase, chase
from sim.trials.flight import P_TP
from sim.trials.summary import ratio
from sim.trials.walking import KNOWS, STILL, WalkingCampaign

SHAPES = ((3, 3), (3, 4))
STEPS = 20
"""How long the flights are; by then about nine in ten targets are found."""
AIM = 0.05


def small_prior(seed: int, shape: tuple[int, int]) -> NDArray[np.float64]:
    """An uneven prior, float [rows, cols] that sums to 1: squares of random numbers."""
    prior = np.random.default_rng(seed).random(shape) ** 2
    normalised: NDArray[np.float64] = prior / prior.sum()
    return normalised


def expected_and_best(
    campaign: WalkingCampaign, shape: tuple[int, int], seed: int, ways: tuple[str, ...] = (KNOWS, STILL)
) -> list[float]:
    """Expected seconds of each way, and last the least of any flight, over one map."""
    motion = replace(campaign.motion(), diagonal=False)
    step_s = motion.cell_m / motion.speed_mps
    prior, until = small_prior(seed, shape), STEPS * step_s
    expected = []
    for way in ways:
        how = Chase(campaign.walk(), motion, p_tp=P_TP, until_s=until, believes=way == KNOWS)
        planner = TourPlanner(fov=FieldOfView.point(P_TP, 1.0), motion=motion)
        flown = chase(planner, prior, np.random.default_rng((seed, 1)), how)
        expected.append(flown.expected(until))
    hunt = Hunt(campaign.walk(), p_tp=P_TP, step_s=step_s, until_s=until, diagonal=False)
    return [*expected, until - best_flight(prior, hunt, counts="seconds").most]


def print_gaps(campaign: WalkingCampaign, console: Console) -> int:
    """Say how far the planner is above the optimum on each kind of map; 0 when the aim is met, else 1."""
    missed = False
    for shape in SHAPES:
        seeds = range(campaign.seed, campaign.seed + campaign.trials)
        table = np.array([expected_and_best(campaign, shape, seed) for seed in seeds])
        (knows, error), (still, other) = (ratio(table[:, i], table[:, 2]) for i in (0, 1))
        worst = float((table[:, 0] / table[:, 2]).max() - 1.0)
        missed |= knows > AIM
        console.print(
            f"{shape[0]} x {shape[1]} cells, {STEPS} looks, {campaign.trials} priors from seed {campaign.seed}: "
            f"the best flight takes {table[:, 2].mean():.2f} s; {KNOWS} {knows:+.1%} ± {100 * error:.1f} "
            f"(worst {worst:+.1%}), {STILL} {still:+.1%} ± {100 * other:.1f}; "
            f"at most {AIM:.0%}: {'MISSED' if knows > AIM else 'met'}",
            highlight=False, soft_wrap=True,
        )  # fmt: skip
    return 1 if missed else 0
