"""Compiled loops of `roisearch.bounds.travelling`: the best walk, or flight, of a searcher that pays for its looks."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from roisearch.kernels.records import Floats, Ints


@njit(cache=True, nogil=True)
def best_walk(
    worth: Floats,
    price: Floats,
    flyable: NDArray[np.bool_],
    labels: Ints,
    start: tuple[int, int],
    fixed: Ints,
) -> float:
    """The most that a walk can earn when the k-th look at a cell may be bought as often as wanted.

    worth: float [rows, cols, looks], what a look adds to the probability of having found. price: float [rows, cols,
    looks], what it costs. flyable: bool [rows, cols]. labels: int [rows, cols]. start: the cell at step 0. fixed: int
    [steps + 1]; where it is not negative, the walk is in a cell with this label at that step.

    A look at step t earns worth * (steps - t) - price, if that is positive. The walk enters a neighbouring flyable cell
    in every step. As steps change the colour of a chessboard's square, one array holds two steps. Returns -inf when
    no walk is where `fixed` wants it.
    """
    rows, cols, looks = worth.shape
    steps = fixed.size - 1
    value = np.full((rows + 2, cols + 2), -np.inf)  # a border that nobody enters
    wanted = np.zeros((rows, cols), dtype=np.int64)  # looks that can ever be worth their price
    for row in range(rows):
        for col in range(cols):
            if flyable[row, col]:
                value[row + 1, col + 1] = 0.0
            for k in range(looks):
                if worth[row, col, k] * steps > price[row, col, k]:
                    wanted[row, col] = k + 1
    colour = (start[0] + start[1]) & 1
    for t in range(steps, 0, -1):
        left = float(steps - t)
        for row in range(rows):
            for col in range((row + colour + t) & 1, cols, 2):
                if not flyable[row, col]:
                    continue
                best = 0.0
                if t < steps:
                    best = max(
                        max(value[row, col + 1], value[row + 2, col + 1]),
                        max(value[row + 1, col], value[row + 1, col + 2]),
                    )
                if fixed[t] >= 0 and labels[row, col] != fixed[t]:
                    best = -np.inf
                gain = 0.0
                for k in range(wanted[row, col]):
                    gain = max(gain, worth[row, col, k] * left - price[row, col, k])
                value[row + 1, col + 1] = best + gain
    row, col = start
    most: float = max(
        max(value[row, col + 1], value[row + 2, col + 1]), max(value[row + 1, col], value[row + 1, col + 2])
    )
    return most


@njit(cache=True, nogil=True)
def best_flight(
    gains: tuple[Floats, Floats],
    span: tuple[float, float],
    allowed: NDArray[np.uint8],
    labels: Ints,
    start: tuple[int, int],
    costs: tuple[Ints, Ints],
    fixed: Ints,
) -> float:
    """The most that a flight can earn when the k-th look at a cell may be bought as often as wanted.

    gains: worth and price, float [rows, cols, looks] each, as of `best_walk`. span: seconds of a slot, and until when a
    look in slot 0 counts; one in slot t earns worth * (until - slot * t) - price, if that is positive. allowed: uint8
    [rows, cols], bit d is set where a cell can be left in direction d. labels: int [rows, cols]. start: the cell at
    slot 0. costs: slots of a move in each direction, int [8], each at least 1, and of a turn by eighths of a circle,
    int [5]. fixed: int [slots + 1]; where it is not negative, the cell entered last by then has this label.

    A move after a turn begins in one slot and ends so many later; what ends after the last slot earns nothing. The
    first turn is free. Returns -inf when no flight is where `fixed` wants it.
    """
    worth, price = gains
    moves, turns = costs
    rows, cols, looks = worth.shape
    slots = fixed.size - 1
    deep = moves.max() + turns.max() + 1
    value = np.full((deep, rows, cols, 8), -np.inf)  # of being in a cell, by slot modulo `deep` and direction
    down = np.array([-1, -1, 0, 1, 1, 1, 0, -1])
    right = np.array([0, 1, 1, 1, 0, -1, -1, -1])
    cost, then = np.zeros((8, 5), dtype=np.int64), np.zeros((8, 5), dtype=np.int64)
    onward = np.zeros((8, 5))
    most = -np.inf
    for t in range(slots, -1, -1):
        until = span[1] - span[0] * t
        for after in range(8):
            for turn in range(5):
                cost[after, turn] = moves[after] + (turns[turn] if t > 0 else 0)
                then[after, turn] = (t + cost[after, turn]) % deep
        for row in range(rows):
            for col in range(cols):
                gain = 0.0
                for k in range(looks):
                    gain = max(gain, worth[row, col, k] * until - price[row, col, k])
                stays = 0  # for so many slots it may have been here last
                while stays < deep and (
                    t + stays > slots or fixed[t + stays] < 0 or fixed[t + stays] == labels[row, col]
                ):
                    stays += 1
                for after in range(8):
                    legal = allowed[row, col] >> after & 1
                    for turn in range(5):
                        onward[after, turn] = -np.inf
                        if not legal or cost[after, turn] > stays:
                            continue
                        onward[after, turn] = 0.0
                        if t + cost[after, turn] <= slots:
                            onward[after, turn] = value[
                                then[after, turn], row + down[after], col + right[after], after
                            ]
                for before in range(8):
                    best = -np.inf
                    for after in range(8):
                        apart = (after - before) & 7
                        best = max(best, onward[after, min(apart, 8 - apart)])
                    value[t % deep, row, col, before] = best + gain
                    if t == 0 and row == start[0] and col == start[1]:
                        most = max(most, best)
    return most
