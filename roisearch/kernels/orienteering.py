"""The way that finds most before it must lead home: laid through stops, judged exactly, and annealed.

This is the orienteering problem (Golden, Levy and Vohra, 1987) on a map: collect as much as can be within a time, and
get home. A course is a list of stops. From stop to stop it goes straight, a diagonal part and a straight one. Its
worth is what its looks find, cell after cell, until the first that must not be entered any more because from there the
aircraft would come home too late: which is what happens to any course in the air, too. So every course has a worth,
and that of the plan that is cut off is one of them.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from roisearch.kernels.compiled import inlined, kernel
from roisearch.kernels.draws import draw_unit
from roisearch.kernels.motion import Climb, Pace, arrive, direction_of, follow, turn_between
from roisearch.kernels.records import Floats, Ints

DOWN = (-1, -1, 0, 1, 1, 1, 0, -1)
RIGHT = (0, 1, 1, 1, 0, -1, -1, -1)
"""What a step in each of the eight directions adds to row and column."""


class Field(NamedTuple):
    """What is flown over, by flat cells, row * cols + col.

    `mass` [cells] is what can be found there, `p` [cells] the part of it that a look finds, `home_s` [cells] the
    seconds home; `allowed` [cells] are bits of the eight moves. `candidates` [k] are cells worth a look, the best
    first. `cols` counts the columns; `diagonal` is whether there are eight neighbours. `climb` is what heights cost.
    """

    mass: Floats
    p: Floats
    home_s: Floats
    allowed: NDArray[np.uint8]
    candidates: Ints
    cols: int
    diagonal: bool
    climb: Climb


class Outset(NamedTuple):
    """Where a course begins: the flat cell, the direction and speed of flight there, and the seconds until home."""

    cell: int
    direction: int
    speed: float
    remaining_s: float


class Room(NamedTuple):
    """Room to work in: a path's rows and columns, turns, speeds and times, and what its cells had, [most + 1] each."""

    rows: Ints
    cols: Ints
    turns: Ints
    speeds: Floats
    times: Floats
    had: Floats


def room_for(most: int) -> Room:
    """Room for courses of at most `most` cells."""
    rows, cols, turns = (np.zeros(most + 1, dtype=np.int64) for _ in range(3))
    return Room(rows, cols, turns, np.zeros(most + 1), np.zeros(most + 1), np.zeros(most + 1))


@inlined
def _parts(down: int, right: int, heading: int, diagonal: bool) -> tuple[int, int, int, int]:
    """The two straight parts of a way, direction and steps each, that first which turns less from `heading`."""
    row = (down > 0) - (down < 0)
    col = (right > 0) - (right < 0)
    both = min(abs(down), abs(right)) if diagonal else 0
    if both > 0:
        first, steps = direction_of(row, col), both
    else:
        first, steps = direction_of(row, 0), abs(down)
    rest = abs(down) + abs(right) - (2 * both if both > 0 else abs(down))
    second = first
    if rest > 0:
        second = direction_of(row, 0) if both > 0 and abs(down) > both else direction_of(0, col)
    if rest > 0 and (steps == 0 or turn_between(heading, second) < turn_between(heading, first)):
        return second, rest, first, steps
    return first, steps, second, rest


@kernel
def lay(pose: Outset, stops: Ints, size: int, field: Field, room: Room) -> int:
    """Lay a course through the first `size` stops; how many cells it enters, -1 where it cannot be flown.

    A course that is longer than there is room is cut there.
    """
    row, col = pose.cell // field.cols, pose.cell % field.cols
    room.rows[0], room.cols[0] = row, col
    heading, count = pose.direction, 0
    most = room.rows.shape[0] - 1
    for i in range(size):
        there_row, there_col = stops[i] // field.cols, stops[i] % field.cols
        if there_row == row and there_col == col:
            continue
        first, steps, second, rest = _parts(there_row - row, there_col - col, heading, field.diagonal)
        for part in range(2):
            direction = first if part == 0 else second
            for _ in range(steps if part == 0 else rest):
                if count == most:
                    return count
                if not field.allowed[row * field.cols + col] >> direction & 1:
                    return -1
                row += DOWN[direction]
                col += RIGHT[direction]
                count += 1
                room.rows[count], room.cols[count] = row, col
                heading = direction
    return count


@kernel
def judge(pose: Outset, count: int, field: Field, pace: Pace, room: Room) -> tuple[float, int]:
    """What the course of `count` cells that lies in `room` finds in time, and how many of its cells it enters."""
    if count <= 0:
        return 0.0, 0
    n = count + 1
    arrive(
        room.rows[:n], room.cols[:n], pose.direction, pose.speed, pace, room.turns[:n], room.speeds[:n], room.times[:n]
    )  # fmt: skip
    if field.climb.heights.size > 0:
        _climb(n, field, room)
    found, entered = 0.0, 0
    for i in range(1, n):
        cell = room.rows[i] * field.cols + room.cols[i]
        if room.times[i] + field.home_s[cell] > pose.remaining_s:
            break
        entered = i
        room.had[i] = field.mass[cell]
        found += field.p[cell] * field.mass[cell]
        field.mass[cell] *= 1.0 - field.p[cell]
    for i in range(entered, 0, -1):
        field.mass[room.rows[i] * field.cols + room.cols[i]] = room.had[i]
    return found, entered


