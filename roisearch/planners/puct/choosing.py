"""Which regions have options at a decision, where there are more than a decision has room for.

An option to a region far away that is worth little is never taken before the nearer and richer ones, and costs as much
thinking as they do. So a decision considers those that promise most: the weight of the region's best cell to the power
`alpha`, over the steps to the box around the region, which no cell of it can beat.
"""

from __future__ import annotations

import numpy as np

from roisearch.kernels.compiled import kernel
from roisearch.kernels.records import Floats, Forest, Ints, Pose


@kernel
def promise_of(root: int, pose: Pose, forest: Forest, alpha: float) -> float:
    """What a region can be worth at most, from where the drone is; -1 when there is nothing in it."""
    if root < 0 or forest.peaks[root] <= 0.0:
        return -1.0
    box = forest.box[root]
    down = max(0, box[0] - pose.row, pose.row - box[1])
    right = max(0, box[2] - pose.col, pose.col - box[3])
    return float(forest.peaks[root] ** alpha / max(1, down + right))


@kernel
def choose_regions(pose: Pose, forest: Forest, alpha: float, held: int, chosen: Ints, best: Floats) -> None:
    """Put the regions that promise most into `chosen` [slots], -1 where there are fewer.

    One that had a slot keeps it: what was reckoned for the slot holds on.

    Args:
        forest: with the roots of all regions.
        held: a region that is chosen in any case; -1 for none.
        best: float [2, slots], room.
    """
    slots = chosen.size
    for slot in range(slots):
        best[0, slot], best[1, slot] = -1.0, -1.0
    for region in range(forest.root.size):
        promise = promise_of(forest.root[region], pose, forest, alpha)
        if promise >= 0.0 and region == held:
            promise = np.inf
        if promise <= best[0, slots - 1]:
            continue
        slot = slots - 1
        while slot > 0 and best[0, slot - 1] < promise:
            best[0, slot], best[1, slot] = best[0, slot - 1], best[1, slot - 1]
            slot -= 1
        best[0, slot], best[1, slot] = promise, float(region)
    for slot in range(slots):
        stays = False
        for place in range(slots):
            if best[1, place] == chosen[slot] and chosen[slot] >= 0:
                best[1, place] = -1.0
                stays = True
        if not stays:
            chosen[slot] = -1
    empty = 0
    for place in range(slots):
        if best[1, place] >= 0.0:
            while chosen[empty] >= 0:
                empty += 1
            chosen[empty] = int(best[1, place])
