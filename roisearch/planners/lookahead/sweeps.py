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

from roisearch.kernels.compiled import light_kernel as kernel
from roisearch.kernels.ground import cell_step, col_step, row_step
from roisearch.kernels.records import Floats, Ints, Pose, Steps
from roisearch.planners.lookahead.chart import AREA, BLOCK, DISTRICT, Chart, gain_from, look, tick

ANYWHERE = -1
RING, HOLD = 2, 8
"""Blocks around the drone's own that are looked through at every step; steps for which `far_limit` holds."""
SURELY = 1.0 - 1e-9
"""Less of the score of a cell than rounding could take: that cell itself must still be found to be better."""


class Option(NamedTuple):
    """What to sweep: the cells of `region` (or ANYWHERE) that are worth `floor` or more.

    near: float [distances], what a distance leaves of a worth, falling: the balance of worth and distance.
    """

    near: Floats
    region: int
    floor: float


@kernel
def best_neighbour(pose: Pose, chart: Chart, option: Option) -> tuple[int, float]:
    """The neighbour whose look is worth most, with the heading of the move; straight on among equals."""
    best, score = -1, 0.0
    legal = chart.legal[pose.row * chart.cols + pose.col]
    for turn in range(4):
        move = (pose.heading + (turn ^ (turn >> 1))) & 3
        if not legal >> move & 1:
            continue
        row, col = pose.row + row_step(move), pose.col + col_step(move)
        cell = row * chart.cols + col
        if option.region >= 0 and chart.labels[cell] != option.region:
            continue
        worth = chart.mass[cell] if chart.is_point else gain_from(chart, row, col, move)
        if worth >= option.floor and worth * option.near[1] > score:
            best, score = move, worth * option.near[1]
    return best, score


@kernel
def scan_block(
    block_row: int, block_col: int, pose: Pose, chart: Chart, option: Option, best_cell: int, best: float
) -> tuple[int, float]:
    """The best cell of a block, if better than `best`; the drone's cell and its neighbours are left out."""
    near, cols = option.near, chart.cols
    enough = max(option.floor, best / near[2])
    for row in range(block_row * BLOCK, min(block_row * BLOCK + BLOCK, chart.rows)):
        apart = abs(row - pose.row)
        for col in range(block_col * BLOCK, min(block_col * BLOCK + BLOCK, cols)):
            worth = chart.worth[row * cols + col]
            if worth < enough:
                continue
            steps = apart + abs(col - pose.col)
            if steps < 2 or worth * near[steps] <= best:
                continue
            if option.region >= 0 and chart.labels[row * cols + col] != option.region:
                continue
            best_cell, best = row * cols + col, worth * near[steps]
            enough = max(option.floor, best / near[2])
    return best_cell, best


@kernel
def gap(at: int, first: int, size: int) -> int:
    """How far `at` is from the range [first, first + size)."""
    if at < first:
        return first - at
    return max(0, at - (first + size - 1))


@kernel
def may_hold(block_row: int, block_col: int, chart: Chart, option: Option) -> bool:
    """Whether a block may hold a cell of the option."""
    lives = chart.home[block_row * chart.peaks.shape[1] + block_col]
    return option.region < 0 or lives[0] <= option.region <= lives[1]


