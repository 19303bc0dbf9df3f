"""PUCT over the three models of the search problem, one compiled function a step of the algorithm.

`search` runs iterations: `descend` goes down the tree by the PUCT score and takes one new node, a rollout
values it, `ascend` carries the return back up. What differs between the models is in the records, so that one
compiled solver serves all:

    flat MDP    four actions; what the tree has seen fades or not
    BMDP-O      options collect (gain - d) along their trip; what was seen fades by 1 - p_tp in the tree (the
                paper's approximation) and is restored after the iteration
    lite MDP-O  no belief in the tree: nothing fades, an option is one step with one reward, f * mean mass /
                (A^2 * distance to the centroid)
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from roisearch.kernels.compiled import inlined, kernel
from roisearch.kernels.ground import col_step, row_step, steps_to
from roisearch.kernels.records import FAR, Aims, Land, Mass, Pose, Sight
from roisearch.kernels.sensing import fade_at, gain_at, restore
from roisearch.kernels.trips import trip_move
from roisearch.planners.puct.records import (
    DENSITY,
    HIGH,
    INDEX,
    LOW,
    MEAN,
    N_A,
    P_A,
    SHARE,
    UNIFORM,
    VALUE_A,
    WORTH,
    Problem,
    SearchRules,
    SearchTree,
)
from roisearch.planners.puct.rollouts import roll_out


@inlined
def density(row: int, col: int, region: int, aims: Aims, rules: SearchRules) -> float:
    """The paper's reward of an option in the lite model: f * mean mass / (A^2 * distance to the centroid)."""
    apart = abs(aims.centroids[region, 0] - row) + abs(aims.centroids[region, 1] - col)
    return float(rules.density * rules.scale * aims.means[region] / max(apart, 1.0))


@inlined
def hope_of_move(
    row: int, col: int, move: int, land: Land, mass: Mass, sight: Sight, rules: SearchRules
) -> float:
    """What P(a) of a move is made from: its reward, or its index."""
    gain = rules.scale * gain_at(
        row + row_step(move), col + col_step(move), move, land.rows, land.cols, mass, sight
    )
    if rules.prior == INDEX:
        return float(gain**rules.alpha)
    return gain - rules.penalty


@inlined
def hope_of_option(
    row: int, col: int, region: int, steps: int, mass: Mass, sight: Sight, aims: Aims, rules: SearchRules
) -> float:
    """What P(a) of an option is made from: the lite model's reward, or its goal's index."""
    if rules.prior == INDEX:
        goal = aims.goals[region, 0]
        weight = mass.weights[goal] * mass.fade[goal] if mass.fades else mass.weights[goal]
        return float((rules.scale * sight.gains[0] * weight) ** rules.alpha / steps)
    return density(row, col, region, aims, rules)


@inlined
def expand(node: int, row: int, col: int, tree: SearchTree, problem: Problem, rules: SearchRules) -> None:
    """Make `node`: no children, no visits, P(a) of each action from the one-step hopes, -1 if illegal.

    P(a) is `floor` plus the hope scaled to 0 .. 1 over the node's actions, then normalised; uniform when all
    hopes are equal.
    """
    land, mass, sight, aims = problem.land, problem.mass, problem.sight, problem.aims
    stats = tree.stats[node]
    legal = land.legal[row * land.cols + col]
    actions = stats.shape[1]
    least, most = np.inf, -np.inf
    for action in range(actions):
        tree.child[node, action] = -1
        stats[WORTH, action] = 0.0
        stats[N_A, action] = 0.0
        stats[VALUE_A, action] = 0.0
        hope = -np.inf
        if action < 4:
            if legal >> action & 1:
                hope = hope_of_move(row, col, action, land, mass, sight, rules)
        elif aims.goals[action - 4, 0] >= 0:
            steps = steps_to(row, col, action - 4, land.cols, aims, sight)
            if steps < FAR:
                hope = hope_of_option(row, col, action - 4, steps, mass, sight, aims, rules)
        stats[P_A, action] = hope
        if hope > -np.inf:
            least = min(least, hope)
            most = max(most, hope)
    uniform = rules.prior == UNIFORM or most <= least
    unit = 1.0 / (most - least)
    total = 0.0
    for action in range(actions):
        if stats[P_A, action] == -np.inf:
            stats[P_A, action] = -1.0
            continue
        share = 1.0 if uniform else rules.floor + (stats[P_A, action] - least) * unit
        stats[P_A, action] = share
        total += share
    unit = 1.0 / total
    for action in range(actions):
        if stats[P_A, action] >= 0.0:
            stats[P_A, action] *= unit
        stats[SHARE, action] = stats[P_A, action]
    tree.visits[node] = 0.0


@inlined
def select(node: int, tree: SearchTree, rules: SearchRules) -> int:
    """The action with the best PUCT score, Q + c P sqrt(N + 1) / (1 + n).

    Q is 0 for an action not yet tried and otherwise its value scaled to 0 .. 1 over all values in the tree;
    without `normalise` it is the sum of its returns / (1 + n), as in the reference code.
    """
    urge = rules.explore * np.sqrt(tree.visits[node] + 1.0)
    low, high = tree.span[LOW], tree.span[HIGH]
    scale = 1.0 / (high - low) if high > low else 0.0
    stats = tree.stats[node]
    best, best_score = -1, -np.inf
    for action in range(stats.shape[1]):
        share = stats[SHARE, action]
        if share < 0.0:
            continue
        q = 0.0
        if not rules.normalise:
            q = stats[WORTH, action] / (1.0 + stats[N_A, action])
        elif stats[N_A, action] > 0.0:
            q = (stats[VALUE_A, action] - low) * scale
        score = q + urge * share
        if score > best_score:
            best, best_score = action, score
    return best


