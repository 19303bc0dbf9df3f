"""A target that walks from cell to cell: one tick of a random walk with stops on a map of mobilities.

In a tick the target steps from a cell to each of its four neighbours with the chance that stands in `into` for the
neighbour, and so stays with what is left of one; where it is after the tick it stops for good with the chance `stops`.
Cells with `into` at zero are closed: nobody steps into them, and whoever is in one stays. Maps have a frame of closed
cells one wide, so that borders reflect and need no test.

Every cell sums up its four neighbours in one order, so that all machines get the same bits.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from roisearch.kernels.compiled import kernel

Floats = NDArray[np.float64]
Map = NDArray[np.float64]


class Room(NamedTuple):
    """Where a walk is reckoned: two framed maps, float [rows + 2, cols + 2], the first with who walks now."""

    now: Map
    then: Map


@kernel
def set_out(weights: Floats, going: Floats, room: Room) -> None:
    """Put those who walk, `weights` [cells] times `going` ([cells], or [0] for all), on the framed map `room.now`.

    `weights` keeps those who do not. The frames are filled with zeros.
    """
    rows, cols = room.now.shape[0] - 2, room.now.shape[1] - 2
    for each in (room.now, room.then):
        for row in range(rows + 2):
            each[row, 0] = each[row, cols + 1] = 0.0
        for col in range(cols + 2):
            each[0, col] = each[rows + 1, col] = 0.0
    for row in range(rows):
        for col in range(cols):
            cell = row * cols + col
            walks = weights[cell] * going[cell] if going.size > 0 else weights[cell]
            room.now[row + 1, col + 1] = walks
            weights[cell] -= walks


@kernel
def tick(weights: Floats, into: Map, stops: float, room: Room) -> None:
    """One tick of those on `room.now`, to `room.then`; those who stop are added to `weights` [cells].

    `into`: the chance to step into each cell, float [rows + 2, cols + 2] with a frame of zeros, at most 1/4.
    """
    now, then = room.now, room.then
    rows, cols = now.shape[0] - 2, now.shape[1] - 2
    for row in range(1, rows + 1):
        for col in range(1, cols + 1):
            here = now[row, col]
            chance = into[row, col]
            north, west, east, south = (
                into[row - 1, col],
                into[row, col - 1],
                into[row, col + 1],
                into[row + 1, col],
            )
            come = _come(now[row - 1, col], north) + _come(now[row, col - 1], west)
            come += _come(now[row, col + 1], east) + _come(now[row + 1, col], south)
            left = here * (1.0 - (north + west + east + south)) if chance > 0.0 else here
            then[row, col] = left + chance * come
    if stops > 0.0:
        for row in range(1, rows + 1):
            for col in range(1, cols + 1):
                stopped = then[row, col] * stops
                then[row, col] -= stopped
                weights[(row - 1) * cols + col - 1] += stopped


@kernel
def _come(weight: float, chance: float) -> float:
    """Who may come from a neighbour: nobody leaves a closed cell."""
    return weight if chance > 0.0 else 0.0


@kernel
def arrive(weights: Floats, going: Floats, room: Room) -> None:
    """Add those on `room.now` to `weights` [cells]; `going` [cells], if it is not [0], is what part of each walks."""
    rows, cols = room.now.shape[0] - 2, room.now.shape[1] - 2
    for row in range(rows):
        for col in range(cols):
            cell = row * cols + col
            walks = room.now[row + 1, col + 1]
            weights[cell] += walks
            if going.size > 0:
                going[cell] = min(1.0, walks / weights[cell]) if weights[cell] > 0.0 else 1.0
