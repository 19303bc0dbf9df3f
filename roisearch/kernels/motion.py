"""When each cell of a path is reached: speeds that corners and acceleration allow, then times.

The aircraft flies straight from cell to cell at the cruising speed of the direction. At a turn it passes an arc that
begins and ends `zone` metres from the middle of the cell, at no more than the corner's speed, and stands for `wait`.
Two passes give the highest speeds that are possible: forwards what can be reached by speeding up, backwards what can
still be braked off before the next corner. Between two middles it speeds up, cruises if there is room, and brakes.
"""

from __future__ import annotations

from typing import NamedTuple

from roisearch.kernels.compiled import inlined, kernel
from roisearch.kernels.records import Floats, Ints


class Pace(NamedTuple):
    """A `Motion` as the kernels take it; turns are counted in eighths of a circle, 0 to 4.

    `cruise` [8] is the speed over ground by direction; `speed`, `zone`, `arc` and `wait` [5] belong to a turn: the
    speed on it, how far from the cell's middle it begins, how long it is, and the seconds stood in it.
    """

    straight_m: float
    diagonal_m: float
    accelerate: float
    brake: float
    cruise: Floats
    speed: Floats
    zone: Floats
    arc: Floats
    wait: Floats


class Climb(NamedTuple):
    """What heights cost: those at which each flat cell is flown over, `heights` [cells] in metres, none where the
    ground is flat; the seconds for a metre up and for a metre down; and how far below and above those heights the
    aircraft may be when it gets there.
    """

    heights: Floats
    up: float
    down: float
    below: float
    above: float


@inlined
def upright_seconds(here: int, there: int, climb: Climb) -> float:
    """Seconds for the change of height between two cells; only where there are heights."""
    rise = climb.heights[there] - climb.heights[here]
    return float(rise * climb.up if rise > 0.0 else -rise * climb.down)


@inlined
def follow(height: float, wanted: float, across: float, climb: Climb) -> tuple[float, float]:
    """The height after a move that takes `across` seconds, towards the `wanted` one, and the seconds that it takes
    more until that is near enough."""
    if wanted > height:
        height = min(wanted, height + across / climb.up)
        short = max(0.0, wanted - climb.below - height)
        return height + short, short * climb.up
    height = max(wanted, height - across / climb.down)
    short = max(0.0, height - wanted - climb.above)
    return height - short, short * climb.down


@kernel
def climb_along(heights: Floats, climb: Climb, times: Floats) -> None:
    """Let the cells that are reached at `times` [n] over flat ground be reached at `heights` [n]."""
    height, before, later = heights[0], times[0], 0.0
    for i in range(1, times.shape[0]):
        across = times[i] - before
        before = times[i]
        height, more = follow(height, heights[i], across, climb)
        later += more
        times[i] += later


@inlined
def direction_of(down: int, right: int) -> int:
    """The direction of a step to a neighbour, 0 north, clockwise to 7 north-west."""
    if down < 0:
        return (8 + right) & 7
    if down == 0:
        return 4 - 2 * right
    return 4 - right


@inlined
def turn_between(before: int, after: int) -> int:
    """How many eighths of a circle lie between two directions, 0 to 4."""
    apart = (after - before) & 7
    return min(apart, 8 - apart)


@inlined
def straight_seconds(
    length: float, begin: float, end: float, most: float, accelerate: float, brake: float
) -> float:
    """Seconds for `length` metres from speed `begin` to `end`, at most `most` in between."""
    if length <= 0.0:
        return 0.0
    if accelerate == float("inf"):
        return length / most
    peak = (
        (2.0 * length * accelerate * brake + brake * begin**2 + accelerate * end**2) / (accelerate + brake)
    ) ** 0.5
    peak = float(min(most, max(peak, begin, end)))
    up = max(0.0, (peak**2 - begin**2) / (2.0 * accelerate))
    down = max(0.0, (peak**2 - end**2) / (2.0 * brake))
    if up + down >= length:  # no room to cruise; from a start too fast for its corner, braking all the way
        return (
            2.0 * length / (begin + end)
            if peak <= max(begin, end)
            else (peak - begin) / accelerate + (peak - end) / brake
        )
    return (peak - begin) / accelerate + (peak - end) / brake + (length - up - down) / peak


@kernel
def arrive(
    rows: Ints,
    cols: Ints,
    direction: int,
    speed: float,
    pace: Pace,
    turns: Ints,
    speeds: Floats,
    times: Floats,
) -> None:
    """Fill `times` [n + 1] with the seconds at which each cell of `rows`, `cols` [n + 1] is reached.

    The first cell is where the aircraft is, heading for `direction` at `speed`. `turns` and `speeds` [n + 1] are
    room to work in; afterwards they tell the turn at each cell, and the speed there.
    """
    n = rows.shape[0] - 1
    before = direction
    wait = 0.0
    for i in range(n):
        after = direction_of(rows[i + 1] - rows[i], cols[i + 1] - cols[i])
        turns[i] = turn_between(before, after)
        if i == 0 and speed <= 0.0:  # it turns where it stands
            wait, turns[i] = pace.wait[turns[i]], 0
        speeds[i] = min(pace.speed[turns[i]], min(pace.cruise[before], pace.cruise[after]))
        before = after
    turns[n] = 0
    speeds[n] = pace.cruise[before]
    too_fast = max(0.0, speed - speeds[0])
    speeds[0] = min(speed, speeds[0])
    instant = pace.accelerate == float("inf")
    if not instant:
        for i in range(n):
            reach = (speeds[i] ** 2 + 2.0 * pace.accelerate * _free(i, rows, cols, turns, pace)) ** 0.5
            speeds[i + 1] = min(speeds[i + 1], reach)
        for i in range(n - 1, -1, -1):
            reach = (speeds[i + 1] ** 2 + 2.0 * pace.brake * _free(i, rows, cols, turns, pace)) ** 0.5
            if speeds[i] > reach:
                if i == 0:
                    too_fast += speeds[i] - reach
                speeds[i] = reach
    now = wait if instant else wait + too_fast / pace.brake
    times[0] = 0.0
    for i in range(n):
        after = direction_of(rows[i + 1] - rows[i], cols[i + 1] - cols[i])
        if pace.speed[turns[i]] <= 0.0:
            now += pace.wait[turns[i]]
        now += _half_arc(turns[i], speeds[i], pace)
        now += straight_seconds(
            _free(i, rows, cols, turns, pace),
            speeds[i],
            speeds[i + 1],
            pace.cruise[after],
            pace.accelerate,
            pace.brake,
        )
        now += _half_arc(turns[i + 1], speeds[i + 1], pace)
        times[i + 1] = now


@inlined
def _free(i: int, rows: Ints, cols: Ints, turns: Ints, pace: Pace) -> float:
    """Metres flown straight between the middles of cells i and i + 1, without the corners at both ends."""
    diagonal = rows[i] != rows[i + 1] and cols[i] != cols[i + 1]
    length = pace.diagonal_m if diagonal else pace.straight_m
    return float(length - pace.zone[turns[i]] - pace.zone[turns[i + 1]])


@inlined
def _half_arc(turn: int, speed: float, pace: Pace) -> float:
    """Seconds for half of a corner; never more than from a stand."""
    if pace.arc[turn] <= 0.0:
        return 0.0
    length = 0.5 * pace.arc[turn]
    stood = (2.0 * length / pace.accelerate) ** 0.5
    return float(min(stood, length / speed)) if speed > 0.0 else float(stood)
