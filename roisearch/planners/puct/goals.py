"""The goal of each region's option: the region's most probable cell, or the one most worth its distance."""

from __future__ import annotations

from roisearch.kernels.compiled import kernel
from roisearch.kernels.forest import peak_cell
from roisearch.kernels.goals import index_cell
from roisearch.kernels.ground import find_sources, flood
from roisearch.kernels.records import Aims, Floats, Forest, Land, Pose, Ranging, Sight
from roisearch.planners.puct.records import PEAK_GOAL


@kernel
def set_goals(
    rule: int,
    pose: Pose,
    weights: Floats,
    forest: Forest,
    land: Land,
    sight: Sight,
    ranging: Ranging,
    aims: Aims,
) -> None:
    """Fill `aims`: each region's goal (-1: nothing to find), its sources, the way around obstacles.

    An unchanged goal keeps its field.
    """
    cols, queue = land.cols, ranging.queue
    if ranging.forward.size > 0 and rule != PEAK_GOAL:
        ranging.stack[0] = pose.row * cols + pose.col
        flood(ranging.stack[:1], 0, land.legal, cols, ranging.forward, queue)
    for region in range(forest.root.size):
        goal, root, sources = -1, forest.root[region], aims.sources[region]
        if root >= 0:
            if rule == PEAK_GOAL:
                goal = peak_cell(root, weights, forest)
            else:
                goal, _ = index_cell(root, pose, weights, forest, land, sight, ranging, sources)
        aims.goals[region, 0] = goal
        if goal < 0:
            continue
        aims.goals[region, 1] = goal // cols
        aims.goals[region, 2] = goal % cols
        aims.counts[region] = find_sources(goal, land, sight, sources)
        if aims.fields.shape[0] > 0 and goal != aims.made_for[region]:
            flood(sources[: aims.counts[region], 0], 1, land.legal, cols, aims.fields[region], queue)
            aims.made_for[region] = goal
