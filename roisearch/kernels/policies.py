"""Direct policy search: try many epsilon-greedy walks, keep the best."""

from __future__ import annotations

import numpy as np

from roisearch.kernels.compiled import kernel
from roisearch.kernels.draws import draw_move, draw_unit
from roisearch.kernels.ground import col_step, row_step
from roisearch.kernels.groups import FADING, LAND, SIGHT
from roisearch.kernels.handover import Layout, array
from roisearch.kernels.records import Floats, Land, Mass, Sight
from roisearch.kernels.sensing import fade_at, gain_at, restore

WALKS = Layout(
    horizon=np.int64,
    epsilon=np.float64,
    # uint64 [1], see `roisearch.kernels.draws`
    random=(np.uint64, 1),
    **LAND,
    **SIGHT,
    **FADING,
    # [2, horizon] room for a walk, and for the best
    trial=(np.int64, 2),
    path=(np.int64, 2),
)
opened = WALKS.opener()


@kernel
def search_policies(cell: int, heading: int, rollouts: int, weights: Floats, parcel: int) -> float:
    """Direct policy search: the best of `rollouts` epsilon-greedy walks goes into `path`.

    `parcel` is what `WALKS` packed. With probability epsilon a move is random, else it goes to the neighbour that sees
    most. Returns the sum of the weights seen, which fade by 1 - p_tp within a walk when `fades`.
    """
    given = opened(parcel)
    cols, legal, fades = given.cols, array(given.legal), given.fades
    horizon, epsilon, state = given.horizon, given.epsilon, array(given.random)
    trial, path = array(given.trial), array(given.path)
    from_row, from_col = cell // cols, cell % cols
    land = Land(legal, weights.size // cols, cols)
    sight = Sight(array(given.offsets), array(given.gains), array(given.miss), given.is_point)
    mass = Mass(weights, array(given.fade), fades, array(given.log))
    best = -1.0
    for _ in range(rollouts):
        row, col, facing, logged, total = from_row, from_col, heading, 0, 0.0
        for step in range(horizon):
            allowed = legal[row * cols + col]
            move = -1
            if draw_unit(state) < epsilon:
                move = draw_move(state)
                while not allowed >> move & 1:
                    move = draw_move(state)
                gain = gain_at(row + row_step(move), col + col_step(move), move, land.rows, cols, mass, sight)
            else:
                gain = -1.0
                for turn in range(4):
                    there = (facing + (turn ^ (turn >> 1))) & 3
                    if allowed >> there & 1:
                        r, c = row + row_step(there), col + col_step(there)
                        found = gain_at(r, c, there, land.rows, cols, mass, sight)
                        if found > gain:
                            move, gain = there, found
            row += row_step(move)
            col += col_step(move)
            facing = move
            total += gain
            if fades:
                logged = fade_at(row, col, facing, land.rows, cols, mass, sight, logged)
            trial[0, step] = row
            trial[1, step] = col
        restore(mass, logged)
        if total > best:
            best = total
            for step in range(horizon):
                path[0, step] = trial[0, step]
                path[1, step] = trial[1, step]
    return best
