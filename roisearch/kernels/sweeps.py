"""Sweeps: where to look next by worth against distance, and following that rule for many steps in thought.

The rule goes towards the cell with the largest worth * near[distance], `near` falling with the distance.
With near[d] = (d + 1) ** -0.4 it is the index rule m ** 2.5 / (d + 1). Restricted to one region and to
cells worth at least a floor, it is the option 'sweep this region down to that level'.

On open ground the distance is the number of rows and columns between; blocks that cannot hold a better cell
are skipped. Around obstacles a wave from the drone visits the cells in the order of their true distance,
until no cell farther out can be better.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from roisearch.kernels.chart import AREA, BLOCK, Chart, Floats, Ints, gain_from, look
from roisearch.kernels.compiled import light_kernel as kernel

ANYWHERE = -1
RING, HOLD = 2, 8
"""Blocks around the drone's own that are looked through at every step; steps for which `far_limit` holds."""


class Wave(NamedTuple):
    """Room for a wave around obstacles: `seen` [cells] number of the wave, `origin` [cells] the cell before,
    `queue` [cells], `steps` [cells], `number` [1] the number of the last wave. All [0] on open ground."""

    seen: Ints
    origin: Ints
    queue: Ints
    steps: Ints
    number: Ints


@kernel
def row_of_move(move: int) -> int:
    """Row step of a move."""
    return -1 if move == 0 else (1 if move == 2 else 0)


@kernel
def col_of_move(move: int) -> int:
    """Column step of a move."""
    return 1 if move == 1 else (-1 if move == 3 else 0)


@kernel
def best_neighbour(
    row: int,
    col: int,
    heading: int,
    chart: Chart,
    near: Floats,
    labels: NDArray[np.int32],
    region: int,
    floor: float,
) -> tuple[int, float]:
    """The neighbour whose look is worth most, with the heading of the move; straight on among equals."""
    best, score = -1, 0.0
    legal = chart.legal[row * chart.cols + col]
    for turn in range(4):
        move = (heading + (turn ^ (turn >> 1))) & 3
        if not legal >> move & 1:
            continue
        to_row, to_col = row + row_of_move(move), col + col_of_move(move)
        if region >= 0 and labels[to_row * chart.cols + to_col] != region:
            continue
        worth = (
            chart.mass[to_row * chart.cols + to_col]
            if chart.is_point
            else gain_from(chart, to_row, to_col, move)
        )
        if worth >= floor and worth * near[1] > score:
            best, score = move, worth * near[1]
    return best, score


@kernel
def scan_block(
    block_row: int,
    block_col: int,
    row: int,
    col: int,
    rows: int,
    cols: int,
    worths: Floats,
    near: Floats,
    labels: NDArray[np.int32],
    region: int,
    floor: float,
    best_cell: int,
    best: float,
) -> tuple[int, float]:
    """The best cell of a block, if better than `best`; the drone's cell and its neighbours are left out."""
    enough = max(floor, best / near[2])
    for r in range(block_row * BLOCK, min(block_row * BLOCK + BLOCK, rows)):
        apart = abs(r - row)
        for c in range(block_col * BLOCK, min(block_col * BLOCK + BLOCK, cols)):
            worth = worths[r * cols + c]
            if worth < enough:
                continue
            steps = apart + abs(c - col)
            if steps < 2 or worth * near[steps] <= best:
                continue
            if region >= 0 and labels[r * cols + c] != region:
                continue
            best_cell, best = r * cols + c, worth * near[steps]
            enough = max(floor, best / near[2])
    return best_cell, best


@kernel
def gap(at: int, first: int, size: int) -> int:
    """How far `at` is from the range [first, first + size)."""
    if at < first:
        return first - at
    return max(0, at - (first + size - 1))


@kernel
def far_limit(
    row: int, col: int, chart: Chart, near: Floats, home: NDArray[np.int32], region: int, floor: float
) -> float:
    """No cell more than RING blocks from the drone can score more, now or in the next HOLD steps.

    Worth only falls in a simulation, and distances shrink by one in a step.
    """
    limit = 0.0
    own_row, own_col = row // BLOCK, col // BLOCK
    for area_row in range(chart.tops.shape[0]):
        far_row = gap(row, area_row * AREA, AREA)
        for area_col in range(chart.tops.shape[1]):
            apart = far_row + gap(col, area_col * AREA, AREA)
            top = chart.tops[area_row, area_col]
            if top < floor or top * near[max(1, apart - HOLD)] <= limit:
                continue
            if region < 0 and apart > (RING + 2) * BLOCK:
                limit = top * near[apart - HOLD]
                continue
            for block_row in range(area_row * BLOCK, min(area_row * BLOCK + BLOCK, chart.peaks.shape[0])):
                apart_row = gap(row, block_row * BLOCK, BLOCK)
                for block_col in range(area_col * BLOCK, min(area_col * BLOCK + BLOCK, chart.peaks.shape[1])):
                    if abs(block_row - own_row) <= RING and abs(block_col - own_col) <= RING:
                        continue
                    lives = home[block_row * chart.peaks.shape[1] + block_col]
                    peak = chart.peaks[block_row, block_col]
                    if peak < floor or (region >= 0 and lives >= 0 and lives != region):
                        continue
                    apart = apart_row + gap(col, block_col * BLOCK, BLOCK)
                    limit = max(limit, peak * near[max(1, apart - HOLD)])
    return limit


