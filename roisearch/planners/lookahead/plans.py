"""PUCT over sweeps: a tree along the plan that is being flown, grown a little at every step.

The lite MDP-O with options that sweep. Lite, as in the paper: there is no belief in the tree, so nothing is reported in
it, and an option is one action with one reward. The paper's options go to a region, over a map that stands still; these
sweep it down to a level, each look takes what it detects, and the reward is expected time.

The tree has no chance nodes, the best return is attainable, and one line of actions, the *plan*, is always the best
known. Nodes stand along the plan, `spacing` steps apart. In each node the actions are to *keep to the plan*, to sweep
any one region down to a level, to sweep anywhere, and at the root the four moves. An iteration

1. selects: from the root it follows argmax Q + explore * P * sqrt(N) / (1 + n), flying the plan as long as
   that says to keep to it, and adds one node where the plan has none yet;
2. simulates: at another action, it draws how far down to sweep (lambda), for how long at most, and with
   which balance of worth and distance, and follows that sweep; with probability `chain` another sweep drawn
   at random, and so on; then the index rule, as the rollout, to the horizon of the plan;
3. evaluates: the area under the survival curve, which is the expected time, plus what clearing the rest
   takes without travel, times `overhead`;
4. backs up: the visits, and the least loss against the plan. When the new line is better it becomes the
   plan, and the nodes after the branch are dropped with it.

Q is 1 for keeping to the plan and 1 / (1 + loss / (spread * expected time)) for the best seen of another
action; it is 1 for one not tried. P is `keep` for keeping to the plan; the rest is divided in proportion to
each region's best index.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from roisearch.kernels.compiled import light_kernel as kernel
from roisearch.kernels.draws import draw_unit
from roisearch.kernels.ground import col_step, row_step
from roisearch.kernels.records import Floats, Ints, Pose
from roisearch.planners.lookahead.chart import Chart, begin, copy_table, restore, time_to_clear
from roisearch.planners.lookahead.others import SIZE
from roisearch.planners.lookahead.sweeps import ANYWHERE, Option, fly, region_scores, sweep


class PlanRules(NamedTuple):
    """The settings of the search; see `LookaheadSettings`.

    nears: float [balances, distances], score of a cell by distance; row 0 is the rollout's. followers: how
    many of the first rows may be a rollout's. looks_per_halving, looks_per_step: `time_to_clear`.
    """

    nears: Floats
    followers: int
    chain: float
    explore: float
    keep: float
    spread: float
    spacing: int
    overhead: float
    looks_per_halving: float
    looks_per_step: float


class PlanTree(NamedTuple):
    """The plan and the nodes along it.

    path: int [most], cells of the plan; now, length and nodes are in `mark` [NOW, LENGTH, NODES]. action:
    int [most], what each step of the plan belongs to: a region's label, or ANYWHERE. trial, trial_action:
    the same of the line being tried. at: int [nodes], where on the path a node stands. stats: float [nodes,
    actions, 3]: P(a), least loss (of keeping to the plan: 0), visits. Actions: 0-3 moves, 4 anywhere, 4 + k
    region k, last: keep to the plan. worths: float [nodes, regions + 1], the largest worth in each region.
    scores: float [regions + 1], room. value: float [EXPECTED, UNDETECTED, LEFT]: area under the survival
    curve of the plan, the rest included; the mass not detected now, and at the end of the plan as it was
    last carried on.
    """

    path: Ints
    trial: Ints
    action: Ints
    trial_action: Ints
    mark: Ints
    at: Ints
    stats: Floats
    worths: Floats
    scores: Floats
    value: Floats


class Desk(NamedTuple):
    """What the kernels of a plan work on, beside it. random: uint64 [1], see `roisearch.kernels.draws`."""

    chart: Chart
    rules: PlanRules
    random: NDArray[np.uint64]


NOW, LENGTH, NODES = 0, 1, 2
P_A, LOSS, N_A = 0, 1, 2
EXPECTED, UNDETECTED, LEFT = 0, 1, 2


@kernel
def lower(state: NDArray[np.uint64]) -> float:
    """How far below its peak a region is swept: a factor between 0.9 and 0.02, evenly in its logarithm."""
    return float(10.0 ** (-0.05 - 1.6 * draw_unit(state)))


@kernel
def fill(array: Ints, first: int, last: int, value: int) -> None:
    """array[first:last] = value."""
    for i in range(first, last):
        array[i] = value


@kernel
def copy_range(source: Ints, target: Ints, first: int, last: int) -> None:
    """target[first:last] = source[first:last]."""
    for i in range(first, last):
        target[i] = source[i]


@kernel
def rest(chart: Chart, undetected: float, rules: PlanRules) -> float:
    """What clearing the rest takes, from the horizon on."""
    return rules.overhead * time_to_clear(
        chart.levels,
        undetected,
        rules.looks_per_halving,
        rules.looks_per_step * chart.others.counters[SIZE],
    )


@kernel
def evaluate(pose: Pose, tree: PlanTree, desk: Desk) -> float:
    """The area under the survival curve of the plan from now on."""
    chart = desk.chart
    begin(chart)
    area, undetected, pose = fly(
        pose, chart, tree.value[UNDETECTED], tree.path, tree.mark[NOW], tree.mark[LENGTH], True
    )
    area += rest(chart, undetected, desk.rules)
    restore(chart)
    return area


@kernel
def extend(pose: Pose, tree: PlanTree, desk: Desk, horizon: int) -> None:
    """Carry the plan on by the rollout's rule until it is `horizon` steps long, and evaluate it."""
    chart = desk.chart
    begin(chart)
    now, length = tree.mark[NOW], tree.mark[LENGTH]
    area, undetected, pose = fly(pose, chart, tree.value[UNDETECTED], tree.path, now, length, True)
    anywhere = Option(desk.rules.nears[0], ANYWHERE, 0.0)
    more, undetected, steps, pose = sweep(
        pose, chart, anywhere, now + horizon - length, undetected, tree.path, length
    )
    fill(tree.action, length, length + steps, ANYWHERE)
    tree.mark[LENGTH] = length + steps
    tree.value[EXPECTED] = area + more + rest(chart, undetected, desk.rules)
    tree.value[LEFT] = undetected
    restore(chart)


