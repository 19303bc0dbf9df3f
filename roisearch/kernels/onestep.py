"""The planners that look no further than one trip, one compiled call each: index rule, greedy horizon."""

from __future__ import annotations

import numpy as np

from roisearch.kernels.compiled import allocating_kernel, kernel
from roisearch.kernels.goals import index_cell
from roisearch.kernels.ground import col_step, find_sources, flood, row_step
from roisearch.kernels.records import Aims, Bits, Floats, Forest, Ints, Land, Mass, Sight, Steps
from roisearch.kernels.sensing import gain_at
from roisearch.kernels.trips import walk_trip


@allocating_kernel
def go_to(
    row: int,
    col: int,
    heading: int,
    goal: int,
    weights: Floats,
    land: Land,
    sight: Sight,
    field: Steps,
    queue: Ints,
    path: Ints,
) -> int:
    """Write the trip to a look at `goal` into `path`; how many cells. `field`: [1, cells], [0, ..] open."""
    sources = np.empty((1, 4 * sight.offsets.shape[1], 3), dtype=np.int64)
    count = find_sources(goal, land, sight, sources[0])
    if field.shape[0] > 0:
        flood(sources[0, :count, 0], 1, land.legal, land.cols, field[0], queue)
    goals = np.array([[goal, goal // land.cols, goal % land.cols]])
    nothing = np.zeros(1)
    aims = Aims(goals, sources, np.full(1, count), nothing, np.zeros((1, 2)), field)
    mass = Mass(weights, nothing, False, goals[0])
    return walk_trip(row, col, heading, 0, land, mass, sight, aims, path)


@allocating_kernel
def follow_index(
    cell: int,
    heading: int,
    weights: Floats,
    peaks: Floats,
    cell_of: Ints,
    first: Ints,
    last: Ints,
    box: Ints,
    roots: Ints,
    legal: Bits,
    cols: int,
    offsets: Ints,
    gains: Floats,
    is_point: bool,
    reach: int,
    worth: Floats,
    forward: Steps,
    field: Steps,
    queue: Ints,
    stack: Ints,
    scores: Floats,
    path: Ints,
) -> tuple[int, int, int]:
    """The region of the cell most worth its distance, that cell, and how many cells of `path` lead to it.

    `scores` [regions] becomes each region's best weight * worth[steps]; (-1, -1, 0) when there is
    nothing anywhere.
    """
    land = Land(legal, weights.size // cols, cols)
    sight = Sight(offsets, gains, gains, is_point)
    forest = Forest(cell_of, first, last, box, peaks)
    row, col = cell // cols, cell % cols
    sources = np.empty((4 * offsets.shape[1], 3), dtype=np.int64)
    if forward.size > 0:
        flood(np.full(1, cell), 0, legal, cols, forward, queue)
    best, goal = -1, -1
    for region in range(roots.size):
        scores[region] = 0.0
        if roots[region] < 0:
            continue
        there, scores[region] = index_cell(
            roots[region], row, col, weights, forest, land, sight, reach, worth, forward, sources, stack
        )
        if there >= 0 and (best < 0 or scores[region] > scores[best]):
            best, goal = region, there
    if best < 0:
        return -1, -1, 0
    return best, goal, go_to(row, col, heading, goal, weights, land, sight, field, queue, path)


@kernel
def follow_horizon(
    cell: int,
    heading: int,
    horizon: int,
    weights: Floats,
    legal: Bits,
    cols: int,
    offsets: Ints,
    gains: Floats,
    is_point: bool,
    window: Steps,
    queue: Ints,
    path: Ints,
) -> tuple[float, int]:
    """The best mass in view within `horizon` steps, and how many cells of `path` lead there; (0, 0) if none.

    Breadth-first over `window` [2 horizon + 1, 2 horizon + 1], straight on first, then right, left and back;
    a cell is valued as seen on arrival. Of equal values the one found first, so the nearest, wins. `window`
    holds the move by which each cell was first entered, -1 for none.
    """
    land = Land(legal, weights.size // cols, cols)
    sight = Sight(offsets, gains, gains, is_point)
    mass = Mass(weights, gains, False, queue)
    row, col = cell // cols, cell % cols
    window[:] = -1
    window[horizon, horizon] = heading
    queue[0], queue[1] = 0, 0
    head, tail, ring_end, steps = 0, 1, 1, 0
    best, best_row, best_col = 0.0, 0, 0
    while head < tail and steps < horizon:
        down, right = queue[2 * head], queue[2 * head + 1]
        head += 1
        facing = window[down + horizon, right + horizon]
        here = legal[(row + down) * cols + col + right]
        for turn in range(4):
            move = (facing + (turn ^ (turn >> 1))) & 3
            if not here >> move & 1:
                continue
            d, r = down + row_step(move), right + col_step(move)
            if window[d + horizon, r + horizon] >= 0:
                continue
            window[d + horizon, r + horizon] = move
            queue[2 * tail], queue[2 * tail + 1] = d, r
            tail += 1
            gain = gain_at(row + d, col + r, move, land.rows, cols, mass, sight)
            if gain > best:
                best, best_row, best_col = gain, d, r
        if head == ring_end:
            ring_end = tail
            steps += 1
    if best <= 0.0:
        return 0.0, 0
    length = 0
    d, r = best_row, best_col
    while d != 0 or r != 0:
        length += 1
        move = window[d + horizon, r + horizon]
        d -= row_step(move)
        r -= col_step(move)
    d, r = best_row, best_col
    for place in range(length - 1, -1, -1):
        path[0, place] = row + d
        path[1, place] = col + r
        move = window[d + horizon, r + horizon]
        d -= row_step(move)
        r -= col_step(move)
    return best, length
