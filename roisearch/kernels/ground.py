"""Moving on the map: steps to the nearest pose that sees a goal, around obstacles when there are any.

The goal of a trip is to *look at* a cell, not to stand on it: a donut never sees the cell below it, and a
cell that must not be entered can still be seen from beside. The heading is the direction of the last move, so
what counts is the move that ends the trip: a *source* of goal g is a cell from which some legal move arrives
where g is in the field of view. The trip from a cell takes one step if it is a source, and otherwise one more
than from its best neighbour. On open ground that is 1 + the least Manhattan distance to a source; with
obstacles it is a breadth-first search from the sources, kept in `Aims.fields`.
"""

from __future__ import annotations

from roisearch.kernels.compiled import inlined, kernel
from roisearch.kernels.records import FAR, Aims, Bits, Ints, Land, Sight, Steps


@inlined
def row_step(move: int) -> int:
    """Rows down by a move."""
    return move - 1 if move & 1 == 0 else 0


@inlined
def col_step(move: int) -> int:
    """Columns to the right by a move."""
    return 2 - move if move & 1 == 1 else 0


@inlined
def cell_step(move: int, cols: int) -> int:
    """What a move adds to a cell's number."""
    return 2 - move if move & 1 == 1 else (move - 1) * cols


@inlined
def sees(row: int, col: int, heading: int, goal_row: int, goal_col: int, sight: Sight) -> bool:
    """Whether the goal is in the field of view from (row, col)."""
    if sight.is_point:
        return row == goal_row and col == goal_col
    for i in range(sight.offsets.shape[1]):
        if sight.offsets[heading, i, 0] == goal_row - row and sight.offsets[heading, i, 1] == goal_col - col:
            return True
    return False


@kernel
def find_sources(goal: int, land: Land, sight: Sight, sources: Ints) -> int:
    """Write the sources of `goal` into `sources` [4 k, 3] (cell, row, column); how many there are."""
    count = 0
    for heading in range(4):
        for i in range(sight.offsets.shape[1]):
            row = goal // land.cols - sight.offsets[heading, i, 0] - row_step(heading)
            col = goal % land.cols - sight.offsets[heading, i, 1] - col_step(heading)
            if not (0 <= row < land.rows and 0 <= col < land.cols):
                continue
            cell = row * land.cols + col
            if land.legal[cell] >> heading & 1:
                sources[count, 0] = cell
                sources[count, 1] = row
                sources[count, 2] = col
                count += 1
    return count


@kernel
def flood(sources: Ints, start: int, legal: Bits, cols: int, field: Steps, queue: Ints) -> None:
    """Breadth-first search: `field` [cells] is `start` at the `sources` [n], one more for each step away."""
    field[:] = FAR
    tail = 0
    for cell in sources:
        if field[cell] == FAR:
            field[cell] = start
            queue[tail] = cell
            tail += 1
    head = 0
    while head < tail:
        cell = queue[head]
        head += 1
        for move in range(4):
            if legal[cell] >> move & 1:
                near = cell + cell_step(move, cols)
                if field[near] == FAR:
                    field[near] = field[cell] + 1
                    queue[tail] = near
                    tail += 1


@inlined
def open_steps(
    row: int, col: int, goal_row: int, goal_col: int, sources: Ints, count: int, sight: Sight
) -> int:
    """Steps on open ground until the goal has been looked at; FAR when no pose sees it."""
    if sight.is_point:
        apart = abs(goal_row - row) + abs(goal_col - col)
        return apart if apart > 0 else 2
    least = FAR
    for i in range(count):
        least = min(least, abs(sources[i, 1] - row) + abs(sources[i, 2] - col) + 1)
    return least


@inlined
def steps_to(row: int, col: int, region: int, cols: int, aims: Aims, sight: Sight) -> int:
    """Steps until the goal of `region` has been looked at; FAR when it cannot be."""
    if aims.fields.shape[0] > 0:
        return int(aims.fields[region, row * cols + col])
    return open_steps(
        row,
        col,
        aims.goals[region, 1],
        aims.goals[region, 2],
        aims.sources[region],
        aims.counts[region],
        sight,
    )
