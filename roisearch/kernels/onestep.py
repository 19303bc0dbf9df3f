"""The planners that look no further than one trip, one compiled call each: index rule, greedy horizon."""

from __future__ import annotations

import numpy as np

from roisearch.kernels.compiled import allocating_kernel, kernel
from roisearch.kernels.goals import index_cell
from roisearch.kernels.ground import col_step, find_sources, flood, row_step
from roisearch.kernels.groups import FOREST, LAND, RANGING, SIGHT
from roisearch.kernels.handover import Layout, array
from roisearch.kernels.records import Aims, Floats, Forest, Ints, Land, Mass, Pose, Ranging, Sight, Steps
from roisearch.kernels.sensing import gain_at
from roisearch.kernels.trips import walk_trip

INDEX = Layout(
    **FOREST,
    **LAND,
    **SIGHT,
    **RANGING,
    # see `go_to`, and [regions] room for the scores
    field=(np.int32, 2),
    scores=(np.float64, 1),
    path=(np.int64, 2),
)
HORIZON = Layout(
    # how far, and [2 horizon + 1, 2 horizon + 1] and [2 n] room for the moves and the cells on the way
    horizon=np.int64,
    window=(np.int32, 2),
    queue=(np.int64, 1),
    **LAND,
    **SIGHT,
    # [2, horizon] room for the cells to enter
    path=(np.int64, 2),
)
opened_index, opened_horizon = INDEX.opener(), HORIZON.opener()


@allocating_kernel
def go_to(
    pose: Pose, goal: int, weights: Floats, land: Land, sight: Sight, field: Steps, queue: Ints, path: Ints
) -> int:
    """Write the trip to a look at `goal` into `path`; how many cells. `field`: [1, cells], [0, ..] open."""
    sources = np.empty((1, 4 * sight.offsets.shape[1], 3), dtype=np.int64)
    count = find_sources(goal, land, sight, sources[0])
    if field.shape[0] > 0:
        flood(sources[0, :count, 0], 1, land.legal, land.cols, field[0], queue)
    goals = np.array([[goal, goal // land.cols, goal % land.cols]])
    nothing = np.zeros(1)
    aims = Aims(goals, sources, np.full(1, count), nothing, np.zeros((1, 2)), field, goals[0])
    mass = Mass(weights, nothing, False, goals[0])
    return walk_trip(pose, 0, land, mass, sight, aims, path)


@allocating_kernel
def follow_index(
    cell: int, heading: int, weights: Floats, peaks: Floats, parcel: int
) -> tuple[int, int, int]:
    """The region of the cell most worth its distance, that cell, and how many cells of `path` lead to it.

    `parcel` is what `INDEX` packed, of which `scores` becomes each region's best weight * worth[steps]; `peaks` are
    of the nodes of the forest. (-1, -1, 0) when there is nothing anywhere.
    """
    given = opened_index(parcel)
    cols, roots, scores = given.cols, array(given.roots), array(given.scores)
    land = Land(array(given.legal), weights.size // cols, cols)
    offsets, gains = array(given.offsets), array(given.gains)
    sight = Sight(offsets, gains, gains, given.is_point)
    forest = Forest(
        array(given.cell_of), array(given.first), array(given.last), array(given.box), roots, peaks
    )
    forward, queue = array(given.forward), array(given.queue)
    ranging = Ranging(array(given.worth), given.reach, forward, queue, array(given.stack))
    pose = Pose(cell // cols, cell % cols, heading)
    sources = np.empty((4 * offsets.shape[1], 3), dtype=np.int64)
    if forward.size > 0:
        flood(np.full(1, cell), 0, land.legal, cols, forward, queue)
    best, goal = -1, -1
    for region in range(roots.size):
        scores[region] = 0.0
        if roots[region] < 0:
            continue
        there, scores[region] = index_cell(
            roots[region], pose, weights, forest, land, sight, ranging, sources
        )
        if there >= 0 and (best < 0 or scores[region] > scores[best]):
            best, goal = region, there
    if best < 0:
        return -1, -1, 0
    path = array(given.path)
    return best, goal, go_to(pose, goal, weights, land, sight, array(given.field), queue, path)


@kernel
def follow_horizon(cell: int, heading: int, weights: Floats, parcel: int) -> tuple[float, int]:
    """The best mass in view within the horizon, and how many cells of `path` lead there; (0, 0) if none.

    `parcel` is what `HORIZON` packed. Breadth-first over the window, straight on first, then right, left and back; a
    cell is valued as seen on arrival. Of equal values the one found first, so the nearest, wins. The window holds the
    move by which each cell was first entered, -1 for none.
    """
    given = opened_horizon(parcel)
    cols, legal, horizon = given.cols, array(given.legal), given.horizon
    gains, window = array(given.gains), array(given.window)
    queue, path = array(given.queue), array(given.path)
    land = Land(legal, weights.size // cols, cols)
    sight = Sight(array(given.offsets), gains, gains, given.is_point)
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