@kernel
def add_node(node: int, at: int, pose: Pose, tree: PlanTree, desk: Desk) -> None:
    """A new last node, with P(a) of its actions."""
    tree.mark[NODES] = node + 1
    tree.at[node] = at
    rules, stats, scores = desk.rules, tree.stats[node], tree.scores
    for action in range(stats.shape[0]):
        stats[action, P_A] = stats[action, LOSS] = stats[action, N_A] = 0.0
    regions = tree.worths.shape[1]
    region_scores(pose, desk.chart, rules.nears[0], scores, tree.worths[node])
    best = total = 0.0
    for region in range(regions):
        best = max(best, scores[region])
        total += scores[region] if region > 0 else 0.0
    share = (1.0 - rules.keep) / (best + total) if best > 0.0 else 0.0
    stats[4, P_A] = share * best
    for region in range(1, regions):
        stats[4 + region, P_A] = share * scores[region]
    stats[stats.shape[0] - 1, P_A] = rules.keep


@kernel
def open_moves(pose: Pose, tree: PlanTree, desk: Desk) -> None:
    """Let the root have the four moves as actions."""
    for move in range(4):
        legal = desk.chart.legal[pose.row * desk.chart.cols + pose.col] >> move & 1
        tree.stats[0, move, P_A] = 0.1 * (1.0 - desk.rules.keep) if legal else -1.0


@kernel
def select(node: int, tree: PlanTree, rules: PlanRules, may_keep: bool) -> int:
    """The action with the largest PUCT score; -1 when the node has none."""
    stats = tree.stats[node]
    last = stats.shape[0] - 1
    visits = 1.0
    for action in range(stats.shape[0]):
        visits += stats[action, N_A]
    best, best_score = -1, -np.inf
    for action in range(stats.shape[0]):
        if stats[action, P_A] <= 0.0 or (action == last and not may_keep):
            continue
        worth = 1.0
        if stats[action, N_A] > 0.0 and tree.value[EXPECTED] > 0.0:
            worth = 1.0 / (1.0 + stats[action, LOSS] / (rules.spread * tree.value[EXPECTED]))
        score = worth + rules.explore * stats[action, P_A] * np.sqrt(visits) / (1.0 + stats[action, N_A])
        if score > best_score:
            best, best_score = action, score
    return best


