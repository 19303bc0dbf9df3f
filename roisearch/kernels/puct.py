"""PUCT over the three models of the search problem, one compiled function a step of the algorithm.

`search` runs iterations: `descend` goes down the tree by the PUCT score and takes one new node, a rollout
values it, `ascend` carries the return back up. What differs between the models is in the records, so that one
compiled solver serves all:

    flat MDP    four actions; what the tree has seen fades or not
    BMDP-O      options collect (gain - d) along their trip; what was seen fades by 1 - p_tp in the tree (the
                paper's approximation) and is restored after the iteration
    lite MDP-O  options pay f * mean mass / (A^2 * distance to the centroid); nothing fades
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from roisearch.kernels.compiled import inlined, kernel
from roisearch.kernels.ground import col_step, row_step, steps_to
from roisearch.kernels.records import (
    DENSITY,
    FAR,
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
    Aims,
    Land,
    Mass,
    Rules,
    Sight,
    Tree,
)
from roisearch.kernels.rollouts import roll_out
from roisearch.kernels.sensing import fade_at, gain_at, restore
from roisearch.kernels.trips import trip_move


@inlined
def density(row: int, col: int, region: int, aims: Aims, rules: Rules) -> float:
    """The paper's reward of an option in the lite model: f * mean mass / (A^2 * distance to the centroid)."""
    apart = abs(aims.centroids[region, 0] - row) + abs(aims.centroids[region, 1] - col)
    return float(rules.density * rules.scale * aims.means[region] / max(apart, 1.0))


@inlined
def hope_of_move(row: int, col: int, move: int, land: Land, mass: Mass, sight: Sight, rules: Rules) -> float:
    """What P(a) of a move is made from: its reward, or its index."""
    gain = rules.scale * gain_at(
        row + row_step(move), col + col_step(move), move, land.rows, land.cols, mass, sight
    )
    if rules.prior == INDEX:
        return float(gain**rules.alpha)
    return gain - rules.penalty


@inlined
def hope_of_option(
    row: int, col: int, region: int, steps: int, mass: Mass, sight: Sight, aims: Aims, rules: Rules
) -> float:
    """What P(a) of an option is made from: the lite model's reward, or its goal's index."""
    if rules.prior == INDEX:
        goal = aims.goals[region, 0]
        weight = mass.weights[goal] * mass.fade[goal] if mass.fades else mass.weights[goal]
        return float((rules.scale * sight.gains[0] * weight) ** rules.alpha / steps)
    return density(row, col, region, aims, rules)


@inlined
def expand(
    node: int, row: int, col: int, tree: Tree, land: Land, mass: Mass, sight: Sight, aims: Aims, rules: Rules
) -> None:
    """Make `node`: no children, no visits, P(a) of each action from the one-step hopes, -1 if illegal.

    P(a) is `floor` plus the hope scaled to 0 .. 1 over the node's actions, then normalised; uniform when all
    hopes are equal.
    """
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
def select(node: int, tree: Tree, rules: Rules) -> int:
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
def jump(row: int, col: int, heading: int, region: int, land: Land, aims: Aims) -> tuple[int, int, int]:
    """Where the lite model's option ends, at its goal or beside it: row, column, heading."""
    to_row, to_col = aims.goals[region, 1], aims.goals[region, 2]
    if land.legal[aims.goals[region, 0]] == 0:
        to_row, to_col = aims.sources[region, 0, 1], aims.sources[region, 0, 2]
    down, right = to_row - row, to_col - col
    if abs(down) > abs(right):
        heading = 2 if down > 0 else 0
    elif right != 0:
        heading = 1 if right > 0 else 3
    return to_row, to_col, heading


@inlined
def descend(
    nodes: int,
    row: int,
    col: int,
    heading: int,
    tree: Tree,
    land: Land,
    mass: Mass,
    sight: Sight,
    aims: Aims,
    rules: Rules,
) -> tuple[int, int, int, int, int, int]:
    """From the root down to one new node: nodes, depth, row, column, heading, cells in the log of fading.

    A full tree grows no more; the way down then ends at the action without a node.
    """
    node, logged = 0, 0
    for depth in range(tree.trail.shape[0]):
        action = select(node, tree, rules)
        if action < 4:
            row += row_step(action)
            col += col_step(action)
            heading = action
            reward = (
                rules.scale * gain_at(row, col, heading, land.rows, land.cols, mass, sight) - rules.penalty
            )
            kept = rules.discount
            if mass.fades:
                logged = fade_at(row, col, heading, land.rows, land.cols, mass, sight, logged)
        elif rules.option_reward == DENSITY:
            steps = steps_to(row, col, action - 4, land.cols, aims, sight)
            reward = density(row, col, action - 4, aims, rules)
            kept = tree.decay[min(steps, tree.decay.size - 1)]
            row, col, heading = jump(row, col, heading, action - 4, land, aims)
        else:
            reward, kept = 0.0, 1.0
            arrived = False
            while not arrived:
                move, arrived = trip_move(row, col, heading, action - 4, land, mass, sight, aims)
                row += row_step(move)
                col += col_step(move)
                heading = move
                gain = gain_at(row, col, heading, land.rows, land.cols, mass, sight)
                reward += kept * (rules.scale * gain - rules.penalty)
                kept *= rules.discount
                if mass.fades:
                    logged = fade_at(row, col, heading, land.rows, land.cols, mass, sight, logged)
        tree.trail[depth, 0] = node
        tree.trail[depth, 1] = action
        tree.trail[depth, 2] = reward
        tree.trail[depth, 3] = kept
        below = tree.child[node, action]
        if below < 0:
            if nodes < tree.child.shape[0]:
                tree.child[node, action] = nodes
                expand(nodes, row, col, tree, land, mass, sight, aims, rules)
                nodes += 1
            return nodes, depth + 1, row, col, heading, logged
        node = below
    return nodes, tree.trail.shape[0], row, col, heading, logged


@inlined
def ascend(depth: int, value: float, tree: Tree, rules: Rules) -> None:
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
    nodes: int,
    iterations: int,
    row: int,
    col: int,
    heading: int,
    tree: Tree,
    land: Land,
    mass: Mass,
    sight: Sight,
    aims: Aims,
    rules: Rules,
    state: NDArray[np.uint64],
) -> int:
    """Search on from a tree of `nodes`, 0 for a new one; how many nodes there are afterwards."""
    if nodes == 0:
        tree.span[LOW], tree.span[HIGH] = np.inf, -np.inf
        expand(0, row, col, tree, land, mass, sight, aims, rules)
        nodes = 1
    for _ in range(iterations):
        nodes, depth, at_row, at_col, facing, logged = descend(
            nodes, row, col, heading, tree, land, mass, sight, aims, rules
        )
        value, logged = roll_out(at_row, at_col, facing, land, mass, sight, rules, state, logged)
        restore(mass, logged)
        ascend(depth, value, tree, rules)
    return nodes