@inlined
def jump(pose: Pose, region: int, land: Land, aims: Aims) -> Pose:
    """Where the lite model's option ends, at its goal or beside it."""
    to_row, to_col, heading = aims.goals[region, 1], aims.goals[region, 2], pose.heading
    if land.legal[aims.goals[region, 0]] == 0:
        to_row, to_col = aims.sources[region, 0, 1], aims.sources[region, 0, 2]
    down, right = to_row - pose.row, to_col - pose.col
    if abs(down) > abs(right):
        heading = 2 if down > 0 else 0
    elif right != 0:
        heading = 1 if right > 0 else 3
    return Pose(to_row, to_col, heading)


@inlined
def descend(pose: Pose, tree: SearchTree, problem: Problem, rules: SearchRules) -> tuple[int, Pose, int]:
    """From the root down to one new node: depth, where that is, and cells in the log of fading.

    A full tree grows no more; the way down then ends at the action without a node.
    """
    land, mass, sight, aims = problem.land, problem.mass, problem.sight, problem.aims
    node, logged = 0, 0
    for depth in range(tree.trail.shape[0]):
        action = select(node, tree, rules)
        if action < 4:
            pose = Pose(pose.row + row_step(action), pose.col + col_step(action), action)
            gain = gain_at(pose.row, pose.col, action, land.rows, land.cols, mass, sight)
            reward = rules.scale * gain - rules.penalty
            kept = rules.discount
            if mass.fades:
                logged = fade_at(pose.row, pose.col, action, land.rows, land.cols, mass, sight, logged)
        elif rules.option_reward == DENSITY:
            steps = steps_to(pose.row, pose.col, action - 4, land.cols, aims, sight)
            reward = density(pose.row, pose.col, action - 4, aims, rules)
            kept = tree.decay[min(steps, tree.decay.size - 1)]
            pose = jump(pose, action - 4, land, aims)
        else:
            reward, kept = 0.0, 1.0
            arrived = False
            while not arrived:
                move, arrived = trip_move(pose, action - 4, land, mass, sight, aims)
                pose = Pose(pose.row + row_step(move), pose.col + col_step(move), move)
                gain = gain_at(pose.row, pose.col, move, land.rows, land.cols, mass, sight)
                reward += kept * (rules.scale * gain - rules.penalty)
                kept *= rules.discount
                if mass.fades:
                    logged = fade_at(pose.row, pose.col, move, land.rows, land.cols, mass, sight, logged)
        tree.trail[depth, 0] = node
        tree.trail[depth, 1] = action
        tree.trail[depth, 2] = reward
        tree.trail[depth, 3] = kept
        below = tree.child[node, action]
        if below < 0:
            new = tree.grown[0]
            if new < tree.child.shape[0]:
                tree.child[node, action] = new
                expand(new, pose.row, pose.col, tree, problem, rules)
                tree.grown[0] = new + 1
            return depth + 1, pose, logged
        node = below
    return tree.trail.shape[0], pose, logged


@inlined
def ascend(depth: int, value: float, tree: SearchTree, rules: SearchRules) -> None:
    """Carry the return of the rollout back up the trail."""
    for step in range(depth - 1, -1, -1):
        node, action = int(tree.trail[step, 0]), int(tree.trail[step, 1])
        value = tree.trail[step, 2] + tree.trail[step, 3] * value
        stats = tree.stats[node]
        visits = stats[N_A, action] + 1.0
        if rules.backup == MEAN:
            stats[WORTH, action] += value
            shown = stats[WORTH, action] / visits
        else:
            shown = value if visits == 1.0 else max(value, stats[WORTH, action])
            stats[WORTH, action] = shown
        stats[N_A, action] = visits
        stats[VALUE_A, action] = shown
        stats[SHARE, action] = stats[P_A, action] / (1.0 + visits)
        tree.visits[node] += 1.0
        tree.span[LOW] = min(tree.span[LOW], shown)
        tree.span[HIGH] = max(tree.span[HIGH], shown)


@kernel
def search(
    iterations: int,
    pose: Pose,
    tree: SearchTree,
    problem: Problem,
    rules: SearchRules,
    state: NDArray[np.uint64],
) -> None:
    """Search on, or begin when nothing has grown yet."""
    if tree.grown[0] == 0:
        tree.span[LOW], tree.span[HIGH] = np.inf, -np.inf
        expand(0, pose.row, pose.col, tree, problem, rules)
        tree.grown[0] = 1
    land, mass, sight = problem.land, problem.mass, problem.sight
    for _ in range(iterations):
        depth, end, logged = descend(pose, tree, problem, rules)
        value, logged = roll_out(end, land, mass, sight, rules, state, logged)
        restore(mass, logged)
        ascend(depth, value, tree, rules)
