"""Rollout policies: what is done after the tree ends, to see what a new node may be worth.

Random numbers: see `roisearch.kernels.draws`, whose steps are written out here where they are drawn most.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from roisearch.kernels.compiled import inlined, kernel
from roisearch.kernels.draws import INCREMENT, MULTIPLIER
from roisearch.kernels.ground import cell_step, col_step, row_step
from roisearch.kernels.records import Land, Mass, Pose, Sight
from roisearch.kernels.sensing import fade_at, gain_at
from roisearch.planners.puct.records import RANDOM, STEEPEST, SearchRules


@inlined
def random_look(
    row: int, col: int, land: Land, mass: Mass, sight: Sight, rules: SearchRules, state: NDArray[np.uint64]
) -> float:
    """Random moves over a static map seen through a point: the lite model's rollout, at its barest."""
    cell = row * land.cols + col
    now = state[0]
    total, kept = 0.0, 1.0
    for _ in range(rules.rollout):
        now = now * MULTIPLIER + INCREMENT
        move = np.int64(now >> np.uint64(62))
        while not land.legal[cell] >> move & 1:
            now = now * MULTIPLIER + INCREMENT
            move = np.int64(now >> np.uint64(62))
        cell += cell_step(int(move), land.cols)
        total += kept * (rules.scale * (sight.gains[0] * mass.weights[cell]) - rules.penalty)
        kept *= rules.discount
    state[0] = now
    return total


@kernel
def random_walk(
    pose: Pose,
    land: Land,
    mass: Mass,
    sight: Sight,
    rules: SearchRules,
    state: NDArray[np.uint64],
    logged: int,
    repeat: bool,
) -> tuple[float, int]:
    """Random moves, or with `repeat` one random move again and again until it is blocked (reference code)."""
    row, col = pose.row, pose.col
    now = state[0]
    total, kept = 0.0, 1.0
    move = np.int64(0)
    for step in range(rules.rollout):
        legal = land.legal[row * land.cols + col]
        if step == 0 or not repeat:
            now = now * MULTIPLIER + INCREMENT
            move = np.int64(now >> np.uint64(62))
            while not legal >> move & 1:
                now = now * MULTIPLIER + INCREMENT
                move = np.int64(now >> np.uint64(62))
        elif not legal >> move & 1:
            break
        row += row_step(int(move))
        col += col_step(int(move))
        gain = gain_at(row, col, int(move), land.rows, land.cols, mass, sight)
        total += kept * (rules.scale * gain - rules.penalty)
        kept *= rules.discount
        if mass.fades:
            logged = fade_at(row, col, int(move), land.rows, land.cols, mass, sight, logged)
    state[0] = now
    return total, logged


@kernel
def steepest(
    pose: Pose, land: Land, mass: Mass, sight: Sight, rules: SearchRules, logged: int
) -> tuple[float, int]:
    """Always to the neighbour that sees most; of equal ones straight on, right, left, back, in this order."""
    row, col, heading = pose.row, pose.col, pose.heading
    total, kept = 0.0, 1.0
    for _ in range(rules.rollout):
        legal = land.legal[row * land.cols + col]
        move, gain = -1, -1.0
        for turn in range(4):
            there = (heading + (turn ^ (turn >> 1))) & 3
            if legal >> there & 1:
                found = gain_at(
                    row + row_step(there), col + col_step(there), there, land.rows, land.cols, mass, sight
                )
                if found > gain:
                    move, gain = there, found
        row += row_step(move)
        col += col_step(move)
        heading = move
        total += kept * (rules.scale * gain - rules.penalty)
        kept *= rules.discount
        if mass.fades:
            logged = fade_at(row, col, heading, land.rows, land.cols, mass, sight, logged)
    return total, logged


@kernel
def roll_out(
    pose: Pose,
    land: Land,
    mass: Mass,
    sight: Sight,
    rules: SearchRules,
    state: NDArray[np.uint64],
    logged: int,
) -> tuple[float, int]:
    """The discounted return of the rollout, and how many cells are in the log of fading now."""
    if rules.rollout_policy == STEEPEST:
        return steepest(pose, land, mass, sight, rules, logged)
    if rules.rollout_policy == RANDOM and sight.is_point and not mass.fades:
        return random_look(pose.row, pose.col, land, mass, sight, rules, state), logged
    repeat = rules.rollout_policy != RANDOM
    return random_walk(pose, land, mass, sight, rules, state, logged, repeat)
