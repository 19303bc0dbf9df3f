"""The one compiled call of a decision: goals, search, choice, and the cells to enter."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from roisearch.kernels.compiled import kernel
from roisearch.kernels.goals import set_goals
from roisearch.kernels.ground import col_step, row_step
from roisearch.kernels.handover import Layout, array
from roisearch.kernels.puct import search
from roisearch.kernels.records import (
    N_A,
    P_A,
    VALUE_A,
    VISITS,
    Aims,
    Floats,
    Forest,
    Land,
    Mass,
    Rules,
    Sight,
    Tree,
)
from roisearch.kernels.trips import walk_trip

GIVEN = Layout(
    # the regions as trees, see `Forest`; [regions] each region's tree and number of cells
    cell_of=(np.int64, 1),
    first=(np.int64, 1),
    last=(np.int64, 1),
    box=(np.int64, 2),
    roots=(np.int64, 1),
    sizes=(np.int64, 1),
    # see `Land`, `Sight`, `Mass`
    legal=(np.uint8, 1),
    cols=np.int64,
    offsets=(np.int64, 3),
    gains=(np.float64, 1),
    miss=(np.float64, 1),
    is_point=np.bool_,
    fade=(np.float64, 1),
    fades=np.bool_,
    log=(np.int64, 1),
    # see `Aims`
    goals=(np.int64, 2),
    sources=(np.int64, 3),
    counts=(np.int64, 1),
    means=(np.float64, 1),
    centroids=(np.float64, 2),
    fields=(np.int32, 2),
    # see `set_goals`
    goal_rule=np.int64,
    reach=np.int64,
    worth=(np.float64, 1),
    forward=(np.int32, 1),
    queue=(np.int64, 1),
    field_goals=(np.int64, 1),
    stack=(np.int64, 1),
    # see `Rules`
    rollout=np.int64,
    rollout_policy=np.int64,
    option_reward=np.int64,
    backup=np.int64,
    normalise=np.bool_,
    prior=np.int64,
    explore=np.float64,
    discount=np.float64,
    penalty=np.float64,
    density=np.float64,
    alpha=np.float64,
    floor=np.float64,
    # see `Tree`
    child=(np.int32, 2),
    stats=(np.float64, 3),
    visits=(np.float64, 1),
    trail=(np.float64, 2),
    span=(np.float64, 1),
    decay=(np.float64, 1),
    # see `choose`, and [2, n] room for the cells to enter
    choose_by=np.int64,
    margin=np.float64,
    shown=(np.float64, 2),
    path=(np.int64, 2),
)
opened = GIVEN.opener()


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
    weights: Floats,
    sums: Floats,
    peaks: Floats,
    state: NDArray[np.uint64],
    parcel: int,
) -> tuple[int, int, int]:
    """Search from `cell`, or on when `nodes` > 0: nodes in the tree, chosen action, cells in `path`.

    Args:
        held: an action to keep unless another is clearly better, -1 for none.
        scale: what makes a weight a probability.
        weights, sums, peaks: the belief's, and of the nodes of the forest.
        state: uint64 [1], of the random numbers.
        parcel: address of what was packed by `GIVEN`.
    """
    given = opened(parcel)
    cols = given.cols
    land = Land(array(given.legal), weights.size // cols, cols)
    sight = Sight(array(given.offsets), array(given.gains), array(given.miss), given.is_point)
    fades, log = given.fades, array(given.log)
    mass = Mass(weights, array(given.fade), fades, log)
    aims = Aims(
        array(given.goals), array(given.sources), array(given.counts), array(given.means),
        array(given.centroids), array(given.fields),
    )  # fmt: skip
    rules = Rules(
        given.rollout, given.rollout_policy, given.option_reward, given.backup, given.normalise, given.prior,
        given.explore, given.discount, given.penalty, given.density, given.alpha, given.floor, scale,
    )  # fmt: skip
    tree = Tree(
        array(given.child), array(given.stats), array(given.visits), array(given.trail),
        array(given.span), array(given.decay),
    )  # fmt: skip
    row, col = cell // cols, cell % cols
    if nodes == 0:
        roots, sizes = array(given.roots), array(given.sizes)
        forest = Forest(array(given.cell_of), array(given.first), array(given.last), array(given.box), peaks)
        set_goals(
            given.goal_rule, row, col, roots, weights, forest, land, sight, given.reach, array(given.worth),
            array(given.forward), array(given.queue), array(given.field_goals), array(given.stack), aims,
        )  # fmt: skip
        for region in range(roots.size):
            aims.means[region] = sums[roots[region]] / sizes[region] if roots[region] >= 0 else 0.0
    nodes = search(nodes, iterations, row, col, heading, tree, land, mass, sight, aims, rules, state)
    action = choose(tree, given.choose_by, held, given.margin, array(given.shown))
    path = array(given.path)
    if action < 4:
        path[0, 0] = row + row_step(action)
        path[1, 0] = col + col_step(action)
        return nodes, action, 1
    now = Mass(weights, mass.fade, False, log)
    return nodes, action, walk_trip(row, col, heading, action - 4, land, now, sight, aims, path)