@kernel
def best_close(
    row: int,
    col: int,
    chart: Chart,
    near: Floats,
    labels: NDArray[np.int32],
    region: int,
    floor: float,
    best: float,
) -> tuple[int, float]:
    """As `best_far`, but only RING blocks around the drone's own."""
    own_row, own_col = row // BLOCK, col // BLOCK
    cell = -1
    if chart.peaks[own_row, own_col] * near[2] > best:
        cell, best = scan_block(
            own_row,
            own_col,
            row,
            col,
            chart.rows,
            chart.cols,
            chart.worth,
            near,
            labels,
            region,
            floor,
            cell,
            best,
        )
    for block_row in range(max(0, own_row - RING), min(chart.peaks.shape[0], own_row + RING + 1)):
        apart = gap(row, block_row * BLOCK, BLOCK)
        for block_col in range(max(0, own_col - RING), min(chart.peaks.shape[1], own_col + RING + 1)):
            if block_row == own_row and block_col == own_col:
                continue
            peak = chart.peaks[block_row, block_col]
            if peak >= floor and peak * near[max(1, apart + gap(col, block_col * BLOCK, BLOCK))] > best:
                cell, best = scan_block(
                    block_row,
                    block_col,
                    row,
                    col,
                    chart.rows,
                    chart.cols,
                    chart.worth,
                    near,
                    labels,
                    region,
                    floor,
                    cell,
                    best,
                )
    return cell, best


@kernel
def best_far(
    row: int,
    col: int,
    chart: Chart,
    near: Floats,
    labels: NDArray[np.int32],
    home: NDArray[np.int32],
    region: int,
    floor: float,
    best: float,
) -> tuple[int, float]:
    """The best cell two or more steps away on open ground, if above `best`; (-1, best) if there is none."""
    cell = -1
    for area_row in range(chart.tops.shape[0]):
        far_row = gap(row, area_row * AREA, AREA)
        for area_col in range(chart.tops.shape[1]):
            top = chart.tops[area_row, area_col]
            if top < floor or top * near[max(1, far_row + gap(col, area_col * AREA, AREA))] <= best:
                continue
            for block_row in range(area_row * BLOCK, min(area_row * BLOCK + BLOCK, chart.peaks.shape[0])):
                apart = gap(row, block_row * BLOCK, BLOCK)
                for block_col in range(area_col * BLOCK, min(area_col * BLOCK + BLOCK, chart.peaks.shape[1])):
                    peak = chart.peaks[block_row, block_col]
                    if (
                        peak < floor
                        or peak * near[max(1, apart + gap(col, block_col * BLOCK, BLOCK))] <= best
                    ):
                        continue
                    lives = home[block_row * chart.peaks.shape[1] + block_col]
                    if region >= 0 and lives >= 0 and lives != region:
                        continue
                    cell, best = scan_block(
                        block_row,
                        block_col,
                        row,
                        col,
                        chart.rows,
                        chart.cols,
                        chart.worth,
                        near,
                        labels,
                        region,
                        floor,
                        cell,
                        best,
                    )
    return cell, best


@kernel
def best_wave(
    row: int,
    col: int,
    chart: Chart,
    near: Floats,
    labels: NDArray[np.int32],
    region: int,
    floor: float,
    best: float,
    wave: Wave,
) -> tuple[int, float]:
    """As `best_far`, with true distances around obstacles; leaves the way back in `wave.origin`."""
    top = 0.0
    for area_row in range(chart.tops.shape[0]):
        for area_col in range(chart.tops.shape[1]):
            top = max(top, chart.tops[area_row, area_col])
    wave.number[0] += 1
    number = wave.number[0]
    start = row * chart.cols + col
    wave.seen[start], wave.steps[start], wave.queue[0] = number, 0, start
    head, tail, found = 0, 1, -1
    while head < tail:
        cell = wave.queue[head]
        head += 1
        steps = wave.steps[cell]
        if top * near[max(1, steps)] <= best:
            break
        worth = chart.worth[cell]
        if (
            steps >= 2
            and worth >= floor
            and worth * near[steps] > best
            and (region < 0 or labels[cell] == region)
        ):
            found, best = cell, worth * near[steps]
        for move in range(4):
            if chart.legal[cell] >> move & 1:
                there = cell + row_of_move(move) * chart.cols + col_of_move(move)
                if wave.seen[there] != number:
                    wave.seen[there], wave.steps[there], wave.origin[there] = number, steps + 1, cell
                    wave.queue[tail] = there
                    tail += 1
    return found, best


