"""A tour of looks and what it costs: the expected seconds until the target is detected.

A tour enters cells in order; entering a cell is a look at it, worth the probability that the target is detected there
and then. With t(k) the time of the k-th look, the tour costs sum worth(k) t(k), plus the mass that it leaves times its
end. Legs are straight lines at full speed, and each corner costs what `Motion` asks for it beside, half before and half
after the cell's middle; so a stretch of the tour takes as long backwards, and keeps its inner times when it is moved.
Over ground with heights a step takes no less than its climb or descent, forth and back not alike, so the times of a
stretch that is turned round are kept as well. With running sums of worth and of worth times time, any tour that is put
together from a few stretches of this one is priced in constant time, however long they are: that is what annealing
lives on.

Positions count from 0, where the aircraft is; nodes are looks, and node 0 is the aircraft.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from roisearch.kernels.compiled import inlined, kernel
from roisearch.kernels.motion import Climb, upright_seconds
from roisearch.kernels.records import Floats, Ints
from roisearch.planners.tour.landmarks import STRAIGHT, apart

Links = NDArray[np.int32]
Bits = NDArray[np.uint8]

NOWHERE = 16
"""The bearing of a leg from a cell to itself, out and back."""
BLOCKED = 3.0
"""A leg that is not free is priced as so many times its length at least: there is a way around, which is known to be
longer where there are landmarks."""


class Tour(NamedTuple):
    """The looks and their order; all arrays are of the same length, nodes or positions.

    `size` [2] is the last position, and the aircraft's bearing. By node: `row`, `col`, `worth`, `place`, and `next`,
    which leads from a look at a cell to another one at the same cell, -1 at the end; `first` [cells] begins it. By
    position: `order` is the node, `bearing` that of the leg to it, `bend` the seconds of the corner there, `time` when
    it is reached, `mass` and `moment` the sums of worth, and of worth times time, up to it. `back` and `moment_back`
    are `time` and `moment` with each leg flown the other way: over flat ground the very same arrays.
    """

    size: Ints
    row: Ints
    col: Ints
    worth: Floats
    place: Ints
    next: Links
    first: Links
    order: Ints
    bearing: Ints
    bend: Floats
    time: Floats
    mass: Floats
    moment: Floats
    back: Floats
    moment_back: Floats


class Prices(NamedTuple):
    """Seconds: of a step along each of four axes from north-south on, of corners by 22.5 degrees [9], of a `jump`'s
    corner where a leg changes from diagonal to straight; `rest` [1] is the mass left when the tour ends.

    `allowed` [cells] has bit d set where a cell can be left in direction d. `climb` is what heights cost. `far` [n,
    cells] are distances from landmarks; see `tour.landmarks`.
    """

    axis: Floats
    corner: Floats
    jump: float
    rest: Floats
    allowed: Bits
    cols: int
    is_open: bool
    diagonal: bool
    climb: Climb
    far: Links


@inlined
def bearing_of(down: int, right: int) -> int:
    """The compass bearing of a line in sixteenths of a circle, clockwise from north; NOWHERE if it has no length."""
    a, b = abs(down), abs(right)
    if a == 0 and b == 0:
        return NOWHERE
    if b * 1000 < a * 199:
        part = 0
    elif b * 1000 < a * 668:
        part = 1
    elif b * 1000 < a * 1497:
        part = 2
    elif b * 1000 < a * 5027:
        part = 3
    else:
        part = 4
    if down <= 0:
        return part if right >= 0 else (16 - part) & 15
    return 8 - part if right >= 0 else 8 + part


@inlined
def backwards(bearing: int) -> int:
    """The bearing of a leg that is flown the other way."""
    return bearing if bearing == NOWHERE else (bearing + 8) & 15


@inlined
def corner_between(before: int, after: int, prices: Prices) -> float:
    """Seconds that the corner between two bearings costs; those of out and back are in its leg.

    Out and back twice, once to either side, takes two turns and not four.
    """
    if before == NOWHERE or after == NOWHERE:
        return float(-2.0 * prices.corner[8]) if before == after else 0.0
    apart = (after - before) & 15
    return float(prices.corner[min(apart, 16 - apart)])


@kernel
def leg(row: int, col: int, to_row: int, to_col: int, prices: Prices) -> float:
    """Seconds of the straight line between two cells, at the speed that heights allow; of a cell to itself, out and
    back over flat ground."""
    down, right = abs(to_row - row), abs(to_col - col)
    if down == 0 and right == 0:
        return float(prices.axis[0] + prices.axis[2] + 2.0 * prices.corner[8])
    if not prices.diagonal:
        seconds = down * prices.axis[0] + right * prices.axis[2]
        both = 0
    else:
        both = min(down, right)
        axis = 1 if (to_row > row) != (to_col > col) else 3
        seconds = both * prices.axis[axis] + (down - both) * prices.axis[0] + (right - both) * prices.axis[2]
        if both > 0 and down != right:
            seconds += prices.jump
    if prices.climb.heights.size > 0:
        seconds += climbing(row, col, to_row, to_col, both, prices)
    if not prices.is_open and not is_free(row, col, to_row, to_col, both, prices):
        seconds = BLOCKED * (seconds + prices.axis[0] + prices.axis[2])
        if prices.far.shape[0] > 0:
            around = apart(row * prices.cols + col, to_row * prices.cols + to_col, prices.far) / STRAIGHT
            seconds = max(seconds, around * min(prices.axis[0], prices.axis[2]))
    return float(seconds)


@kernel
def climbing(row: int, col: int, to_row: int, to_col: int, both: int, prices: Prices) -> float:
    """Seconds that climbs and descents add to a leg that is first diagonal, for `both` steps, and then straight."""
    down, right = (to_row > row) - (to_row < row), (to_col > col) - (to_col < col)
    rows, cols = abs(to_row - row) - both, abs(to_col - col) - both
    cell, more = row * prices.cols + col, 0.0
    for part in range(3):
        count = both if part == 0 else (rows if part == 1 else cols)
        a, b = 0 if part == 2 else down, 0 if part == 1 else right
        step = prices.axis[(bearing_of(a, b) >> 1) & 3]
        for _ in range(count):
            there = cell + a * prices.cols + b
            more += max(0.0, upright_seconds(cell, there, prices.climb) - step)
            cell = there
    return more


@kernel
def is_free(row: int, col: int, to_row: int, to_col: int, both: int, prices: Prices) -> bool:
    """Whether one of the two ways that are first straight or first diagonal is free."""
    down, right = (to_row > row) - (to_row < row), (to_col > col) - (to_col < col)
    rows, cols = abs(to_row - row) - both, abs(to_col - col) - both
    for turn in range(2):
        cell, free = row * prices.cols + col, True
        for part in range(3):
            which = part if turn == 0 else 2 - part
            if which == 0:
                count, a, b = both, down, right
            elif which == 1:
                count, a, b = rows, down, 0
            else:
                count, a, b = cols, 0, right
            bit = bearing_of(a, b) >> 1
            for _ in range(count):
                if not prices.allowed[cell] >> bit & 1:
                    free = False
                    break
                cell += a * prices.cols + b
            if not free:
                break
        if free:
            return True
    return False


@kernel
def settle(tour: Tour, prices: Prices, lead: int, last: int) -> None:
    """Bring everything by position up to date after the order changed behind `lead` up to `last`."""
    size = tour.size[0]
    top = min(last + 1, size)
    begun = tour.time[lead] - 0.5 * tour.bend[lead]
    if lead == 0:
        begun = 0.0
    for k in range(lead + 1, top + 1):
        a, b = tour.order[k - 1], tour.order[k]
        tour.bearing[k] = bearing_of(tour.row[b] - tour.row[a], tour.col[b] - tour.col[a])
        tour.place[b] = k
    was = tour.time[top] + 0.5 * tour.bend[top]
    begun_back, was_back = tour.back[lead] - 0.5 * tour.bend[lead], tour.back[top] + 0.5 * tour.bend[top]
    tour.bearing[0] = tour.size[1]
    for k in range(lead, top + 1):
        b = tour.order[k]
        tour.bend[k] = corner_between(tour.bearing[k], tour.bearing[k + 1], prices) if k < size else 0.0
        if k == lead:
            tour.time[k] = begun + 0.5 * tour.bend[k]
        else:
            a = tour.order[k - 1]
            seconds = leg(tour.row[a], tour.col[a], tour.row[b], tour.col[b], prices)
            tour.time[k] = tour.time[k - 1] + 0.5 * (tour.bend[k - 1] + tour.bend[k]) + seconds
        if k == 0:
            tour.mass[0], tour.moment[0] = 0.0, 0.0
        else:
            tour.mass[k] = tour.mass[k - 1] + tour.worth[b]
            tour.moment[k] = tour.moment[k - 1] + tour.worth[b] * tour.time[k]
    later = tour.time[top] + 0.5 * tour.bend[top] - was
    mass, moment = tour.mass[top], tour.moment[top]
    for k in range(top + 1, size + 1):
        b = tour.order[k]
        tour.time[k] += later
        mass += tour.worth[b]
        moment += tour.worth[b] * tour.time[k]
        tour.mass[k], tour.moment[k] = mass, moment
    if prices.climb.heights.size > 0:
        _settle_back(tour, prices, lead, top, begun_back, was_back)


@kernel
def _settle_back(tour: Tour, prices: Prices, lead: int, top: int, begun: float, was: float) -> None:
    """The same for `back` and `moment_back`, once the rest is up to date; see `settle`."""
    size = tour.size[0]
    tour.back[lead] = (begun if lead > 0 else 0.0) + 0.5 * tour.bend[lead]
    for k in range(lead + 1, top + 1):
        a, b = tour.order[k - 1], tour.order[k]
        seconds = leg(tour.row[b], tour.col[b], tour.row[a], tour.col[a], prices)
        tour.back[k] = tour.back[k - 1] + 0.5 * (tour.bend[k - 1] + tour.bend[k]) + seconds
    later = tour.back[top] + 0.5 * tour.bend[top] - was
    for k in range(top + 1, size + 1):
        tour.back[k] += later
    tour.moment_back[0] = 0.0
    for k in range(max(1, lead), size + 1):
        tour.moment_back[k] = tour.moment_back[k - 1] + tour.worth[tour.order[k]] * tour.back[k]


@kernel
def cost_of(tour: Tour, prices: Prices) -> float:
    """The expected seconds of the settled tour, times the mass."""
    size = tour.size[0]
    return float(tour.moment[size] + prices.rest[0] * tour.time[size])


@kernel
def price(lead: int, pieces: Ints, count: int, tour: Tour, prices: Prices) -> float:
    """What the tour would cost if the first `count` of `pieces` [n, 2] followed position `lead`.

    A piece is a stretch of positions, from its first to its last as it will be flown; backwards when the first is the
    greater. A piece may be the single position after the tour's end.
    """
    row, col, worth = tour.row, tour.col, tour.worth
    node = tour.order[lead]
    now = tour.time[lead] - 0.5 * tour.bend[lead]
    before = tour.bearing[lead]
    cost = tour.moment[lead] - worth[node] * tour.time[lead]
    for i in range(count):
        begin, end = pieces[i, 0], pieces[i, 1]
        to = tour.order[begin]
        bearing = bearing_of(row[to] - row[node], col[to] - col[node])
        bend = corner_between(before, bearing, prices)
        cost += worth[node] * (now + 0.5 * bend)
        now += bend + leg(row[node], col[node], row[to], col[to], prices)
        node, before = to, bearing
        if begin == end:
            continue
        if begin < end:
            bend = corner_between(bearing, tour.bearing[begin + 1], prices)
            cost += worth[node] * (now + 0.5 * bend)
            later = now + bend - tour.time[begin] - 0.5 * tour.bend[begin]
            cost += (
                (tour.mass[end - 1] - tour.mass[begin]) * later + tour.moment[end - 1] - tour.moment[begin]
            )
            now = later + tour.time[end] - 0.5 * tour.bend[end]
            before = tour.bearing[end]
        else:
            bend = corner_between(bearing, backwards(tour.bearing[begin]), prices)
            cost += worth[node] * (now + 0.5 * bend)
            turned = now + bend + tour.back[begin] - 0.5 * tour.bend[begin]
            cost += (tour.mass[begin - 1] - tour.mass[end]) * turned
            cost -= tour.moment_back[begin - 1] - tour.moment_back[end]
            now = turned - tour.back[end] - 0.5 * tour.bend[end]
            before = backwards(tour.bearing[end + 1])
        node = tour.order[end]
    return float(cost + worth[node] * now + prices.rest[0] * now)


@kernel
def insert_best(node: int, pieces: Ints, tour: Tour, prices: Prices) -> int:
    """Put `node`, which is in no position yet, where it costs least; that position."""
    size = tour.size[0]
    tour.order[size + 1] = node
    best, lead = np.inf, size
    for k in range(size + 1):
        pieces[0, 0] = pieces[0, 1] = size + 1
        count = 1
        if k < size:
            pieces[1, 0], pieces[1, 1] = k + 1, size
            count = 2
        cost = price(k, pieces, count, tour, prices)
        if cost < best:
            best, lead = cost, k
    for k in range(size + 1, lead + 1, -1):
        tour.order[k] = tour.order[k - 1]
    tour.order[lead + 1] = node
    tour.size[0] = size + 1
    settle(tour, prices, 0, size + 1)
    return int(lead) + 1
