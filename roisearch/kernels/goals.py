"""Which cell of a region an option goes to: its most probable one, or the one most worth its distance."""

from __future__ import annotations

from roisearch.kernels.compiled import kernel
from roisearch.kernels.ground import find_sources, open_steps
from roisearch.kernels.records import FAR, Floats, Forest, Ints, Land, Pose, Ranging, Sight, Steps


@kernel
def steps_from(row: int, col: int, goal: int, land: Land, sight: Sight, forward: Steps, sources: Ints) -> int:
    """Steps from (row, col) until `goal` has been looked at; `forward` as in `Ranging`."""
    count = 0
    if forward.size > 0 or not sight.is_point:
        count = find_sources(goal, land, sight, sources)
    if forward.size == 0:
        return open_steps(row, col, goal // land.cols, goal % land.cols, sources, count, sight)
    least = FAR
    for i in range(count):
        least = min(least, int(forward[sources[i, 0]]) + 1)
    return least


@kernel
def index_cell(
    root: int,
    pose: Pose,
    weights: Floats,
    forest: Forest,
    land: Land,
    sight: Sight,
    ranging: Ranging,
    sources: Ints,
) -> tuple[int, float]:
    """The cell below `root` with the largest weight * worth[steps], and that score; (-1, 0) without any.

    With worth[steps] = steps ** (-1 / alpha) this is the argmax of m ** alpha / steps. Branch and bound: a node is
    skipped when even its peak, as near as its box and the sensor's reach allow, is no better than the best cell so
    far. `sources` [4 k, 3] is room.
    """
    row, col = pose.row, pose.col
    worth, reach, stack = ranging.worth, ranging.reach, ranging.stack
    best, best_cell = 0.0, -1
    far = worth.size - 1
    box = forest.box
    top = 0
    stack[0] = root
    while top >= 0:
        node = stack[top]
        top -= 1
        apart = max(box[node, 0] - row, 0, row - box[node, 1]) + max(
            box[node, 2] - col, 0, col - box[node, 3]
        )
        if forest.peaks[node] * worth[min(max(apart - reach, 1), far)] <= best:
            continue
        if node * 16 >= forest.cell_of.size:
            for child in range(forest.last[node] - 1, forest.first[node] - 1, -1):
                top += 1
                stack[top] = child
            continue
        for slot in range(node * 16, node * 16 + 16):
            cell = forest.cell_of[slot]
            if cell < 0:
                break
            apart = max(abs(cell // land.cols - row) + abs(cell % land.cols - col) - reach, 1)
            if weights[cell] * worth[min(apart, far)] <= best:
                continue
            steps = steps_from(row, col, cell, land, sight, ranging.forward, sources)
            score = weights[cell] * worth[min(steps, far)] if steps < FAR else 0.0
            if score > best:
                best, best_cell = score, cell
    return best_cell, best
