"""The one compiled call of a decision: goals, search, choice, and the cells to enter.

It takes plain arrays, because a named tuple is slow to hand over from Python, and groups them into records.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from roisearch.kernels.compiled import kernel
from roisearch.kernels.goals import set_goals
from roisearch.kernels.ground import col_step, row_step
from roisearch.kernels.puct import search
from roisearch.kernels.records import (
    N_A,
    P_A,
    VALUE_A,
    VISITS,
    Aims,
    Bits,
    Floats,
    Forest,
    Ints,
    Land,
    Mass,
    Rules,
    Sight,
    Steps,
    Tree,
)
from roisearch.kernels.trips import walk_trip


@kernel
def choose(tree: Tree, by: int, held: int, margin: float, shown: Floats) -> int:
    """The root's best action by visits or by value, which `shown` [actions, 2] tells (-1 visits: illegal).

    Action `held` (-1: none), a trip begun earlier, is kept unless another's value is better by more than
    `margin` times as much.
    """
    best = -1
    for action in range(shown.shape[0]):
        shown[action, 0] = -1.0 if tree.stats[0, P_A, action] < 0.0 else tree.stats[0, N_A, action]
        shown[action, 1] = tree.stats[0, VALUE_A, action]
        if shown[action, 0] < 0.0:
            continue
        if best < 0:
            best = action
        elif by == VISITS:
            if shown[action, 0] > shown[best, 0]:
                best = action
        elif shown[action, 0] > 0.0 and (shown[best, 0] == 0.0 or shown[action, 1] > shown[best, 1]):
            best = action
    if held >= 0 and shown[held, 0] > 0.0:
        gap = shown[best, 1] - shown[held, 1]
        if gap <= margin * abs(shown[held, 1]):
            return held
    return best


@kernel
def decide(
    cell: int,
    heading: int,
    nodes: int,
    iterations: int,
    held: int,
    scale: float,
    state: NDArray[np.uint64],
    weights: Floats,
    sums: Floats,
    peaks: Floats,
    cell_of: Ints,
    first: Ints,
    last: Ints,
    box: Ints,
    roots: Ints,
    sizes: Ints,
    legal: Bits,
    cols: int,
    offsets: Ints,
    gains: Floats,
    miss: Floats,
    is_point: bool,
    reach: int,
    fade: Floats,
    fades: bool,
    log: Ints,
    goals: Ints,
    sources: Ints,
    counts: Ints,
    means: Floats,
    centroids: Floats,
    fields: Steps,
    field_goals: Ints,
    forward: Steps,
    queue: Ints,
    stack: Ints,
    worth: Floats,
    goal_rule: int,
    choose_by: int,
    margin: float,
    rollout: int,
    rollout_policy: int,
    option_reward: int,
    backup: int,
    normalise: bool,
    prior: int,
    explore: float,
    discount: float,
    penalty: float,
    density: float,
    alpha: float,
    floor: float,
    child: Steps,
    stats: Floats,
    visits: Floats,
    trail: Floats,
    span: Floats,
    decay: Floats,
    shown: Floats,
    path: Ints,
) -> tuple[int, int, int]:
    """Search from `cell`, or on when `nodes` > 0: nodes in the tree, chosen action, cells in `path`.

    What the arrays are: `kernels.records`. `roots` and `sizes` [regions] are each region's tree and number of
    cells; `held` is an action to keep unless another is clearly better, -1 for none.
    """
    land = Land(legal, weights.size // cols, cols)
    sight = Sight(offsets, gains, miss, is_point)
    mass = Mass(weights, fade, fades, log)
    aims = Aims(goals, sources, counts, means, centroids, fields)
    rules = Rules(
        rollout, rollout_policy, option_reward, backup, normalise, prior, explore, discount, penalty, density,
        alpha, floor, scale,
    )  # fmt: skip
    tree = Tree(child, stats, visits, trail, span, decay)
    row, col = cell // cols, cell % cols
    if nodes == 0:
        forest = Forest(cell_of, first, last, box, peaks)
        set_goals(
            goal_rule, row, col, roots, weights, forest, land, sight, reach, worth, forward, queue,
            field_goals, stack, aims,
        )  # fmt: skip
        for region in range(roots.size):
            means[region] = sums[roots[region]] / sizes[region] if roots[region] >= 0 else 0.0
    nodes = search(nodes, iterations, row, col, heading, tree, land, mass, sight, aims, rules, state)
    action = choose(tree, choose_by, held, margin, shown)
    if action < 4:
        path[0, 0] = row + row_step(action)
        path[1, 0] = col + col_step(action)
        return nodes, action, 1
    now = Mass(weights, fade, False, log)
    return nodes, action, walk_trip(row, col, heading, action - 4, land, now, sight, aims, path)
