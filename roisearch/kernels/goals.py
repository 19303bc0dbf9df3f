"""Which cell of a region an option goes to: its most probable one, or the one most worth its distance."""

from __future__ import annotations

from roisearch.kernels.compiled import kernel
from roisearch.kernels.forest import peak_cell
from roisearch.kernels.ground import find_sources, flood, open_steps
from roisearch.kernels.records import FAR, PEAK_GOAL, Aims, Floats, Forest, Ints, Land, Sight, Steps


@kernel
def steps_from(row: int, col: int, goal: int, land: Land, sight: Sight, forward: Steps, sources: Ints) -> int:
    """Steps from (row, col) until `goal` has been looked at; `forward` [cells] as in `index_cell`."""
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
    row: int,
    col: int,
    weights: Floats,
    forest: Forest,
    land: Land,
    sight: Sight,
    reach: int,
    worth: Floats,
    forward: Steps,
    sources: Ints,
    stack: Ints,
) -> tuple[int, float]:
    """The cell below `root` with the largest weight * worth[steps], and that score; (-1, 0) without any.

    `worth` [steps] falls with the steps; steps ** (-1 / alpha) makes this the argmax of m ** alpha / steps.
    Branch and bound: a node is skipped when even its peak, as near as its box and the sensor's `reach` allow,
    is no better than the best cell so far. `forward` [cells], the steps from (row, col) around obstacles, is
    empty on open ground.
    """
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
            steps = steps_from(row, col, cell, land, sight, forward, sources)
            score = weights[cell] * worth[min(steps, far)] if steps < FAR else 0.0
            if score > best:
                best, best_cell = score, cell
    return best_cell, best


@kernel
def set_goals(
    rule: int,
    row: int,
    col: int,
    roots: Ints,
    weights: Floats,
    forest: Forest,
    land: Land,
    sight: Sight,
    reach: int,
    worth: Floats,
    forward: Steps,
    queue: Ints,
    field_goals: Ints,
    stack: Ints,
    aims: Aims,
) -> None:
    """Fill `aims`: each region's goal (-1: nothing to find), its sources, the way around obstacles.

    `field_goals` [regions] tells which goals the fields were made for: an unchanged goal keeps its field.
    """
    if forward.size > 0 and rule != PEAK_GOAL:
        stack[0] = row * land.cols + col
        flood(stack[:1], 0, land.legal, land.cols, forward, queue)
    for region in range(roots.size):
        goal = -1
        if roots[region] >= 0:
            if rule == PEAK_GOAL:
                goal = peak_cell(roots[region], weights, forest)
            else:
                goal, _ = index_cell(
                    roots[region], row, col, weights, forest, land, sight, reach, worth, forward,
                    aims.sources[region], stack,
                )  # fmt: skip
        aims.goals[region, 0] = goal
        if goal < 0:
            continue
        aims.goals[region, 1] = goal // land.cols
        aims.goals[region, 2] = goal % land.cols
        aims.counts[region] = find_sources(goal, land, sight, aims.sources[region])
        if aims.fields.shape[0] > 0 and goal != field_goals[region]:
            flood(
                aims.sources[region, : aims.counts[region], 0],
                1,
                land.legal,
                land.cols,
                aims.fields[region],
                queue,
            )
            field_goals[region] = goal
