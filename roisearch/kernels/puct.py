"""PUCT over the three models of the search problem, one compiled function a step of the algorithm.

A search is `search`: for each iteration walk down the tree by the PUCT score, take one new node, follow a
rollout from it, and carry the return back up. Actions 0-3 are the moves, 4 + k is the option to go to the goal
of region k (k = 0: the ground outside all regions); a model without options has four actions.

What differs between the models is read from `flags` and `rates`, so that one compiled solver serves all:

    flat MDP      4 moves, mass seen in the tree fades or not
    BMDP-O        options collect (gain - d) along their trip; what was seen fades by 1 - p_tp in the tree
                  (the paper's approximation) and is restored after the iteration
    lite MDP-O    options pay f * mean mass / (A^2 * distance to the centroid); nothing fades

The tree is a struct of arrays, [nodes, actions] each; the fading is an overlay, `fade` [cells], one where
nothing was seen, because the belief's own weights are read by others while the search runs.

Random numbers come from one 64-bit linear congruential generator (Knuth's MMIX constants), seeded by the
caller's generator; a move is its top two bits.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from roisearch.kernels.compiled import kernel
from roisearch.kernels.ground import FAR, moved, sees, steps_to

# flags, int64
ITERATIONS, ROLLOUT, ROLLOUT_POLICY, FADES, OPTION_REWARD, BACKUP, NORMALISE, PRIOR, CHOOSE, DEPTH = range(10)
RANDOM, REPEAT, STEEPEST = range(3)  # ROLLOUT_POLICY
DENSITY, TRIP = range(2)  # OPTION_REWARD
MEAN, MAX = range(2)  # BACKUP
UNIFORM, REWARDS, INDEXED = range(3)  # PRIOR
VISITS, VALUE = range(2)  # CHOOSE
# rates, float64
EXPLORE, DISCOUNT, PENALTY, DENSITY_FACTOR, SCALE, ALPHA, FLOOR = range(7)
# stats [nodes, actions, 3]
P_A, WORTH, N_A = range(3)
# range [2] of the values seen so far
LOW, HIGH = range(2)


@kernel
def gain_at(
    cell: int,
    heading: int,
    weights: NDArray[np.float64],
    fade: NDArray[np.float64],
    fades: bool,
    cols: int,
    offsets: NDArray[np.int64],
    gains: NDArray[np.float64],
) -> float:
    """The mass in the field of view, each cell times its gain."""
    rows = weights.size // cols
    row, col = cell // cols, cell % cols
    total = 0.0
    for i in range(offsets.shape[1]):
        r = row + offsets[heading, i, 0]
        c = col + offsets[heading, i, 1]
        if 0 <= r < rows and 0 <= c < cols:
            seen = r * cols + c
            if fades:
                total += gains[i] * (weights[seen] * fade[seen])
            else:
                total += gains[i] * weights[seen]
    return total


@kernel
def fade_at(
    cell: int,
    heading: int,
    fade: NDArray[np.float64],
    cols: int,
    offsets: NDArray[np.int64],
    miss: NDArray[np.float64],
    log: NDArray[np.int64],
    logged: int,
) -> int:
    """Let what is seen from here fade by 1 - p_tp; the cells go into `log`. How many are logged now."""
    rows = fade.size // cols
    row, col = cell // cols, cell % cols
    for i in range(offsets.shape[1]):
        r = row + offsets[heading, i, 0]
        c = col + offsets[heading, i, 1]
        if 0 <= r < rows and 0 <= c < cols and logged < log.size:
            fade[r * cols + c] *= miss[i]
            log[logged] = r * cols + c
            logged += 1
    return logged


@kernel
def draw(state: NDArray[np.uint64]) -> int:
    """A number from 0 to 3."""
    state[0] = state[0] * np.uint64(6364136223846793005) + np.uint64(1442695040888963407)
    return np.int64(state[0] >> np.uint64(62))  # type: ignore[return-value]


@kernel
def trip_move(
    cell: int,
    heading: int,
    option: int,
    goal: int,
    weights: NDArray[np.float64],
    fade: NDArray[np.float64],
    fades: bool,
    legal: NDArray[np.uint8],
    cols: int,
    offsets: NDArray[np.int64],
    gains: NDArray[np.float64],
    is_point: bool,
    sources: NDArray[np.int64],
    counts: NDArray[np.int64],
    fields: NDArray[np.int32],
) -> tuple[int, bool]:
    """The next move of the trip to `goal`, and whether it ends there; (-1, False) when there is no way.

    The nearest way, and of equally near ones the one that sees most; straight on when that is equal too.
    """
    best, best_steps, best_gain = -1, FAR, -1.0
    for turn in range(4):
        move = (heading + (turn ^ (turn >> 1))) & 3  # straight on, right, left, back
        if not legal[cell] >> move & 1:
            continue
        near = moved(cell, move, cols)
        if sees(near, move, goal, cols, offsets):
            steps = 0
        else:
            steps = steps_to(near, goal, option, cols, is_point, sources[option], counts[option], fields)
        if steps > best_steps or steps >= FAR:
            continue
        gain = gain_at(near, move, weights, fade, fades, cols, offsets, gains)
        if steps < best_steps or gain > best_gain:
            best, best_steps, best_gain = move, steps, gain
    return best, best_steps == 0


@kernel
def expand(
    node: int,
    cell: int,
    flags: NDArray[np.int64],
    rates: NDArray[np.float64],
    child: NDArray[np.int32],
    stats: NDArray[np.float64],
    weights: NDArray[np.float64],
    fade: NDArray[np.float64],
    legal: NDArray[np.uint8],
    cols: int,
    offsets: NDArray[np.int64],
    gains: NDArray[np.float64],
    is_point: bool,
    goals: NDArray[np.int64],
    sources: NDArray[np.int64],
    counts: NDArray[np.int64],
    means: NDArray[np.float64],
    centroids: NDArray[np.float64],
    fields: NDArray[np.int32],
) -> None:
    """Make `node`: no children yet, and P(a) of each action from the one-step rewards; -1 marks an illegal one."""
    actions = stats.shape[1]
    least, most = np.inf, -np.inf
    for a in range(actions):
        child[node, a] = -1
        stats[node, a, WORTH] = 0.0
        stats[node, a, N_A] = 0.0
        hope = -np.inf
        if a < 4:
            if legal[cell] >> a & 1:
                gain = gain_at(
                    moved(cell, a, cols), a, weights, fade, flags[FADES] == 1, cols, offsets, gains
                )
                hope = rates[SCALE] * gain - rates[PENALTY]
                if flags[PRIOR] == INDEXED:
                    hope = (rates[SCALE] * gain) ** rates[ALPHA]
        elif goals[a - 4] >= 0:
            steps = steps_to(cell, goals[a - 4], a - 4, cols, is_point, sources[a - 4], counts[a - 4], fields)
            if steps < FAR:
                if flags[PRIOR] == INDEXED:
                    seen = goals[a - 4]
                    mass = weights[seen] * fade[seen] if flags[FADES] == 1 else weights[seen]
                    hope = (rates[SCALE] * gains[0] * mass) ** rates[ALPHA] / steps
                else:
                    hope = density(cell, a - 4, rates, cols, means, centroids)
        stats[node, a, P_A] = hope
        if hope > -np.inf:
            least = min(least, hope)
            most = max(most, hope)
    total = 0.0
    for a in range(actions):
        hope = stats[node, a, P_A]
        if hope == -np.inf:
            stats[node, a, P_A] = -1.0
            continue
        share = 1.0
        if flags[PRIOR] != UNIFORM and most > least:
            share = rates[FLOOR] + (hope - least) / (most - least)
        stats[node, a, P_A] = share
        total += share
    for a in range(actions):
        if stats[node, a, P_A] > 0.0:
            stats[node, a, P_A] /= total


@kernel
def density(
    cell: int,
    region: int,
    rates: NDArray[np.float64],
    cols: int,
    means: NDArray[np.float64],
    centroids: NDArray[np.float64],
) -> float:
    """The paper's reward of an option in the lite model: f * mean mass / (A^2 * distance to the centroid)."""
    apart = abs(centroids[region, 0] - cell // cols) + abs(centroids[region, 1] - cell % cols)
    return float(rates[DENSITY_FACTOR] * rates[SCALE] * means[region] / max(apart, 1.0))


@kernel
def select(
    node: int,
    flags: NDArray[np.int64],
    rates: NDArray[np.float64],
    stats: NDArray[np.float64],
    span: NDArray[np.float64],
) -> int:
    """The action with the best PUCT score: Q + c P sqrt(N + 1) / (1 + n), Q from 0 to 1 over the tree's values."""
    visits = 0.0
    for a in range(stats.shape[1]):
        visits += stats[node, a, N_A]
    root = rates[EXPLORE] * np.sqrt(visits + 1.0)
    best, best_score = -1, -np.inf
    for a in range(stats.shape[1]):
        p, worth, n = stats[node, a, P_A], stats[node, a, WORTH], stats[node, a, N_A]
        if p < 0.0:
            continue
        if flags[NORMALISE] == 0:
            q = worth / (1.0 + n)
        elif n == 0.0 or span[HIGH] <= span[LOW]:
            q = 0.0
        else:
            q = ((worth / n if flags[BACKUP] == MEAN else worth) - span[LOW]) / (span[HIGH] - span[LOW])
        score = q + root * p / (1.0 + n)
        if score > best_score:
            best, best_score = a, score
    return best


@kernel
def roll_out(
    cell: int,
    heading: int,
    steps: int,
    state: NDArray[np.uint64],
    flags: NDArray[np.int64],
    rates: NDArray[np.float64],
    weights: NDArray[np.float64],
    fade: NDArray[np.float64],
    legal: NDArray[np.uint8],
    cols: int,
    offsets: NDArray[np.int64],
    gains: NDArray[np.float64],
    miss: NDArray[np.float64],
    log: NDArray[np.int64],
    logged: int,
) -> tuple[float, int]:
    """The discounted return of `steps` moves by the rollout policy, and how many cells are logged now."""
    policy = flags[ROLLOUT_POLICY]
    fades = flags[FADES] == 1
    total, weight = 0.0, 1.0
    repeated = draw(state) if policy == REPEAT else np.int64(0)
    for _ in range(steps):
        gain = -1.0
        if policy == STEEPEST:
            move = -1
            for turn in range(4):
                option = (heading + (turn ^ (turn >> 1))) & 3  # straight on, right, left, back
                if legal[cell] >> option & 1:
                    there = gain_at(
                        moved(cell, option, cols), option, weights, fade, fades, cols, offsets, gains
                    )
                    if there > gain:
                        move, gain = option, there
        elif policy == RANDOM:
            move = draw(state)
            while not legal[cell] >> move & 1:
                move = draw(state)
        else:
            move = repeated
            if not legal[cell] >> move & 1:
                break
        cell = moved(cell, move, cols)
        heading = move
        if policy != STEEPEST:
            gain = gain_at(cell, heading, weights, fade, fades, cols, offsets, gains)
        total += weight * (rates[SCALE] * gain - rates[PENALTY])
        weight *= rates[DISCOUNT]
        if fades:
            logged = fade_at(cell, heading, fade, cols, offsets, miss, log, logged)
    return total, logged


@kernel
def search(
    cell: int,
    heading: int,
    nodes: int,
    iterations: int,
    state: NDArray[np.uint64],
    flags: NDArray[np.int64],
    rates: NDArray[np.float64],
    span: NDArray[np.float64],
    child: NDArray[np.int32],
    stats: NDArray[np.float64],
    trail: NDArray[np.float64],
    weights: NDArray[np.float64],
    fade: NDArray[np.float64],
    log: NDArray[np.int64],
    legal: NDArray[np.uint8],
    cols: int,
    offsets: NDArray[np.int64],
    gains: NDArray[np.float64],
    miss: NDArray[np.float64],
    is_point: bool,
    goals: NDArray[np.int64],
    sources: NDArray[np.int64],
    counts: NDArray[np.int64],
    means: NDArray[np.float64],
    centroids: NDArray[np.float64],
    fields: NDArray[np.int32],
) -> int:
    """Search from `cell`; call it again with the returned number of nodes to go on with the same tree.

    Args:
        nodes: nodes in the tree so far; 0 starts a new one. A full tree is searched on without growing.
        child: [nodes, actions], the child node or -1. stats: [nodes, actions, 3], P(a), sum or best of the
            returns, visits. trail: [depth, 4], the way down: node, action, reward, discount of its steps.
        goals, counts, means: [regions]; sources: [regions, 4 k]; centroids: [regions, 2].
    """
    fades = flags[FADES] == 1
    if nodes == 0:
        span[LOW], span[HIGH] = np.inf, -np.inf
        expand(0, cell, flags, rates, child, stats, weights, fade, legal, cols, offsets, gains, is_point, goals,
               sources, counts, means, centroids, fields)  # fmt: skip
        nodes = 1
    for _ in range(iterations):
        node, at, facing, depth, logged = 0, cell, heading, 0, 0
        while depth < trail.shape[0]:
            action = select(node, flags, rates, stats, span)
            if action < 4:
                at = moved(at, action, cols)
                facing = action
                reward = (
                    rates[SCALE] * gain_at(at, facing, weights, fade, fades, cols, offsets, gains)
                    - rates[PENALTY]
                )
                kept = rates[DISCOUNT]
                if fades:
                    logged = fade_at(at, facing, fade, cols, offsets, miss, log, logged)
            elif flags[OPTION_REWARD] == DENSITY:
                goal = goals[action - 4]
                steps = steps_to(
                    at, goal, action - 4, cols, is_point, sources[action - 4], counts[action - 4], fields
                )
                reward = density(at, action - 4, rates, cols, means, centroids)
                kept = rates[DISCOUNT] ** steps
                down, right = goal // cols - at // cols, goal % cols - at % cols
                if abs(down) > abs(right):
                    facing = 2 if down > 0 else 0
                elif right != 0:
                    facing = 1 if right > 0 else 3
                if legal[goal] != 0:
                    at = goal
                else:
                    at = (
                        moved(sources[action - 4, 0], 0, cols)
                        if legal[sources[action - 4, 0]] & 1
                        else sources[action - 4, 0]
                    )
            else:
                goal = goals[action - 4]
                reward, kept = 0.0, 1.0
                arrived = False
                while not arrived:
                    move, arrived = trip_move(
                        at, facing, action - 4, goal, weights, fade, fades, legal, cols, offsets, gains, is_point,
                        sources, counts, fields,
                    )  # fmt: skip
                    if move < 0:
                        break
                    at = moved(at, move, cols)
                    facing = move
                    gain = gain_at(at, facing, weights, fade, fades, cols, offsets, gains)
                    reward += kept * (rates[SCALE] * gain - rates[PENALTY])
                    kept *= rates[DISCOUNT]
                    if fades:
                        logged = fade_at(at, facing, fade, cols, offsets, miss, log, logged)
            trail[depth, 0] = node
            trail[depth, 1] = action
            trail[depth, 2] = reward
            trail[depth, 3] = kept
            depth += 1
            below = child[node, action]
            if below < 0:
                if nodes < child.shape[0]:
                    child[node, action] = nodes
                    expand(nodes, at, flags, rates, child, stats, weights, fade, legal, cols, offsets, gains,
                           is_point, goals, sources, counts, means, centroids, fields)  # fmt: skip
                    nodes += 1
                break
            node = below
        value, logged = roll_out(
            at, facing, flags[ROLLOUT], state, flags, rates, weights, fade, legal, cols, offsets, gains, miss, log,
            logged,
        )  # fmt: skip
        for i in range(logged):
            fade[log[i]] = 1.0
        for step in range(depth - 1, -1, -1):
            node, action = int(trail[step, 0]), int(trail[step, 1])
            value = trail[step, 2] + trail[step, 3] * value
            n = stats[node, action, N_A]
            if flags[BACKUP] == MEAN:
                stats[node, action, WORTH] += value
                shown = stats[node, action, WORTH] / (n + 1.0)
            else:
                stats[node, action, WORTH] = value if n == 0.0 else max(value, stats[node, action, WORTH])
                shown = stats[node, action, WORTH]
            stats[node, action, N_A] = n + 1.0
            span[LOW] = min(span[LOW], shown)
            span[HIGH] = max(span[HIGH], shown)
    return nodes


@kernel
def walk_option(
    cell: int,
    heading: int,
    option: int,
    goal: int,
    weights: NDArray[np.float64],
    fade: NDArray[np.float64],
    legal: NDArray[np.uint8],
    cols: int,
    offsets: NDArray[np.int64],
    gains: NDArray[np.float64],
    is_point: bool,
    sources: NDArray[np.int64],
    counts: NDArray[np.int64],
    fields: NDArray[np.int32],
    path: NDArray[np.int64],
) -> int:
    """Write the cells of the trip to `goal` into `path`; how many there are (as many as fit)."""
    length = 0
    arrived = False
    while not arrived and length < path.size:
        move, arrived = trip_move(
            cell, heading, option, goal, weights, fade, False, legal, cols, offsets, gains, is_point, sources,
            counts, fields,
        )  # fmt: skip
        if move < 0:
            break
        cell = moved(cell, move, cols)
        heading = move
        path[length] = cell
        length += 1
    return length
