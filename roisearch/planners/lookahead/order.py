"""The order of looks: annealing of a plan, look by look.

A plan is a row of looks, each worth what it detects. With w the worth of a look and t its step, the expected time of
the plan is the sum of w * t, and of the same for what is left undetected: the minimum latency problem, with weights.
Sums of w and of w * t along the row tell what two kinds of move change without going along it:

- a *turn*: a stretch of looks is made in the opposite order (2-opt);
- a *shift*: a stretch is made elsewhere, in the same order or in the opposite one (or-opt).

Both join looks that are near each other on the map. Most shifts are of what lies between two neighbours, so that the
gap that they leave closes: nearly all others make the way longer, and are not taken.

A move that makes the plan better is made; one that makes it worse is made with probability exp(-delay / temperature),
and the temperature falls. Delays are counted in steps for everything that is then undetected, so that one temperature
fits the start and the end of a search.

A look that comes before another one at the same cell is worth more than it was behind it, and a way between two looks
leads over cells that are looked at as well. Neither is counted here, so a plan is at least as good as its sums say.
`lay` flies it and sees.

The looks of a point field of view only: what a wider one sees from a pose depends on what it saw from the pose before.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from roisearch.kernels.compiled import inlined, kernel, light_kernel
from roisearch.kernels.draws import draw_unit
from roisearch.kernels.ground import cell_step, col_step, row_step
from roisearch.kernels.records import Bits, Floats, Ints, Pose, Steps
from roisearch.planners.lookahead.chart import Chart, begin, look, restore, tick
from roisearch.planners.lookahead.others import COUNT, SIZE
from roisearch.planners.lookahead.plans import (
    EXPECTED,
    LENGTH,
    NODES,
    NOW,
    UNDETECTED,
    Desk,
    PlanTree,
    adopt,
    rest,
)
from roisearch.planners.lookahead.sweeps import ANYWHERE, Option, fly, move_towards, sweep

NEAR = 24
"""Most neighbours that are known of a look."""
AROUND = ((-1, 0), (0, 1), (1, 0), (0, -1), (0, 0), (-1, -1), (-1, 1), (1, 1), (1, -1))
"""Rows down and columns to the right of the cells whose looks are neighbours, those a step away first."""
LENGTHS = 1024
"""Entries of the table that lengths of stretches are drawn from."""
TURNS, CLOSED = 0.1, 0.9
"""Part of the proposals that are turns, and part that are turns or shifts of what lies between two neighbours; the
others are shifts of any stretch."""
BESIDE = 0.9
"""Part of the neighbours in proposals that are a step away, where there are such."""
WAY = 12
"""Longest way between two looks where there are obstacles."""
STRIDE = 1024
"""Proposals at one temperature."""
FAR = 1 << 20
"""Distance of looks between which no way is known."""


class Looks(NamedTuple):
    """A row of looks; place 0 is where it begins, and stays.

    By place: `number` int32 [n], the look made there; row, col: int32 [n], worth: float [n], of that look; step:
    float [n], when it is made, place 0 at step 0; worths, moments: float [n], sums of worth and of worth * step up to
    that place. By look: `place` int32 [n]; action: int [n], what it belongs to in the plan; near: int32 [n, NEAR],
    looks at the cells AROUND, `nears` int32 [n] of them, and of these the first `besides` int32 [n] a step away.
    spare_number, spare_row, spare_col, spare_worth [n]: room for a stretch. last: int32 [cells], the last look at a
    cell while neighbours are sought, 0 for none; before: int32 [n], the look at the same cell before. lengths: int
    [LENGTHS], to draw from. rows, cols, legal, is_open: as in `Chart`.
    """

    rows: int
    cols: int
    legal: Bits
    is_open: bool
    number: Steps
    row: Steps
    col: Steps
    worth: Floats
    step: Floats
    worths: Floats
    moments: Floats
    place: Steps
    action: Ints
    near: Steps
    nears: Steps
    besides: Steps
    spare_number: Steps
    spare_row: Steps
    spare_col: Steps
    spare_worth: Floats
    last: Steps
    before: Steps
    lengths: Ints


@light_kernel
def line_up(pose: Pose, tree: PlanTree, desk: Desk, hold: int, looks: Looks) -> tuple[int, float]:
    """Make a row of the plan, with the neighbours of each look, from index `hold` of its path on.

    The pose is the one at NOW. Returns how many looks there are, the one at place 0 included, and what is undetected
    there.
    """
    chart = desk.chart
    begin(chart)
    now, end = tree.mark[NOW], tree.mark[LENGTH]
    _, whole, pose = fly(pose, chart, tree.value[UNDETECTED], tree.path, now, hold, True)
    left = whole
    looks.row[0], looks.col[0], looks.worth[0] = pose.row, pose.col, 0.0
    n = 1
    for i in range(hold, end):
        row, col = tree.path[i] // chart.cols, tree.path[i] % chart.cols
        looks.row[n], looks.col[n], looks.action[n] = row, col, tree.action[i]
        looks.worth[n] = look(chart, row, col, 0, True)
        left -= looks.worth[n] + tick(chart)
        n += 1
    restore(chart)
    for i in range(n):
        looks.number[i] = looks.place[i] = i
    looks.step[0] = looks.worths[0] = looks.moments[0] = 0.0
    add_up(1, n, looks)
    meet(n, looks)
    if chart.others.counters[COUNT] > 0:  # what the others find is not later when this row is longer
        whole = looks.worths[n - 1] + max(left, 0.0) / chart.others.counters[SIZE]
    return n, whole


@light_kernel
def meet(n: int, looks: Looks) -> None:
    """Find the neighbours of each look; the looks lie in the order of their numbers."""
    for i in range(1, n):
        cell = looks.row[i] * looks.cols + looks.col[i]
        looks.before[i] = looks.last[cell]
        looks.last[cell] = i
    for i in range(n):
        found = 0
        for way in range(9):
            row, col = looks.row[i] + AROUND[way][0], looks.col[i] + AROUND[way][1]
            if 0 <= row < looks.rows and 0 <= col < looks.cols:
                other = looks.last[row * looks.cols + col]
                while other > 0 and found < NEAR:
                    if other != i:
                        looks.near[i, found] = other
                        found += 1
                    other = looks.before[other]
            if way < 4:
                looks.besides[i] = found
        looks.nears[i] = found
    for i in range(1, n):
        looks.last[looks.row[i] * looks.cols + looks.col[i]] = 0


@light_kernel
def is_free(cell: int, down: int, right: int, rows_first: bool, looks: Looks) -> bool:
    """Whether the way with one bend, rows or columns first, is open."""
    for part in range(2):
        along_rows = rows_first == (part == 0)
        steps = down if along_rows else right
        move = (2 if steps > 0 else 0) if along_rows else (1 if steps > 0 else 3)
        for _ in range(abs(steps)):
            if not looks.legal[cell] >> move & 1:
                return False
            cell += cell_step(move, looks.cols)
    return True


@inlined
def steps_between(a: int, b: int, looks: Looks) -> int:
    """Steps from the look at place `a` to the one at `b`: two to look at the same cell again."""
    down, right = looks.row[b] - looks.row[a], looks.col[b] - looks.col[a]
    steps = abs(down) + abs(right)
    if steps == 0:
        return 2
    if looks.is_open:
        return int(steps)
    return int(steps_around(looks.row[a] * looks.cols + looks.col[a], down, right, looks))


@light_kernel
def steps_around(cell: int, down: int, right: int, looks: Looks) -> int:
    """Steps by a way with one bend that is open, FAR when there is none or it is long."""
    steps = abs(down) + abs(right)
    if steps <= WAY and (is_free(cell, down, right, True, looks) or is_free(cell, down, right, False, looks)):
        return steps
    return FAR


@inlined
def add_up(first: int, last: int, looks: Looks) -> None:
    """Steps and sums of the places from `first` to before `last`."""
    for i in range(first, last):
        looks.step[i] = looks.step[i - 1] + steps_between(i - 1, i, looks)
        looks.worths[i] = looks.worths[i - 1] + looks.worth[i]
        looks.moments[i] = looks.moments[i - 1] + looks.worth[i] * looks.step[i]


@inlined
def stretch_moment(first: int, last: int, start: float, turned: bool, looks: Looks) -> float:
    """By how much worth * step of places first..last grows when they are made from step `start` on."""
    worth = looks.worths[last] - looks.worths[first - 1]
    if turned:
        moment = looks.moments[last] - looks.moments[first - 1]
        return float(worth * (start + looks.step[last]) - 2.0 * moment)
    return float(worth * (start - looks.step[first]))


@inlined
def delay_of_turn(first: int, last: int, n: int, whole: float, looks: Looks) -> float:
    """By how much the expected time grows when places first..last are made in the opposite order."""
    start = looks.step[first - 1] + steps_between(first - 1, last, looks)
    end = start + looks.step[last] - looks.step[first]
    after = looks.step[last]
    if last + 1 < n:
        end += steps_between(first, last + 1, looks)
        after = looks.step[last + 1]
    return float(
        stretch_moment(first, last, start, True, looks) + (end - after) * (whole - looks.worths[last])
    )


@inlined
def delay_of_shift(first: int, last: int, to: int, turned: bool, n: int, whole: float, looks: Looks) -> float:
    """By how much the expected time grows when places first..last are made right after place `to`.

    `to` is before first - 1 or after `last`; last + 1 < n.
    """
    head, tail = (last, first) if turned else (first, last)
    takes = looks.step[last] - looks.step[first]
    closed = looks.step[first - 1] + steps_between(first - 1, last + 1, looks) - looks.step[last + 1]
    start = looks.step[to] + steps_between(to, head, looks)
    if to < first:
        opened = start + takes + steps_between(tail, to + 1, looks) - looks.step[to + 1]
        return float(
            stretch_moment(first, last, start, turned, looks)
            + opened * (looks.worths[first - 1] - looks.worths[to])
            + (opened + closed) * (whole - looks.worths[last])
        )
    start += closed
    end, after = start + takes, looks.step[to]
    if to + 1 < n:
        end += steps_between(tail, to + 1, looks)
        after = looks.step[to + 1]
    return float(
        closed * (looks.worths[to] - looks.worths[last])
        + stretch_moment(first, last, start, turned, looks)
        + (end - after) * (whole - looks.worths[to])
    )


@inlined
def put(source: int, target: int, looks: Looks) -> None:
    """Make the look of place `source` at place `target`."""
    looks.number[target] = looks.number[source]
    looks.row[target], looks.col[target] = looks.row[source], looks.col[source]
    looks.worth[target] = looks.worth[source]


@kernel
def rearrange(first: int, last: int, to: int, turned: bool, n: int, looks: Looks) -> None:
    """Make places first..last right after place `to`; with to = first - 1, where they are."""
    length = last - first + 1
    for i in range(length):
        source = last - i if turned else first + i
        looks.spare_number[i] = looks.number[source]
        looks.spare_row[i], looks.spare_col[i] = looks.row[source], looks.col[source]
        looks.spare_worth[i] = looks.worth[source]
    target = to + 1
    begun, done = min(first, target), max(last, to)
    if to > last:
        target = to + 1 - length
        for i in range(first, target):
            put(i + length, i, looks)
    else:
        for i in range(last, to + length, -1):
            put(i - length, i, looks)
    for i in range(length):
        looks.number[target + i] = looks.spare_number[i]
        looks.row[target + i], looks.col[target + i] = looks.spare_row[i], looks.spare_col[i]
        looks.worth[target + i] = looks.spare_worth[i]
    moment = looks.moments[done]
    add_up(begun, done + 1, looks)
    for i in range(begun, done + 1):
        looks.place[looks.number[i]] = i
    if done + 1 < n:
        later = looks.step[done] + steps_between(done, done + 1, looks) - looks.step[done + 1]
        moment = looks.moments[done] - moment
        for i in range(done + 1, n):
            looks.step[i] += later
            looks.moments[i] += moment + later * (looks.worths[i] - looks.worths[done])


@inlined
def near_place(place: int, state: NDArray[np.uint64], looks: Looks) -> int:
    """The place of a look near that of `place`, BESIDE of the time a step away; the place itself if there is none."""
    look = looks.number[place]
    choice = draw_unit(state) / BESIDE
    found = looks.besides[look]
    if choice >= 1.0 or found == 0:
        choice, found = draw_unit(state), looks.nears[look]
    return int(looks.place[looks.near[look, int(choice * found)]]) if found > 0 else place


@kernel
def anneal(
    n: int,
    whole: float,
    looks: Looks,
    state: NDArray[np.uint64],
    proposals: int,
    hot: float,
    cold: float,
) -> float:
    """Propose so many moves while the temperature falls from `hot` to `cold`, in steps; returns the delay made."""
    total, temperature = 0.0, hot
    cooling = (cold / hot) ** (STRIDE / max(proposals, STRIDE))
    spent, cooled = 0, STRIDE
    while spent < proposals and n > 3:
        spent += 1
        if spent >= cooled:
            temperature *= cooling
            cooled += STRIDE
        share = draw_unit(state)
        place = int(share * np.sqrt(share) * (n - 1))  # what is done soon matters most
        kind = draw_unit(state)
        if kind < TURNS:
            first, last, to, turned = place + 1, near_place(place, state, looks), place, True
            if last <= first:
                continue
            delay = delay_of_turn(first, last, n, whole, looks)
        else:
            if kind < CLOSED:
                other = near_place(place, state, looks)
                first, last = min(place, other) + 1, max(place, other) - 1
            else:
                first = place + 1
                last = place + looks.lengths[int(draw_unit(state) * LENGTHS)]
            if last < first or last + 1 >= n:
                continue
            from_first = draw_unit(state) < 0.5
            behind = draw_unit(state) < 0.5
            to = near_place(first if from_first else last, state, looks)
            if first <= to <= last:
                continue
            if not behind:
                to -= 1
            if to == last or to == first - 1:
                continue
            turned = from_first != behind
            delay = delay_of_shift(first, last, to, turned, n, whole, looks)
        if delay > -1e-15:
            left = max(0.0, whole - looks.worths[min(first, to)])
            worse = delay / (temperature * left + 1e-300)
            if worse > 8.0 or np.exp(-worse) < draw_unit(state):
                continue
        rearrange(first, last, to, turned, n, looks)
        spent += (max(last, to) - min(first, to)) // 8 + n // 64  # so that an iteration takes as long
        total += delay
    return total


@light_kernel
def move_on(row: int, col: int, to_row: int, to_col: int, looks: Looks, chart: Chart) -> int:
    """The next move on the way from one look to the next."""
    cell, down, right = row * chart.cols + col, to_row - row, to_col - col
    if down == 0 and right == 0:  # out of the cell, to look at it again
        best, most = 0, -1.0
        for move in range(4):
            if chart.legal[cell] >> move & 1:
                mass = chart.mass[cell + cell_step(move, chart.cols)]
                if mass > most:
                    best, most = move, mass
        return best
    vertical, horizontal = (2 if down > 0 else 0), (1 if right > 0 else 3)
    if down == 0 or right == 0 or chart.is_open:
        return move_towards(row, col, to_row * chart.cols + to_col, chart)
    return vertical if is_free(cell, down, right, True, looks) else horizontal


@light_kernel
def lay(pose: Pose, n: int, looks: Looks, tree: PlanTree, desk: Desk, hold: int) -> bool:
    """Fly the row of looks from index `hold` of the path on, and make it the plan if it is better; whether it is.

    The pose is the one at NOW.
    """
    chart = desk.chart
    begin(chart)
    now, end = tree.mark[NOW], tree.mark[LENGTH]
    area, undetected, pose = fly(pose, chart, tree.value[UNDETECTED], tree.path, now, hold, True)
    row, col, heading = pose.row, pose.col, pose.heading
    t = hold
    for place in range(1, n):
        to_row, to_col = looks.row[place], looks.col[place]
        first = True
        while t < end and (first or row != to_row or col != to_col):
            heading = move_on(row, col, to_row, to_col, looks, chart)
            row, col = row + row_step(heading), col + col_step(heading)
            area += undetected
            undetected = max(0.0, undetected - look(chart, row, col, heading, True))
            undetected = max(0.0, undetected - tick(chart))
            tree.trial[t], tree.trial_action[t] = row * chart.cols + col, looks.action[looks.number[place]]
            t += 1
            first = False
    anywhere = Option(desk.rules.nears[0], ANYWHERE, 0.0)
    more, undetected, steps, _ = sweep(
        Pose(row, col, heading), chart, anywhere, end - t, undetected, tree.trial, t
    )
    for i in range(t, t + steps):
        tree.trial_action[i] = ANYWHERE
    area += more + rest(chart, undetected, desk.rules)
    restore(chart)
    loss = area - tree.value[EXPECTED]
    if t + steps < end or loss >= -1e-12 * tree.value[EXPECTED]:
        return False
    node = 0
    while node + 1 < tree.mark[NODES] and tree.at[node + 1] <= hold:
        node += 1
    adopt(node, hold, end, loss, tree)
    return True