@kernel
def _climb(n: int, field: Field, room: Room) -> None:
    """Let the first `n` cells that lie in `room` be reached at their heights; see `climb_along`."""
    height = field.climb.heights[room.rows[0] * field.cols + room.cols[0]]
    before, later = room.times[0], 0.0
    for i in range(1, n):
        across = room.times[i] - before
        before = room.times[i]
        wanted = field.climb.heights[room.rows[i] * field.cols + room.cols[i]]
        height, more = follow(height, wanted, across, field.climb)
        later += more
        room.times[i] += later


@inlined
def _apart(one: int, other: int, cols: int) -> float:
    """Steps between two cells, a diagonal one as long as it is."""
    down, right = abs(one // cols - other // cols), abs(one % cols - other % cols)
    return float(max(down, right)) + 0.4142135623730951 * float(min(down, right))


@inlined
def _best_place(cell: int, pose: Outset, stops: Ints, size: int, cols: int) -> int:
    """Before which stop `cell` is the shortest detour."""
    best, least = size, 1e300
    before = pose.cell
    for i in range(size + 1):
        detour = _apart(before, cell, cols)
        if i < size:
            detour += _apart(cell, stops[i], cols) - _apart(before, stops[i], cols)
            before = stops[i]
        if detour < least:
            best, least = i, detour
    return best


@kernel
def _propose(
    pose: Outset, stops: Ints, size: int, trial: Ints, field: Field, random: NDArray[np.uint64]
) -> int:
    """Write a changed course into `trial`; how many stops it has, -1 for none."""
    kind = draw_unit(random)
    first = last = 0  # stops first .. last - 1 are taken out
    if size > 0 and kind > 0.4:
        length = 1 + int(min(size, 12) * draw_unit(random) ** 3)
        first = int(draw_unit(random) * size)
        last = min(size, first + length)
    if 0.6 < kind < 0.7 and last - first > 1:
        for i in range(size):
            trial[i] = stops[first + last - 1 - i] if first <= i < last else stops[i]
        return size
    count = 0
    for i in range(size):
        if not first <= i < last:
            trial[count] = stops[i]
            count += 1
    if kind > 0.4 and kind < 0.7:
        return count
    return _put_in(pose, trial, count, first if last > first and kind > 0.85 else -1, field, random)


@kernel
def _put_in(
    pose: Outset, trial: Ints, count: int, place: int, field: Field, random: NDArray[np.uint64]
) -> int:
    """Put a cell that is worth a look into a course, or a straight line that begins there; -1 if there is no room."""
    k = field.candidates.shape[0]
    if k == 0 or count + 2 > trial.size:
        return -1
    cell = field.candidates[int(k * draw_unit(random))]
    if place < 0:
        place = _best_place(cell, pose, trial, count, field.cols)
    for i in range(count, place, -1):
        trial[i] = trial[i - 1]
    trial[place] = cell
    count += 1
    if draw_unit(random) < 0.4:
        direction = int(8.0 * draw_unit(random))
        steps = 1 + int(12.0 * draw_unit(random) ** 2)
        row = cell // field.cols + steps * DOWN[direction]
        col = cell % field.cols + steps * RIGHT[direction]
        if 0 <= row < field.mass.shape[0] // field.cols and 0 <= col < field.cols:
            for i in range(count, place + 1, -1):
                trial[i] = trial[i - 1]
            trial[place + 1] = row * field.cols + col
            count += 1
    return count


@inlined
def _copy(source: Ints, target: Ints, count: int) -> None:
    for i in range(count):
        target[i] = source[i]


@kernel
def improve(
    pose: Outset,
    orders: Ints,
    size: Ints,
    field: Field,
    pace: Pace,
    room: Room,
    how: Floats,
    random: NDArray[np.uint64],
) -> float:
    """Anneal a course of `size` [1] stops, the first of `orders` [3, most]; it then is the best one met.

    Returns what that finds. `how` [3] is the number of proposals and the temperatures, in mass, at first and at last.
    Of courses that find about the same, one that enters its last cell sooner is better: that leaves time for another
    look.
    """
    best, present, trial = orders[0], orders[1], orders[2]
    count = size[0]
    _copy(best, present, count)
    found, entered = judge(pose, lay(pose, present, count, field, room), field, pace, room)
    thrift = 1e-3 * how[1] / max(1.0, pose.remaining_s)
    score = found - thrift * room.times[entered]
    best_found, best_score = found, score
    proposals = int(how[0])
    for k in range(proposals):
        heat = how[1] * (how[2] / how[1]) ** (k / proposals)
        tried = _propose(pose, present, count, trial, field, random)
        cells = -1 if tried < 0 else lay(pose, trial, tried, field, room)
        if cells < 0:
            continue
        found, entered = judge(pose, cells, field, pace, room)
        after = found - thrift * room.times[entered]
        if after < score and draw_unit(random) >= np.exp((after - score) / heat):
            continue
        _copy(trial, present, tried)
        count, score = tried, after
        if score > best_score and found >= best_found:
            _copy(present, best, count)
            best_found, best_score = found, score
            size[0] = count
    return best_found
