"""The eight directions of the grid, and which moves the ground allows in them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

DIRECTIONS = ("north", "north-east", "east", "south-east", "south", "south-west", "west", "north-west")
STEPS = ((-1, 0), (-1, 1), (0, 1), (1, 1), (1, 0), (1, -1), (0, -1), (-1, -1))
"""Row and column step of each direction, in the order of DIRECTIONS; those with an odd place are diagonal."""

_INDEX = {step: i for i, step in enumerate(STEPS)}


def direction_index(direction: str) -> int:
    """The place of `direction` in DIRECTIONS; ValueError when it is none of them."""
    try:
        return DIRECTIONS.index(direction)
    except ValueError:
        raise ValueError(f"a direction is one of {', '.join(DIRECTIONS)}, not '{direction}'") from None


def direction_between(here: tuple[int, int], there: tuple[int, int]) -> str:
    """The direction of one move; ValueError when the cells are not neighbours, corners included."""
    step = (there[0] - here[0], there[1] - here[1])
    if step not in _INDEX:
        raise ValueError(f"cells {here} and {there} are not neighbours, a path enters one after another")
    return DIRECTIONS[_INDEX[step]]


def moves_allowed(flyable: NDArray[np.bool_], diagonal: bool = True) -> NDArray[np.uint8]:
    """In which directions each cell can be left, uint8 [rows, cols]: bit d is set for DIRECTIONS[d].

    A diagonal move needs both cells beside it flyable as well: no corner of what must not be flown over is cut.
    """
    rows, cols = flyable.shape
    padded = np.zeros((rows + 2, cols + 2), dtype=bool)
    padded[1:-1, 1:-1] = flyable
    allowed = np.zeros((rows, cols), dtype=np.uint8)
    for d, (down, right) in enumerate(STEPS):
        if d % 2 and not diagonal:
            continue
        open_ = flyable & padded[1 + down : 1 + down + rows, 1 + right : 1 + right + cols]
        if d % 2:
            open_ &= padded[1 + down : 1 + down + rows, 1:-1] & padded[1:-1, 1 + right : 1 + right + cols]
        allowed |= open_.astype(np.uint8) << d
    return allowed