@kernel
def iterate(pose: Pose, tree: PlanTree, desk: Desk, hold: int) -> bool:
    """One iteration; see the module's text. The pose is the root's, at path[NOW]. True for a better plan.

    Nodes before `hold` on the path keep to the plan.
    """
    chart, rules, state = desk.chart, desk.rules, desk.random
    begin(chart)
    keep = tree.stats.shape[1] - 1
    end = tree.mark[LENGTH]
    t = tree.mark[NOW]
    node = 0
    area, undetected = 0.0, tree.value[UNDETECTED]
    fresh = False
    while True:
        following = node + 1
        there = tree.at[node] + rules.spacing if following >= tree.mark[NODES] else tree.at[following]
        may_keep = not fresh and there + rules.spacing <= end and following < tree.at.size
        action = keep if tree.at[node] < hold else select(node, tree, rules, may_keep)
        if action != keep:
            break
        tree.stats[node, keep, N_A] += 1.0
        more, undetected, pose = fly(pose, chart, undetected, tree.path, t, there, True)
        area += more
        t = there
        if following >= tree.mark[NODES]:
            add_node(following, t, pose, tree, desk)
            fresh = t > hold
        node = following
    if action < 0:
        restore(chart)
        return False

    begun = t
    region, floor, most = ANYWHERE, 0.0, int(10.0 ** (1.0 + 2.0 * draw_unit(state)))
    balance = int(draw_unit(state) * rules.nears.shape[0])
    if action < 4:
        tree.trial[t] = (pose.row + row_step(action)) * chart.cols + pose.col + col_step(action)
        more, undetected, pose = fly(pose, chart, undetected, tree.trial, t, t + 1, True)
        area += more
        t += 1
        most = 0
    elif action > 4:
        region = action - 4
        floor = tree.worths[node, region] * lower(state)
    fill(tree.trial_action, begun, t, region)
    while True:
        option = Option(rules.nears[balance], region, floor)
        more, undetected, steps, pose = sweep(
            pose, chart, option, min(most, end - t), undetected, tree.trial, t
        )
        area += more
        fill(tree.trial_action, t, t + steps, region)
        t += steps
        if t >= end or draw_unit(state) >= rules.chain:
            break
        region, most = (
            int(draw_unit(state) * tree.worths.shape[1]),
            int(10.0 ** (1.0 + 2.0 * draw_unit(state))),
        )
        floor = tree.worths[node, region] * lower(state)
        if region == 0:
            region, floor = ANYWHERE, 0.0
        balance = int(draw_unit(state) * rules.nears.shape[0])
    follower = int(draw_unit(state) * rules.followers) if draw_unit(state) < 0.3 else 0
    anywhere = Option(rules.nears[follower], ANYWHERE, 0.0)
    more, undetected, steps, pose = sweep(pose, chart, anywhere, end - t, undetected, tree.trial, t)
    fill(tree.trial_action, t, t + steps, ANYWHERE)
    area += more + rest(chart, undetected, rules)
    restore(chart)

    loss = area - tree.value[EXPECTED]
    stats = tree.stats[node, action]
    if t + steps < end:  # nothing left to sweep, or no more room: not comparable
        loss = max(loss, rules.spread * tree.value[EXPECTED])
    stats[LOSS] = loss if stats[N_A] == 0.0 else min(stats[LOSS], loss)
    stats[N_A] += 1.0
    if loss >= -1e-12 * tree.value[EXPECTED]:
        stats[LOSS] = max(stats[LOSS], 0.0)
        return False
    adopt(node, begun, end, loss, tree)
    return True


@kernel
def open_with(pose: Pose, tree: PlanTree, desk: Desk, region: int, share: float, whatever: bool) -> bool:
    """Sweep `region` down to `share` of its largest worth, then go on by the rollout's rule; whether that is the plan.

    It becomes the plan when it is better, or `whatever` it costs. The root must have been settled.
    """
    chart, near = desk.chart, desk.rules.nears[0]
    now, end = tree.mark[NOW], tree.mark[LENGTH]
    begin(chart)
    swept = Option(near, region, share * tree.worths[0, region])
    area, undetected, steps, there = sweep(
        pose, chart, swept, end - now, tree.value[UNDETECTED], tree.trial, now
    )
    begun = now + steps
    fill(tree.trial_action, now, begun, region)
    anywhere = Option(near, ANYWHERE, 0.0)
    more, undetected, steps, _ = sweep(there, chart, anywhere, end - begun, undetected, tree.trial, begun)
    fill(tree.trial_action, begun, begun + steps, ANYWHERE)
    loss = area + more + rest(chart, undetected, desk.rules) - tree.value[EXPECTED]
    restore(chart)
    if begun + steps < end or (not whatever and loss >= -1e-12 * tree.value[EXPECTED]):
        return False
    adopt(0, now, end, loss, tree)
    return True


@kernel
def adopt(node: int, begun: int, end: int, loss: float, tree: PlanTree) -> None:
    """Make the trial the plan: it leaves the plan at `begun`."""
    copy_range(tree.trial, tree.path, begun, end)
    copy_range(tree.trial_action, tree.action, begun, end)
    tree.value[EXPECTED] += loss
    tree.mark[NODES] = node + 1
    keep = tree.stats.shape[1] - 1
    for earlier in range(node + 1):
        for action in range(keep):
            if tree.stats[earlier, action, N_A] > 0.0:
                tree.stats[earlier, action, LOSS] = max(0.0, tree.stats[earlier, action, LOSS] - loss)