@kernel
def far_limit(pose: Pose, chart: Chart, option: Option) -> float:
    """No cell more than RING blocks from the drone can score more, now or in the next HOLD steps.

    Worth only falls in a simulation, and distances shrink by one in a step.
    """
    limit, near = 0.0, option.near
    for area_row in range(chart.tops.shape[0]):
        far_row = gap(pose.row, area_row * AREA, AREA)
        for district_col in range(chart.crests.shape[1]):
            crest = chart.crests[area_row // BLOCK, district_col]
            apart = far_row + gap(pose.col, district_col * DISTRICT, DISTRICT)
            if crest < option.floor or crest * near[max(1, apart - HOLD)] <= limit:
                continue
            first = district_col * BLOCK
            for area_col in range(first, min(first + BLOCK, chart.tops.shape[1])):
                apart = far_row + gap(pose.col, area_col * AREA, AREA)
                top = chart.tops[area_row, area_col]
                if top < option.floor or top * near[max(1, apart - HOLD)] <= limit:
                    continue
                if option.region < 0 and apart > (RING + 2) * BLOCK:
                    limit = top * near[apart - HOLD]
                else:
                    limit = limit_in_area(area_row, area_col, pose, chart, option, limit)
    return limit


@kernel
def limit_in_area(
    area_row: int, area_col: int, pose: Pose, chart: Chart, option: Option, limit: float
) -> float:
    """The limit that the blocks of an area make, if larger than `limit`."""
    own_row, own_col = pose.row // BLOCK, pose.col // BLOCK
    for block_row in range(area_row * BLOCK, min(area_row * BLOCK + BLOCK, chart.peaks.shape[0])):
        apart_row = gap(pose.row, block_row * BLOCK, BLOCK)
        for block_col in range(area_col * BLOCK, min(area_col * BLOCK + BLOCK, chart.peaks.shape[1])):
            if abs(block_row - own_row) <= RING and abs(block_col - own_col) <= RING:
                continue
            peak = chart.peaks[block_row, block_col]
            if peak < option.floor or not may_hold(block_row, block_col, chart, option):
                continue
            apart = apart_row + gap(pose.col, block_col * BLOCK, BLOCK)
            limit = max(limit, peak * option.near[max(1, apart - HOLD)])
    return limit


@kernel
def best_close(pose: Pose, chart: Chart, option: Option, best: float) -> tuple[int, float]:
    """As `best_far`, but only RING blocks around the drone's own."""
    near = option.near
    own_row, own_col = pose.row // BLOCK, pose.col // BLOCK
    cell = -1
    if chart.peaks[own_row, own_col] * near[2] > best:
        cell, best = scan_block(own_row, own_col, pose, chart, option, cell, best)
    for block_row in range(max(0, own_row - RING), min(chart.peaks.shape[0], own_row + RING + 1)):
        apart = gap(pose.row, block_row * BLOCK, BLOCK)
        for block_col in range(max(0, own_col - RING), min(chart.peaks.shape[1], own_col + RING + 1)):
            if block_row == own_row and block_col == own_col:
                continue
            peak = chart.peaks[block_row, block_col]
            steps = max(1, apart + gap(pose.col, block_col * BLOCK, BLOCK))
            if peak >= option.floor and peak * near[steps] > best:
                cell, best = scan_block(block_row, block_col, pose, chart, option, cell, best)
    return cell, best


@kernel
def score_at(cell: int, pose: Pose, chart: Chart, option: Option) -> float:
    """What a cell two or more steps away scores; 0 when it is none of the option's, or nearer."""
    steps = abs(cell // chart.cols - pose.row) + abs(cell % chart.cols - pose.col)
    worth = chart.worth[cell]
    if steps < 2 or worth < option.floor or (option.region >= 0 and chart.labels[cell] != option.region):
        return 0.0
    return float(worth * option.near[steps])


@kernel
def promised(pose: Pose, chart: Chart, option: Option) -> float:
    """A score that some cell far off reaches: the best in the area whose top counts most where it is farthest off."""
    near, last = option.near, option.near.size - 1
    most, most_row, most_col = 0.0, -1, -1
    for area_row in range(chart.tops.shape[0]):
        far_row = gap(pose.row, area_row * AREA, AREA)
        for district_col in range(chart.crests.shape[1]):
            crest = chart.crests[area_row // BLOCK, district_col]
            far = far_row + gap(pose.col, district_col * DISTRICT, DISTRICT)
            if crest < option.floor or crest * near[min(far + 2 * AREA, last)] <= most:
                continue
            first = district_col * BLOCK
            for area_col in range(first, min(first + BLOCK, chart.tops.shape[1])):
                top = chart.tops[area_row, area_col]
                far = far_row + gap(pose.col, area_col * AREA, AREA)
                score = top * near[min(far + 2 * AREA, last)]
                if top >= option.floor and score > most:
                    most, most_row, most_col = score, area_row, area_col
    if most_row < 0:
        return 0.0
    _, best = scan_area(most_row, most_col, pose, chart, option, -1, 0.0)
    return float(best)


@kernel
def best_far(pose: Pose, chart: Chart, option: Option, best: float, goal: int) -> tuple[int, float]:
    """The best cell two or more steps away on open ground, if above `best`; (-1, best) if there is none.

    `goal` is what was the best a step before, -1 for none: what that scores now only a few areas can surpass, however
    large the map is and however evenly the mass lies on it.
    """
    cell, near = -1, option.near
    reached = score_at(goal, pose, chart, option) if goal >= 0 else 0.0
    if reached <= best:
        reached = promised(pose, chart, option)
    best = max(best, SURELY * reached)
    for area_row in range(chart.tops.shape[0]):
        far_row = gap(pose.row, area_row * AREA, AREA)
        for district_col in range(chart.crests.shape[1]):
            crest = chart.crests[area_row // BLOCK, district_col]
            far = max(1, far_row + gap(pose.col, district_col * DISTRICT, DISTRICT))
            if crest < option.floor or crest * near[far] <= best:
                continue
            first = district_col * BLOCK
            for area_col in range(first, min(first + BLOCK, chart.tops.shape[1])):
                top = chart.tops[area_row, area_col]
                far = max(1, far_row + gap(pose.col, area_col * AREA, AREA))
                if top >= option.floor and top * near[far] > best:
                    cell, best = scan_area(area_row, area_col, pose, chart, option, cell, best)
    return cell, best


@kernel
def scan_area(
    area_row: int, area_col: int, pose: Pose, chart: Chart, option: Option, cell: int, best: float
) -> tuple[int, float]:
    """The best cell of an area, if better than `best`, as `scan_block`."""
    for block_row in range(area_row * BLOCK, min(area_row * BLOCK + BLOCK, chart.peaks.shape[0])):
        apart = gap(pose.row, block_row * BLOCK, BLOCK)
        for block_col in range(area_col * BLOCK, min(area_col * BLOCK + BLOCK, chart.peaks.shape[1])):
            peak = chart.peaks[block_row, block_col]
            steps = max(1, apart + gap(pose.col, block_col * BLOCK, BLOCK))
            if peak < option.floor or peak * option.near[steps] <= best:
                continue
            if may_hold(block_row, block_col, chart, option):
                cell, best = scan_block(block_row, block_col, pose, chart, option, cell, best)
    return cell, best


@kernel
def best_wave(pose: Pose, chart: Chart, option: Option, best: float) -> tuple[int, float]:
    """As `best_far`, with true distances around obstacles; leaves the way back in `wave.origin`."""
    near, wave = option.near, chart.wave
    top = 0.0
    for area_row in range(chart.tops.shape[0]):
        for area_col in range(chart.tops.shape[1]):
            top = max(top, chart.tops[area_row, area_col])
    wave.number[0] += 1
    number = wave.number[0]
    start = pose.row * chart.cols + pose.col
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
            and worth >= option.floor
            and worth * near[steps] > best
            and (option.region < 0 or chart.labels[cell] == option.region)
        ):
            found, best = cell, worth * near[steps]
        for move in range(4):
            if chart.legal[cell] >> move & 1:
                there = cell + cell_step(move, chart.cols)
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
    above = gain_from(chart, row + row_step(vertical), col, vertical)
    beside = gain_from(chart, row, col + col_step(horizontal), horizontal)
    if above > beside or (above == beside and abs(down) >= abs(right)):
        return vertical
    return horizontal


@kernel
def next_move(pose: Pose, chart: Chart, option: Option, limit: float, goal: int) -> tuple[int, int]:
    """The next move of the sweep, -1 when nothing is left to sweep, and the cell far off that it leads to, or -1.

    `limit` is from `far_limit`, `goal` that cell of the move before.
    """
    move, score = best_neighbour(pose, chart, option)
    if chart.is_open:
        other = -1
        cell, score = best_close(pose, chart, option, score)
        if score < limit:
            other, score = best_far(pose, chart, option, score, goal)
            cell = other if other >= 0 else cell
        return move if cell < 0 else move_towards(pose.row, pose.col, cell, chart), other
    return wave_move(pose, chart, option, move, score), -1


@kernel
def wave_move(pose: Pose, chart: Chart, option: Option, move: int, score: float) -> int:
    """The first move towards the best cell around obstacles, or `move` where none has more than `score`."""
    cell, score = best_wave(pose, chart, option, score)
    if cell < 0:
        return move
    start = pose.row * chart.cols + pose.col
    while chart.wave.origin[cell] != start:
        cell = chart.wave.origin[cell]
    step = cell - start
    if step == 1 and chart.cols > 1:
        return 1
    if step == -1 and chart.cols > 1:
        return 3
    return 2 if step > 0 else 0


@kernel
def sweep(
    pose: Pose, chart: Chart, option: Option, most: int, undetected: float, path: Ints, first: int
) -> tuple[float, float, int, Pose]:
    """Follow the rule for at most `most` steps, seeing nothing.

    Args:
        undetected: the mass not detected before.
        path: int [first + most or more], receives the cells entered, from `first` on.

    Returns the area under the survival curve, the mass not detected afterwards, the steps, and the pose.
    """
    area = 0.0
    steps = 0
    limit, goal = np.inf, -1
    while steps < most:
        if chart.is_open and steps % HOLD == 0:
            limit = far_limit(pose, chart, option)
        move, goal = next_move(pose, chart, option, limit, goal)
        if move < 0:
            break
        pose = Pose(pose.row + row_step(move), pose.col + col_step(move), move)
        area += undetected
        undetected = max(0.0, undetected - look(chart, pose.row, pose.col, move, True))
        undetected = max(0.0, undetected - tick(chart))
        path[first + steps] = pose.row * chart.cols + pose.col
        steps += 1
    return area, undetected, steps, pose


@kernel
def fly(
    pose: Pose, chart: Chart, undetected: float, path: Ints, first: int, last: int, kept: bool
) -> tuple[float, float, Pose]:
    """Fly path[first:last], seeing nothing; as `sweep` without the steps."""
    row, col, heading = pose.row, pose.col, pose.heading
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
        if kept:
            undetected = max(0.0, undetected - tick(chart))
    return area, undetected, Pose(row, col, heading)


@kernel
def may_add(lives: Steps, worth: float, score: float, scores: Floats, worths: Floats) -> bool:
    """Whether one of the labels `lives` [2] may get a larger worth or score."""
    for label in range(lives[0], lives[1] + 1):
        if worth > worths[label] or score > scores[label]:
            return True
    return False


@kernel
def region_scores(pose: Pose, chart: Chart, near: Floats, scores: Floats, worths: Floats) -> None:
    """For each region the best worth * near[distance] and the largest worth.

    scores, worths: float [regions + 1]; the index is the label. Distances are rows and columns, also around
    obstacles: this only says what to try first.
    """
    for label in range(scores.size):
        scores[label] = worths[label] = 0.0
    for first_pass in range(2):
        for area_row in range(chart.tops.shape[0]):
            apart = gap(pose.row, area_row * AREA, AREA)
            for area_col in range(chart.tops.shape[1]):
                top = chart.tops[area_row, area_col]
                if top <= 0.0:
                    continue
                lives = chart.homes[area_row * chart.tops.shape[1] + area_col]
                if first_pass == 0:
                    if lives[0] == lives[1]:  # its best cell is worth the top, and no farther than this
                        far = abs(area_row * AREA + AREA // 2 - pose.row) + abs(
                            area_col * AREA + AREA // 2 - pose.col
                        )
                        score = top * near[min(far + AREA, near.size - 1)]
                        worths[lives[0]] = max(worths[lives[0]], top)
                        scores[lives[0]] = max(scores[lives[0]], score)
                    continue
                steps = max(1, apart + gap(pose.col, area_col * AREA, AREA))
                if may_add(lives, top, top * near[steps], scores, worths):
                    area_scores(area_row, area_col, pose, chart, near, scores, worths)


@kernel
def area_scores(
    area_row: int, area_col: int, pose: Pose, chart: Chart, near: Floats, scores: Floats, worths: Floats
) -> None:
    """As `region_scores`, of the cells of an area."""
    for block_row in range(area_row * BLOCK, min(area_row * BLOCK + BLOCK, chart.peaks.shape[0])):
        apart = gap(pose.row, block_row * BLOCK, BLOCK)
        for block_col in range(area_col * BLOCK, min(area_col * BLOCK + BLOCK, chart.peaks.shape[1])):
            peak = chart.peaks[block_row, block_col]
            lives = chart.home[block_row * chart.peaks.shape[1] + block_col]
            steps = max(1, apart + gap(pose.col, block_col * BLOCK, BLOCK))
            if peak <= 0.0 or not may_add(lives, peak, peak * near[steps], scores, worths):
                continue
            for row in range(block_row * BLOCK, min(block_row * BLOCK + BLOCK, chart.rows)):
                for col in range(block_col * BLOCK, min(block_col * BLOCK + BLOCK, chart.cols)):
                    label, worth = chart.labels[row * chart.cols + col], chart.worth[row * chart.cols + col]
                    worths[label] = max(worths[label], worth)
                    away = max(1, abs(row - pose.row) + abs(col - pose.col))
                    scores[label] = max(scores[label], worth * near[away])
