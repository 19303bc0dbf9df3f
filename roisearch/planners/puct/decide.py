"""The one compiled call of a decision: goals, search, choice, and the cells to enter."""

from __future__ import annotations

import numpy as np

from roisearch.kernels.compiled import kernel
from roisearch.kernels.forest import opened as opened_touched
from roisearch.kernels.ground import col_step, row_step
from roisearch.kernels.groups import FADING, FOREST, LAND, RANGING, SIGHT
from roisearch.kernels.handover import Layout, array
from roisearch.kernels.records import Aims, Floats, Forest, Ints, Land, Mass, Pose, Ranging, Sight
from roisearch.kernels.trips import walk_trip
from roisearch.planners.puct.choosing import choose_regions
from roisearch.planners.puct.goals import set_goals
from roisearch.planners.puct.records import N_A, P_A, SHARE, VALUE_A, VISITS, Problem, SearchRules, SearchTree
from roisearch.planners.puct.search import search

GIVEN = Layout(
    **FOREST,
    **LAND,
    **SIGHT,
    **FADING,
    **RANGING,
    # [regions] the number of cells of each, [regions, 2] their middles
    sizes=(np.int64, 1),
    middles=(np.float64, 2),
    # [slots] the regions that have options, and their roots; [2, slots] see `choose_regions`
    chosen=(np.int64, 1),
    chosen_roots=(np.int64, 1),
    best=(np.float64, 2),
    # see `Aims`, of the regions that have options
    goals=(np.int64, 2),
    sources=(np.int64, 3),
    counts=(np.int64, 1),
    means=(np.float64, 1),
    centroids=(np.float64, 2),
    fields=(np.int32, 2),
    made_for=(np.int64, 1),
    # see `set_goals`
    goal_rule=np.int64,
    # see `SearchRules`
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
    # see `SearchTree`
    child=(np.int32, 2),
    stats=(np.float64, 3),
    visits=(np.float64, 1),
    trail=(np.float64, 2),
    span=(np.float64, 1),
    decay=(np.float64, 1),
    grown=(np.int64, 1),
    # uint64 [1], see `roisearch.kernels.draws`
    random=(np.uint64, 1),
    # see `choose`, and [2, n] room for the cells to enter
    choose_by=np.int64,
    margin=np.float64,
    shown=(np.float64, 2),
    path=(np.int64, 2),
)
opened = GIVEN.opener()


@kernel
def choose(tree: SearchTree, by: int, held: int, margin: float, shown: Floats) -> int:
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
def slot_of(action: int, chosen: Ints) -> int:
    """The action of the slot that the region of an action has; -1 when it has none."""
    if action < 4:
        return action
    for slot in range(chosen.size):
        if chosen[slot] == action - 4:
            return 4 + slot
    return -1


@kernel
def decide(
    cell: int,
    heading: int,
    iterations: int,
    held: int,
    scale: float,
    weights: Floats,
    touched: int,
    parcel: int,
) -> tuple[int, int]:
    """Search from `cell`, or on when the tree has grown: the chosen action, and how many cells of `path` it enters.

    Actions from 4 on are slots of `chosen`.

    Args:
        held: an action to keep unless another is clearly better, -1 for none; from 4 on 4 + the region.
        scale: what makes a weight a probability.
        weights: the belief's.
        touched: address of what was packed by `TOUCHED`, with the sums and peaks of the forest's nodes.
        parcel: address of what was packed by `GIVEN`.
    """
    given, regions = opened(parcel), opened_touched(touched)
    cols = given.cols
    land = Land(array(given.legal), weights.size // cols, cols)
    sight = Sight(array(given.offsets), array(given.gains), array(given.miss), given.is_point)
    fade, log = array(given.fade), array(given.log)
    mass = Mass(weights, fade, given.fades, log)
    aims = Aims(
        array(given.goals), array(given.sources), array(given.counts), array(given.means),
        array(given.centroids), array(given.fields), array(given.made_for),
    )  # fmt: skip
    rules = SearchRules(
        given.rollout, given.rollout_policy, given.option_reward, given.backup, given.normalise, given.prior,
        given.explore, given.discount, given.penalty, given.density, given.alpha, given.floor, scale,
    )  # fmt: skip
    tree = SearchTree(
        array(given.child), array(given.stats), array(given.visits), array(given.trail),
        array(given.span), array(given.decay), array(given.grown),
    )  # fmt: skip
    pose = Pose(cell // cols, cell % cols, heading)
    if tree.grown[0] == 0:
        roots, sizes, sums = array(given.roots), array(given.sizes), array(regions.sums)
        whole = Forest(
            array(given.cell_of), array(given.first), array(given.last), array(given.box), roots,
            array(regions.peaks),
        )  # fmt: skip
        slots, near = array(given.chosen), array(given.chosen_roots)
        if slots.size < roots.size:
            choose_regions(pose, whole, given.alpha, held - 4, slots, array(given.best))
            middles = array(given.middles)
            for slot in range(slots.size):
                region = slots[slot]
                near[slot] = roots[region] if region >= 0 else -1
                if region >= 0:
                    aims.centroids[slot, 0], aims.centroids[slot, 1] = middles[region, 0], middles[region, 1]
        forest = Forest(whole.cell_of, whole.first, whole.last, whole.box, near, whole.peaks)
        ranging = Ranging(
            array(given.worth), given.reach, array(given.forward), array(given.queue), array(given.stack)
        )
        set_goals(given.goal_rule, pose, weights, forest, land, sight, ranging, aims)
        for slot in range(near.size):
            aims.means[slot] = sums[near[slot]] / sizes[slots[slot]] if near[slot] >= 0 else 0.0
    problem, state, kept = (
        Problem(land, mass, sight, aims),
        array(given.random),
        slot_of(held, array(given.chosen)),
    )
    if kept >= 0 and tree.grown[0] == 0:
        search(0, pose, tree, problem, rules, state)
        if tree.stats[0, P_A, kept] >= 0.0:
            tree.stats[0, SHARE, kept] = (
                np.inf
            )  # it is tried first: one that is never tried could not be kept
    search(iterations, pose, tree, problem, rules, state)
    action = choose(tree, given.choose_by, kept, given.margin, array(given.shown))
    path = array(given.path)
    if action < 4:
        path[0, 0] = pose.row + row_step(action)
        path[1, 0] = pose.col + col_step(action)
        return action, 1
    now = Mass(weights, fade, False, log)
    return action, walk_trip(pose, action - 4, land, now, sight, aims, path)
