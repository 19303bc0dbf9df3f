"""The pieces that the default planner works on, for a belief and a place, without the planner."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from roisearch import Belief, FieldOfView, Regions, segment_regions
from roisearch.ground import Ground
from roisearch.kernels.records import Pose
from roisearch.planners.lookahead import plans
from roisearch.planners.lookahead.chart import Chart, draw_up
from roisearch.planners.lookahead.desk import make_chart, make_rules, make_tree
from roisearch.planners.lookahead.settings import LookaheadSettings


@dataclass(frozen=True)
class Thought:
    """A plan by the rollout's rule from `pose`, its desk, and mass: float [rows, cols], all that can be seen."""

    settings: LookaheadSettings
    pose: Pose
    desk: plans.Desk
    tree: plans.PlanTree
    mass: NDArray[np.float64]

    @property
    def chart(self) -> Chart:
        return self.desk.chart

    @property
    def near(self) -> NDArray[np.float64]:
        """The rollout's score of a cell by its distance."""
        return self.desk.rules.nears[0]


def thought(
    weights: NDArray[np.float64],
    fov: FieldOfView,
    at: tuple[int, int],
    flyable: NDArray[np.bool_] | None = None,
    regions: Regions | None = None,
    **options: Any,
) -> Thought:
    """What the planner has made when it has planned once from `at` and has not thought about it yet."""
    chosen = LookaheadSettings(**options)
    prior = Belief(weights).probability()
    ground = Ground(weights.shape, flyable, fov)
    part = ground.part_of(at)
    segmented = regions or segment_regions(prior, searchable=prior > 0.0)
    chart = make_chart(ground, part, segmented)
    mass = np.where(part.viewable, prior, 0.0)
    chart.mass[:] = mass.ravel()
    draw_up(chart)
    desk = plans.Desk(chart, make_rules(chosen, ground), np.zeros(1, dtype=np.uint64))
    tree, pose = make_tree(chosen, segmented.count), Pose(*at, 0)
    tree.value[plans.UNDETECTED] = mass.sum()
    plans.replan(pose, tree, desk, chosen.horizon, -1)
    plans.settle_root(pose, tree, desk)
    return Thought(chosen, pose, desk, tree, mass)
