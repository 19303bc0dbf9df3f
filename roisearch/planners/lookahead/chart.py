"""A map that a planner may search on in thought: looks deplete it, and everything is put back afterwards.

Cells lie row by row. Blocks of 8 x 8 cells keep the largest worth in them, areas of 8 x 8 blocks the largest of their
blocks, districts of 8 x 8 areas the largest of those, so that the most worthwhile cell is found without reading the
map. `keep` copies a block before it is changed for the first time in a simulation; `restore` puts all of them back, to
the last bit. So a simulation costs what it touches, never the map.

The *mass* of a cell is the weight of the target being there undetected. The *worth* of a cell is what a
look from it detects, on average over the headings; with a point field of view both are one array.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from roisearch.kernels.compiled import light_kernel as kernel
from roisearch.kernels.records import Bits, Floats, Ints, Steps
from roisearch.planners.lookahead.others import CLOCK, COUNT, NEXT, Others

BLOCK, AREA, DISTRICT = 8, 64, 512
LEVELS = 96


class Wave(NamedTuple):
    """Room for a wave around obstacles: `seen` [cells] number of the wave, `origin` [cells] the cell before,
    `queue` [cells], `steps` [cells], `number` [1] the number of the last wave. All [0] on open ground."""

    seen: Ints
    origin: Ints
    queue: Ints
    steps: Ints
    number: Ints


class Chart(NamedTuple):
    """The map in thought.

    mass, worth: float [cells]; the same array when the field of view is a point. peaks: float [block rows, block cols],
    the largest worth in a block; tops: float [area rows, area cols], in an area; crests: float [district rows, district
    cols], in a district. levels: float [LEVELS, 2], number of cells and mass by powers of two below `scale` [1], for
    what remains at a horizon. legal: uint8 [cells], bit h set when move h is possible; 0 for a cell that cannot be
    entered. offsets: int [4, k, 2], p_tp: float [k], what is seen by heading. spread: int [n, 2], share: float [n]: a
    cell's mass m adds share * m to the worth of the cell `spread` away. labels: int32 [cells], the region of each cell;
    home: int32 [blocks, 2], the least and the largest label in a block; homes: int32 [areas, 2], in an area. wave: see
    `Wave`.

    stamp: int [blocks], number of the simulation that last kept a block; log: int [blocks], kept blocks; old: float
    [blocks, 2, 64], their mass and worth; old_peak: float [blocks]; counters: int [2], number of the simulation, kept
    blocks. others: see `Others`.
    """

    rows: int
    cols: int
    mass: Floats
    worth: Floats
    peaks: Floats
    tops: Floats
    crests: Floats
    levels: Floats
    scale: Floats
    legal: Bits
    offsets: Ints
    p_tp: Floats
    spread: Ints
    share: Floats
    is_point: bool
    is_open: bool
    labels: Steps
    home: Steps
    homes: Steps
    wave: Wave
    stamp: Ints
    log: Ints
    old: Floats
    old_peak: Floats
    old_tops: Floats
    old_crests: Floats
    old_levels: Floats
    counters: Ints
    others: Others


SIMULATION, KEPT = 0, 1


@kernel
def level_of(mass: float, scale: float) -> int:
    """How many powers of two `mass` is below `scale`, 0 .. LEVELS - 1; -1 for nothing."""
    if mass <= 0.0:
        return -1
    exponent = math.frexp(mass / scale)[1]
    return min(max(-exponent, 0), LEVELS - 1)


@kernel
def largest_in_block(worth: Floats, rows: int, cols: int, block_row: int, block_col: int) -> float:
    """The largest worth in a block."""
    best = 0.0
    for row in range(block_row * BLOCK, min(block_row * BLOCK + BLOCK, rows)):
        for cell in range(row * cols + block_col * BLOCK, row * cols + min(block_col * BLOCK + BLOCK, cols)):
            if worth[cell] > best:
                best = worth[cell]
    return best


@kernel
def recompute_area(chart: Chart, area_row: int, area_col: int) -> None:
    """The largest worth in an area, from its blocks."""
    best = 0.0
    for row in range(area_row * BLOCK, min(area_row * BLOCK + BLOCK, chart.peaks.shape[0])):
        for col in range(area_col * BLOCK, min(area_col * BLOCK + BLOCK, chart.peaks.shape[1])):
            best = max(best, chart.peaks[row, col])
    chart.tops[area_row, area_col] = best


@kernel
def recompute_district(chart: Chart, district_row: int, district_col: int) -> None:
    """The largest worth in a district, from its areas."""
    best = 0.0
    for row in range(district_row * BLOCK, min(district_row * BLOCK + BLOCK, chart.tops.shape[0])):
        for col in range(district_col * BLOCK, min(district_col * BLOCK + BLOCK, chart.tops.shape[1])):
            best = max(best, chart.tops[row, col])
    chart.crests[district_row, district_col] = best


@kernel
def worth_at(chart: Chart, row: int, col: int) -> float:
    """What a look from a cell detects, on average over the headings, from the mass around it."""
    total = 0.0
    for i in range(chart.spread.shape[0]):
        r, c = row - chart.spread[i, 0], col - chart.spread[i, 1]
        if 0 <= r < chart.rows and 0 <= c < chart.cols:
            total += chart.share[i] * chart.mass[r * chart.cols + c]
    return total


@kernel
def draw_up(chart: Chart) -> None:
    """Fill worth, peaks, tops and levels from `mass`: one pass over the map."""
    most = 0.0
    for cell in range(chart.mass.size):
        most = max(most, chart.mass[cell])
    chart.scale[0] = most if most > 0.0 else 1.0
    for level in range(LEVELS):
        chart.levels[level, 0] = chart.levels[level, 1] = 0.0
    for row in range(chart.rows):
        for col in range(chart.cols):
            cell = row * chart.cols + col
            level = level_of(chart.mass[cell], chart.scale[0])
            if level >= 0:
                chart.levels[level, 0] += 1.0
                chart.levels[level, 1] += chart.mass[cell]
            if not chart.is_point:
                chart.worth[cell] = worth_at(chart, row, col) if chart.legal[cell] else 0.0
    for row in range(chart.peaks.shape[0]):
        for col in range(chart.peaks.shape[1]):
            chart.peaks[row, col] = largest_in_block(chart.worth, chart.rows, chart.cols, row, col)
    for row in range(chart.tops.shape[0]):
        for col in range(chart.tops.shape[1]):
            recompute_area(chart, row, col)
    for row in range(chart.crests.shape[0]):
        for col in range(chart.crests.shape[1]):
            recompute_district(chart, row, col)


@kernel
def copy_table(source: Floats, target: Floats) -> None:
    """Copy float [rows, cols] cell by cell (a slice would need memory)."""
    for row in range(source.shape[0]):
        for col in range(source.shape[1]):
            target[row, col] = source[row, col]


@kernel
def begin(chart: Chart) -> None:
    """Start a simulation that `restore` will undo."""
    chart.counters[SIMULATION] += 1
    chart.counters[KEPT] = 0
    chart.others.counters[NEXT] = chart.others.counters[CLOCK] = 0
    copy_table(chart.tops, chart.old_tops)
    copy_table(chart.crests, chart.old_crests)
    copy_table(chart.levels, chart.old_levels)


@kernel
def keep(chart: Chart, block_row: int, block_col: int) -> None:
    """Copy a block before its first change in this simulation."""
    block = block_row * chart.peaks.shape[1] + block_col
    if chart.stamp[block] == chart.counters[SIMULATION]:
        return
    chart.stamp[block] = chart.counters[SIMULATION]
    place = chart.counters[KEPT]
    chart.log[place] = block
    chart.old_peak[place] = chart.peaks[block_row, block_col]
    i = 0
    for row in range(block_row * BLOCK, min(block_row * BLOCK + BLOCK, chart.rows)):
        for col in range(block_col * BLOCK, min(block_col * BLOCK + BLOCK, chart.cols)):
            chart.old[place, 0, i] = chart.mass[row * chart.cols + col]
            chart.old[place, 1, i] = chart.worth[row * chart.cols + col]
            i += 1
    chart.counters[KEPT] += 1


@kernel
def restore(chart: Chart) -> None:
    """Put the map back as it was at `begin`."""
    for place in range(chart.counters[KEPT]):
        block = chart.log[place]
        block_row, block_col = block // chart.peaks.shape[1], block % chart.peaks.shape[1]
        chart.peaks[block_row, block_col] = chart.old_peak[place]
        i = 0
        for row in range(block_row * BLOCK, min(block_row * BLOCK + BLOCK, chart.rows)):
            for col in range(block_col * BLOCK, min(block_col * BLOCK + BLOCK, chart.cols)):
                chart.mass[row * chart.cols + col] = chart.old[place, 0, i]
                chart.worth[row * chart.cols + col] = chart.old[place, 1, i]
                i += 1
    chart.counters[KEPT] = 0
    copy_table(chart.old_tops, chart.tops)
    copy_table(chart.old_crests, chart.crests)
    copy_table(chart.old_levels, chart.levels)


@kernel
def change(chart: Chart, row: int, col: int, mass: float, kept: bool) -> None:
    """Set the mass of one cell, and what depends on it; with `kept` it can be restored."""
    cell = row * chart.cols + col
    before = chart.mass[cell]
    level = level_of(before, chart.scale[0])
    if level >= 0:
        chart.levels[level, 0] -= 1.0
        chart.levels[level, 1] -= before
    level = level_of(mass, chart.scale[0])
    if level >= 0:
        chart.levels[level, 0] += 1.0
        chart.levels[level, 1] += mass
    block = (row // BLOCK) * chart.peaks.shape[1] + col // BLOCK
    if kept and chart.stamp[block] != chart.counters[SIMULATION]:
        keep(chart, row // BLOCK, col // BLOCK)
    chart.mass[cell] = mass
    if chart.is_point:
        refresh(chart, row, col, row, col, before)
        return
    low_row, low_col, high_row, high_col = row, col, row, col
    for i in range(chart.spread.shape[0]):
        r, c = row + chart.spread[i, 0], col + chart.spread[i, 1]
        if not (0 <= r < chart.rows and 0 <= c < chart.cols) or chart.legal[r * chart.cols + c] == 0:
            continue
        if kept:
            keep(chart, r // BLOCK, c // BLOCK)
        chart.worth[r * chart.cols + c] = max(
            0.0, chart.worth[r * chart.cols + c] + chart.share[i] * (mass - before)
        )
        low_row, high_row = min(low_row, r), max(high_row, r)
        low_col, high_col = min(low_col, c), max(high_col, c)
    refresh(chart, low_row, low_col, high_row, high_col, np.inf)


@kernel
def refresh(chart: Chart, row: int, col: int, last_row: int, last_col: int, before: float) -> None:
    """Recompute the peaks over a rectangle of changed cells; `before` was the largest worth changed."""
    for block_row in range(row // BLOCK, last_row // BLOCK + 1):
        for block_col in range(col // BLOCK, last_col // BLOCK + 1):
            was = chart.peaks[block_row, block_col]
            cell = row * chart.cols + col
            if before < was and chart.is_point:
                chart.peaks[block_row, block_col] = max(was, chart.worth[cell])
            else:
                chart.peaks[block_row, block_col] = largest_in_block(
                    chart.worth, chart.rows, chart.cols, block_row, block_col
                )
            if chart.peaks[block_row, block_col] != was:
                refresh_above(chart, block_row, block_col, was)


@kernel
def refresh_above(chart: Chart, block_row: int, block_col: int, before: float) -> None:
    """Recompute what depends on the peak of a block, which was `before`."""
    now = chart.peaks[block_row, block_col]
    area_row, area_col = block_row // BLOCK, block_col // BLOCK
    was = chart.tops[area_row, area_col]
    if now > was:
        chart.tops[area_row, area_col] = now
    elif now < before and before >= was:
        recompute_area(chart, area_row, area_col)
    top = chart.tops[area_row, area_col]
    district_row, district_col = area_row // BLOCK, area_col // BLOCK
    if top > chart.crests[district_row, district_col]:
        chart.crests[district_row, district_col] = top
    elif top < was and was >= chart.crests[district_row, district_col]:
        recompute_district(chart, district_row, district_col)


@kernel
def gain_from(chart: Chart, row: int, col: int, heading: int) -> float:
    """What a look from this pose detects."""
    if chart.is_point:
        return float(chart.p_tp[0] * chart.mass[row * chart.cols + col])
    total = 0.0
    for i in range(chart.offsets.shape[1]):
        r, c = row + chart.offsets[heading, i, 0], col + chart.offsets[heading, i, 1]
        if 0 <= r < chart.rows and 0 <= c < chart.cols:
            total += chart.p_tp[i] * chart.mass[r * chart.cols + c]
    return total


@kernel
def look(chart: Chart, row: int, col: int, heading: int, kept: bool) -> float:
    """Look from this pose, see nothing, and leave 1 - p_tp of each mass; returns what the look detects."""
    total = 0.0
    for i in range(chart.offsets.shape[1]):
        r, c = row + chart.offsets[heading, i, 0], col + chart.offsets[heading, i, 1]
        if 0 <= r < chart.rows and 0 <= c < chart.cols:
            mass = chart.mass[r * chart.cols + c]
            if mass > 0.0:
                total += chart.p_tp[i] * mass
                change(chart, r, c, mass * (1.0 - chart.p_tp[i]), kept)
    return total


@kernel
def tick(chart: Chart) -> float:
    """A step passes in a simulation: the others make the looks that are due; returns what these detect."""
    others = chart.others
    others.counters[CLOCK] += 1
    total = 0.0
    i = others.counters[NEXT]
    while i < others.counters[COUNT] and others.when[i] <= others.counters[CLOCK]:
        cell = others.cell[i]
        mass = chart.mass[cell]
        if mass > 0.0:
            total += others.p_tp[i] * mass
            row = cell // chart.cols
            change(chart, row, cell - row * chart.cols, mass * (1.0 - others.p_tp[i]), True)
        i += 1
    others.counters[NEXT] = i
    return total


@kernel
def time_to_clear(
    levels: Floats, undetected: float, looks_per_halving: float, looks_per_step: float
) -> float:
    """The area under the survival curve of clearing what is left, most massive cells first, without travel.

    levels: float [LEVELS, 2], cells and mass by powers of two. Each cell of a level needs
    `looks_per_halving` looks to fall to the next one. Looks come `looks_per_step` in a step.
    """
    area = 0.0
    cells = mass = 0.0
    for level in range(LEVELS - 1):
        cells += max(levels[level, 0], 0.0)
        mass += max(levels[level, 1], 0.0)
        steps = cells * looks_per_halving / looks_per_step
        found = 0.5 * mass
        area += steps * (undetected - 0.5 * found)
        undetected = max(undetected - found, 0.0)
        mass -= found
    return area