@kernel
def advance(steps: int, pose: Pose, tree: PlanTree, desk: Desk) -> Pose:
    """Fly the next steps of the plan for good, seeing nothing; returns the pose."""
    now = tree.mark[NOW]
    area, undetected, pose = fly(pose, desk.chart, tree.value[UNDETECTED], tree.path, now, now + steps, False)
    tree.value[EXPECTED] -= area
    tree.value[UNDETECTED] = undetected
    tree.mark[NOW] += steps
    return pose


def shift(tree: PlanTree) -> None:
    """Forget the flown part of the path."""
    now, length = int(tree.mark[NOW]), int(tree.mark[LENGTH])
    for array in (tree.path, tree.action):
        array[: length - now] = array[now:length].copy()
    tree.at[: tree.mark[NODES]] -= now
    tree.mark[NOW], tree.mark[LENGTH] = 0, length - now


@kernel
def settle_root(pose: Pose, tree: PlanTree, desk: Desk) -> None:
    """Drop the nodes that were passed; the last of them becomes the root, with its numbers."""
    now = tree.mark[NOW]
    passed = 0
    while passed < tree.mark[NODES] and tree.at[passed] <= now:
        passed += 1
    if passed == 0:
        add_node(0, now, pose, tree, desk)
    elif passed > 1:
        left = tree.mark[NODES] - passed + 1
        for node in range(left):
            tree.at[node] = tree.at[node + passed - 1]
            copy_table(tree.stats[node + passed - 1], tree.stats[node])
            for region in range(tree.worths.shape[1]):
                tree.worths[node, region] = tree.worths[node + passed - 1, region]
        tree.mark[NODES] = left
    if tree.at[0] < now:
        for move in range(4):
            tree.stats[0, move, LOSS] = tree.stats[0, move, N_A] = 0.0
    tree.at[0] = now
    open_moves(pose, tree, desk)


@kernel
def resume(pose: Pose, tree: PlanTree, desk: Desk, horizon: int, pause: int) -> tuple[float, int]:
    """Try the rollout's rule for `pause` steps and then the plan's own sweeps: expected time, and steps tried."""
    chart, near = desk.chart, desk.rules.nears[0]
    begin(chart)
    undetected = tree.value[UNDETECTED]
    area, done = 0.0, 0
    i, length = tree.mark[NOW], tree.mark[LENGTH]
    region, most = ANYWHERE, pause
    while done < horizon:
        more, undetected, steps, pose = sweep(
            pose, chart, Option(near, region, 0.0), min(most, horizon - done), undetected, tree.trial, done
        )
        fill(tree.trial_action, done, done + steps, region)
        area += more
        done += steps
        if i >= length:
            if region == ANYWHERE:
                break
            region, most = ANYWHERE, horizon
            continue
        region, most = tree.action[i], 0
        while i < length and tree.action[i] == region:
            most += 1
            i += 1
        if i >= length and region == ANYWHERE:
            most = horizon
    area += rest(chart, undetected, desk.rules)
    restore(chart)
    return area, done


@kernel
def replan(pose: Pose, tree: PlanTree, desk: Desk, horizon: int, pause: int) -> None:
    """Plan anew from here: by the rollout's rule, or by it for `pause` steps and then the old plan's sweeps.

    The better of the two becomes the plan, at the start of the path. With `pause` < 0 there is no old plan.
    """
    chart = desk.chart
    tree.mark[NODES] = 0
    old_area, old_steps = np.inf, 0
    if pause >= 0:
        old_area, old_steps = resume(pose, tree, desk, horizon, pause)
    begin(chart)
    anywhere = Option(desk.rules.nears[0], ANYWHERE, 0.0)
    area, undetected, steps, pose = sweep(
        pose, chart, anywhere, horizon, tree.value[UNDETECTED], tree.path, 0
    )
    area += rest(chart, undetected, desk.rules)
    restore(chart)
    tree.mark[NOW] = 0
    if old_area < area and old_steps >= steps:
        copy_range(tree.trial, tree.path, 0, old_steps)
        copy_range(tree.trial_action, tree.action, 0, old_steps)
        tree.mark[LENGTH] = old_steps
        tree.value[EXPECTED] = old_area
    else:
        fill(tree.action, 0, steps, ANYWHERE)
        tree.mark[LENGTH] = steps
        tree.value[EXPECTED] = area
