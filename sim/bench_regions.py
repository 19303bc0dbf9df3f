"""What many regions cost a decision, and what bounding that choice costs the search; for `roisearch-sim bench`.

Hills lie on a lattice of one spacing, with heights drawn at random: five in the corner that the drone starts from, or
five hundred. So what is near is alike, and what differs is how many options there are.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from roisearch import Belief, FieldOfView, Planner, SearchState, make_planner, segment_regions
from sim.ruler import Ruler, detection_curve

FEW, MANY = 5, 500
SPACING, WIDTH = 18, 2.5
NAME = "puct-regions"
COST_AT_MOST, LOSS_AT_MOST = 1.3, 0.01
SEEDS = (1, 2, 3)
SEARCHED = 64
"""Hills of the searches in which the loss is measured."""
HORIZON = 4000
"""Steps over which the loss is measured: E[min(T, HORIZON)]; fewer where few decisions are asked for."""


def lattice(count: int, seed: int, most: int = MANY) -> NDArray[np.float64]:
    """Gaussian hills on a lattice, filled from one corner, of heights between a half and one and a half.

    The map is large enough for `most` of them.
    """
    side, filled = int(np.ceil(np.sqrt(most))), int(np.ceil(np.sqrt(count)))
    prior = np.zeros((side * SPACING, side * SPACING))
    down, right = np.mgrid[:SPACING, :SPACING] - SPACING // 2
    hill = np.exp(-(down**2 + right**2) / (2.0 * WIDTH**2))
    heights = np.random.default_rng(seed).uniform(0.5, 1.5, (side, side))
    for number in range(count):
        row, col = divmod(number, filled)
        square = np.s_[row * SPACING : (row + 1) * SPACING, col * SPACING : (col + 1) * SPACING]
        prior[square] = heights[row, col] * hill
    return np.asarray(prior / prior.sum())


def planner_for(prior: NDArray[np.float64], **options: object) -> Planner:
    """The planner with its regions."""
    regions = segment_regions(prior, searchable=prior > 0.0)
    return make_planner(NAME, fov=FieldOfView.point(0.9, 1.0), regions=regions, **options)


def cost(count: int, steps: int, **options: object) -> float:
    """Seconds of a decision among so many regions: the lower quartile, of processor time."""
    prior = lattice(count, 0)
    planner, belief = planner_for(prior, **options), Belief(prior)
    state, rng, took = SearchState((5, 5)), np.random.default_rng(1), []
    planner.plan(belief, state, rng)
    for _ in range(steps):
        began = time.thread_time()
        path = planner.plan(belief, state, rng).path
        took.append(time.thread_time() - began)
        state = SearchState(path[0], state.heading)
        belief.observe([path[0]], False, 0.9, 1.0)
    return float(np.percentile(took, 25))


def restricted(prior: NDArray[np.float64], horizon: int, **options: object) -> float:
    """E[min(T, horizon)] by the exact ruler, in steps."""
    ruler, rng = Ruler(0.9, 1.0, FieldOfView.point(0.9, 1.0)), np.random.default_rng(1)
    curve = detection_curve(planner_for(prior, **options), prior, (5, 5), horizon, ruler, rng)
    return float((1.0 - curve[:-1]).sum())


class Bounded(NamedTuple):
    """What bounding the choice gives and takes: the cost with many regions in that with few, bounded and not, and the
    relative loss of time, with its standard error over the priors."""

    cost: float
    unbounded: float
    loss: float
    error: float


def bounded_choice(steps: int, say: Callable[[str], None]) -> Bounded:
    """Measure it, and say it."""
    few, many = cost(FEW, steps), cost(MANY, steps)
    every = cost(MANY, max(20, steps // 10), most_regions=None)
    ratios, horizon = [], min(HORIZON, 40 * steps)
    for seed in SEEDS:
        prior = lattice(SEARCHED, seed, SEARCHED)
        ratios.append(restricted(prior, horizon) / restricted(prior, horizon, most_regions=None) - 1.0)
    error = float(np.std(ratios, ddof=1) / np.sqrt(len(ratios)))
    found = Bounded(many / few, every / few, float(np.mean(ratios)), error)
    say(
        f"{NAME}, {MANY} regions against {FEW}: a decision costs x {found.cost:.2f}, unbounded x {found.unbounded:.2f}"
    )
    say(
        f"{NAME}, {SEARCHED} regions on {len(SEEDS)} priors: bounded, E[min(T, {horizon})] is {found.loss:+.2%} ± "
        f"{found.error:.2%} of the unbounded"
    )
    return found