@kernel
def move_towards(row: int, col: int, cell: int, chart: Chart) -> int:
    """The move towards a cell on open ground: of the two that come nearer the one that sees more."""
    down, right = cell // chart.cols - row, cell % chart.cols - col
    vertical, horizontal = (2 if down > 0 else 0), (1 if right > 0 else 3)
    if down == 0:
        return horizontal
    if right == 0:
        return vertical
    above = gain_from(chart, row + row_of_move(vertical), col, vertical)
    beside = gain_from(chart, row, col + col_of_move(horizontal), horizontal)
    if above > beside or (above == beside and abs(down) >= abs(right)):
        return vertical
    return horizontal


@kernel
def next_move(
    row: int,
    col: int,
    heading: int,
    chart: Chart,
    near: Floats,
    labels: NDArray[np.int32],
    home: NDArray[np.int32],
    region: int,
    floor: float,
    limit: float,
    wave: Wave,
) -> int:
    """The next move of the sweep; -1 when nothing is left to sweep. `limit` is from `far_limit`."""
    move, score = best_neighbour(row, col, heading, chart, near, labels, region, floor)
    if chart.is_open:
        cell, score = best_close(row, col, chart, near, labels, region, floor, score)
        if score < limit:
            other, score = best_far(row, col, chart, near, labels, home, region, floor, score)
            cell = other if other >= 0 else cell
        return move if cell < 0 else move_towards(row, col, cell, chart)
    cell, score = best_wave(row, col, chart, near, labels, region, floor, score, wave)
    if cell < 0:
        return move
    start = row * chart.cols + col
    while wave.origin[cell] != start:
        cell = wave.origin[cell]
    step = cell - start
    if step == 1 and chart.cols > 1:
        return 1
    if step == -1 and chart.cols > 1:
        return 3
    return 2 if step > 0 else 0


@kernel
def sweep(
    row: int,
    col: int,
    heading: int,
    chart: Chart,
    near: Floats,
    labels: NDArray[np.int32],
    home: NDArray[np.int32],
    region: int,
    floor: float,
    most: int,
    undetected: float,
    path: Ints,
    first: int,
    wave: Wave,
) -> tuple[float, float, int, int, int, int]:
    """Follow the rule for at most `most` steps, seeing nothing.

    Args:
        undetected: the mass not detected before.
        path: int [first + most or more], receives the cells entered, from `first` on.

    Returns the area under the survival curve, the mass not detected afterwards, the steps, and the pose.
    """
    area = 0.0
    steps = 0
    limit = np.inf
    while steps < most:
        if chart.is_open and steps % HOLD == 0:
            limit = far_limit(row, col, chart, near, home, region, floor)
        move = next_move(row, col, heading, chart, near, labels, home, region, floor, limit, wave)
        if move < 0:
            break
        row += row_of_move(move)
        col += col_of_move(move)
        heading = move
        area += undetected
        undetected = max(0.0, undetected - look(chart, row, col, heading, True))
        path[first + steps] = row * chart.cols + col
        steps += 1
    return area, undetected, steps, row, col, heading


@kernel
def fly(
    row: int,
    col: int,
    heading: int,
    chart: Chart,
    undetected: float,
    path: Ints,
    first: int,
    last: int,
    kept: bool,
) -> tuple[float, float, int, int, int]:
    """Fly path[first:last], seeing nothing; as `sweep` without the steps."""
    area = 0.0
    for step in range(first, last):
        to_row, to_col = path[step] // chart.cols, path[step] % chart.cols
        if to_row != row:
            heading = 2 if to_row > row else 0
        elif to_col != col:
            heading = 1 if to_col > col else 3
        row, col = to_row, to_col
        area += undetected
        undetected = max(0.0, undetected - look(chart, row, col, heading, kept))
    return area, undetected, row, col, heading


@kernel
def region_scores(
    row: int,
    col: int,
    chart: Chart,
    near: Floats,
    labels: NDArray[np.int32],
    home: NDArray[np.int32],
    scores: Floats,
    worths: Floats,
) -> None:
    """For each region the best worth * near[distance] and the largest worth.

    scores, worths: float [regions + 1]; the index is the label. Distances are rows and columns, also around
    obstacles: this only says what to try first.
    """
    for label in range(scores.size):
        scores[label] = worths[label] = 0.0
    for block_row in range(chart.peaks.shape[0]):
        apart = gap(row, block_row * BLOCK, BLOCK)
        for block_col in range(chart.peaks.shape[1]):
            peak = chart.peaks[block_row, block_col]
            lives = home[block_row * chart.peaks.shape[1] + block_col]
            if peak <= 0.0:
                continue
            steps = max(1, apart + gap(col, block_col * BLOCK, BLOCK))
            if lives >= 0 and peak <= worths[lives] and peak * near[steps] <= scores[lives]:
                continue
            for r in range(block_row * BLOCK, min(block_row * BLOCK + BLOCK, chart.rows)):
                for c in range(block_col * BLOCK, min(block_col * BLOCK + BLOCK, chart.cols)):
                    label = labels[r * chart.cols + c]
                    worth = chart.worth[r * chart.cols + c]
                    worths[label] = max(worths[label], worth)
                    scores[label] = max(scores[label], worth * near[max(1, abs(r - row) + abs(c - col))])
