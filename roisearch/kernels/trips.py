"""Options step by step: the shortest way to a look at the goal, by the cells that see most."""

from __future__ import annotations

from roisearch.kernels.compiled import inlined, kernel
from roisearch.kernels.ground import col_step, row_step, sees, steps_to
from roisearch.kernels.records import FAR, Aims, Ints, Land, Mass, Pose, Sight
from roisearch.kernels.sensing import gain_at


@inlined
def trip_move(pose: Pose, region: int, land: Land, mass: Mass, sight: Sight, aims: Aims) -> tuple[int, bool]:
    """The next move of the trip to the goal of `region`, and whether it ends there; (-1, False) if none.

    The nearest way, and of equally near ones the one that sees most; of equal ones again straight on, right,
    left, back, in this order.
    """
    goal_row, goal_col = aims.goals[region, 1], aims.goals[region, 2]
    legal = land.legal[pose.row * land.cols + pose.col]
    best, best_steps, best_gain = -1, FAR, -1.0
    for turn in range(4):
        move = (pose.heading + (turn ^ (turn >> 1))) & 3
        if not legal >> move & 1:
            continue
        near_row, near_col = pose.row + row_step(move), pose.col + col_step(move)
        steps = 0
        if not sees(near_row, near_col, move, goal_row, goal_col, sight):
            steps = steps_to(near_row, near_col, region, land.cols, aims, sight)
        if steps > best_steps or steps >= FAR:
            continue
        gain = gain_at(near_row, near_col, move, land.rows, land.cols, mass, sight)
        if steps < best_steps or gain > best_gain:
            best, best_steps, best_gain = move, steps, gain
    return best, best_steps == 0


@kernel
def walk_trip(
    pose: Pose,
    region: int,
    land: Land,
    mass: Mass,
    sight: Sight,
    aims: Aims,
    path: Ints,
) -> int:
    """Write rows and columns of the trip to the goal of `region` into `path` [2, n]; how many fitted."""
    length = 0
    arrived = False
    while not arrived and length < path.shape[1]:
        move, arrived = trip_move(pose, region, land, mass, sight, aims)
        if move < 0:
            break
        pose = Pose(pose.row + row_step(move), pose.col + col_step(move), move)
        path[0, length] = pose.row
        path[1, length] = pose.col
        length += 1
    return length
