"""Moving on the map: steps to the nearest pose that sees a goal, around obstacles when there are any.

The goal of a trip is to *look at* a cell, not to stand on it: a donut never sees the cell below it, and a cell
that must not be entered can still be seen from beside. The heading is the direction of the last move, so what
counts is the move that ends the trip: a *source* of goal g is a cell x from which some legal move h arrives at
a cell where g is in the field of view. The trip from a cell takes one step if it is a source, and otherwise
one more than from its best neighbour. On open ground that is 1 + the least Manhattan distance to a source; with
obstacles it is a breadth-first search from the sources, kept in `fields` [goals, cells].

`legal` [cells] has bit h set when the move h (0 north, 1 east, 2 south, 3 west) stays on flyable ground.
`offsets` [4, k, 2] is the field of view by heading.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from roisearch.kernels.compiled import kernel

FAR = 1 << 30
"""The distance of what cannot be reached."""


@kernel
def moved(cell: int, move: int, cols: int) -> int:
    """The cell after a legal move."""
    if move == 0:
        return cell - cols
    if move == 1:
        return cell + 1
    if move == 2:
        return cell + cols
    return cell - 1


@kernel
def sees(cell: int, heading: int, goal: int, cols: int, offsets: NDArray[np.int64]) -> bool:
    """Whether `goal` is in the field of view from `cell`."""
    dr = goal // cols - cell // cols
    dc = goal % cols - cell % cols
    for i in range(offsets.shape[1]):
        if offsets[heading, i, 0] == dr and offsets[heading, i, 1] == dc:
            return True
    return False


@kernel
def find_sources(
    goal: int, legal: NDArray[np.uint8], cols: int, offsets: NDArray[np.int64], sources: NDArray[np.int64]
) -> int:
    """Write the sources of `goal` into `sources` [4 k]; how many there are."""
    rows = legal.size // cols
    count = 0
    for heading in range(4):
        back_row = 1 if heading == 0 else (-1 if heading == 2 else 0)
        back_col = -1 if heading == 1 else (1 if heading == 3 else 0)
        for i in range(offsets.shape[1]):
            row = goal // cols - offsets[heading, i, 0] + back_row
            col = goal % cols - offsets[heading, i, 1] + back_col
            if 0 <= row < rows and 0 <= col < cols and legal[row * cols + col] >> heading & 1:
                sources[count] = row * cols + col
                count += 1
    return count


@kernel
def flood(
    sources: NDArray[np.int64],
    count: int,
    start: int,
    legal: NDArray[np.uint8],
    cols: int,
    field: NDArray[np.int32],
    queue: NDArray[np.int64],
) -> None:
    """Breadth-first search: `field` [cells] becomes `start` at the sources and one more for each step away."""
    field[:] = FAR
    tail = 0
    for i in range(count):
        if field[sources[i]] == FAR:
            field[sources[i]] = start
            queue[tail] = sources[i]
            tail += 1
    head = 0
    while head < tail:
        cell = queue[head]
        head += 1
        for move in range(4):
            if legal[cell] >> move & 1:
                near = moved(cell, move, cols)
                if field[near] == FAR:
                    field[near] = field[cell] + 1
                    queue[tail] = near
                    tail += 1


@kernel
def steps_to(
    cell: int,
    goal: int,
    index: int,
    cols: int,
    is_point: bool,
    sources: NDArray[np.int64],
    count: int,
    fields: NDArray[np.int32],
) -> int:
    """Steps from `cell` until `goal` has been looked at; FAR when it cannot be.

    `fields` [goals, cells] is empty on open ground; `index` is the goal's place in it.
    """
    if fields.shape[0] > 0:
        return int(fields[index, cell])
    row, col = cell // cols, cell % cols
    if is_point:
        apart = abs(goal // cols - row) + abs(goal % cols - col)
        return apart if apart > 0 else 2
    least = FAR
    for i in range(count):
        apart = abs(sources[i] // cols - row) + abs(sources[i] % cols - col)
        least = min(least, apart + 1)
    return least
