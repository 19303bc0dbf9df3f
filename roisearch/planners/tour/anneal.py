"""Annealing a tour: stretches are turned round, or taken out and put in elsewhere.

A proposal brings a look next to a look at a neighbouring cell, as good tours have them: either the stretch between the
two is turned round, or a stretch that begins or ends at the neighbour moves there. `price` says at once what it would
cost. A worse tour is taken with probability exp(-loss / temperature), and the temperature falls.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from roisearch.kernels.compiled import kernel
from roisearch.kernels.draws import draw_unit
from roisearch.kernels.records import Ints
from roisearch.planners.tour.tour import Prices, Tour, cost_of, price, settle

LONGEST = 400.0
"""The most looks in a stretch that moves."""


@kernel
def neighbour_of(node: int, random: NDArray[np.uint64], tour: Tour, prices: Prices) -> int:
    """A look at one of the eight cells around that of `node`; -1 when none is planned there."""
    place = int(8.0 * draw_unit(random))
    down = -1 if place < 3 else (0 if place < 5 else 1)
    right = place - 1 if place < 3 else (2 * (place - 3) - 1 if place < 5 else place - 6)
    row, col = tour.row[node] + down, tour.col[node] + right
    if col < 0 or col >= prices.cols or row < 0:
        return -1
    cell = row * prices.cols + col
    if cell >= tour.first.size:
        return -1
    found = tour.first[cell]
    while found >= 0 and tour.next[found] >= 0 and draw_unit(random) < 0.5:
        found = tour.next[found]
    return int(found)


@kernel
def propose(
    here: int, there: int, random: NDArray[np.uint64], pieces: Ints, size: int
) -> tuple[int, int, int]:
    """Draw a change that brings the looks at positions `here` and `there` side by side.

    Returns the last position that stays, how many of `pieces` follow it, and the last position that changes; no pieces
    when nothing would change.
    """
    kind = draw_unit(random)
    if kind < 0.25:  # turn the stretch between round
        if here < there:
            pieces[0, 0], pieces[0, 1] = there, here + 1
            return here, 0 if there == here + 1 else 1, there
        pieces[0, 0], pieces[0, 1] = here - 1, there
        return there - 1, 0 if there == here - 1 else 1, here - 1
    length = int(LONGEST ** draw_unit(random)) if kind >= 0.4 else 1
    onward = draw_unit(random) < 0.5
    begin, end = (there, there + length - 1) if onward else (there - length + 1, there)
    after = draw_unit(random) < 0.5
    gap = here if after else here - 1  # the position behind which the stretch is put in
    if begin < 1 or end > size or begin <= here <= end or begin <= gap <= end or gap < 0:
        return 0, 0, 0
    turned = length > 1 and (there == end) == after
    first, last = (end, begin) if turned else (begin, end)
    if gap < begin:
        pieces[0, 0], pieces[0, 1] = first, last
        if gap + 1 == begin:
            return gap, 1 if turned else 0, end
        pieces[1, 0], pieces[1, 1] = gap + 1, begin - 1
        return gap, 2, end
    pieces[0, 0], pieces[0, 1] = end + 1, gap
    pieces[1, 0], pieces[1, 1] = first, last
    return begin - 1, 2, gap


@kernel
def rearrange(lead: int, pieces: Ints, count: int, room: Ints, tour: Tour) -> None:
    """Put the pieces behind `lead`."""
    k = 0
    for i in range(count):
        begin, end = pieces[i, 0], pieces[i, 1]
        step = 1 if begin <= end else -1
        for j in range(begin, end + step, step):
            room[k] = tour.order[j]
            k += 1
    for j in range(k):
        tour.order[lead + 1 + j] = room[j]


@kernel
def anneal(
    window: tuple[int, int],
    proposals: int,
    heat: tuple[float, float],
    random: NDArray[np.uint64],
    room: Ints,
    pieces: Ints,
    tour: Tour,
    prices: Prices,
) -> float:
    """Anneal what lies in a window of positions, first and last; the old order comes back unless it gets better.

    `heat` is the temperature at first and at last, `room` [2, positions] and `pieces` [4, 2] room to work in. Returns
    what was gained, 0 if nothing.
    """
    size = tour.size[0]
    first, last = max(1, window[0]), min(size, window[1])
    before = cost_of(tour, prices)
    if last - first < 1:
        return 0.0
    for k in range(size + 1):
        room[1, k] = tour.order[k]
    cost, temperature = before, heat[0]
    cooling = (heat[1] / heat[0]) ** (64.0 / max(64, proposals))
    for i in range(proposals):
        if i & 63 == 63:
            temperature *= cooling
        here = first + int(draw_unit(random) * (last - first + 1))
        near = neighbour_of(tour.order[here], random, tour, prices)
        if near < 0:
            continue
        there = tour.place[near]
        if there == here or there < 1:
            continue
        lead, count, top = propose(here, there, random, pieces, size)
        if count == 0:
            continue
        kept = count
        if top < size:
            pieces[count, 0], pieces[count, 1] = top + 1, size
            kept += 1
        loss = price(lead, pieces, kept, tour, prices) - cost
        if loss < 0.0 or draw_unit(random) < np.exp(-loss / temperature):
            rearrange(lead, pieces, count, room[0], tour)
            settle(tour, prices, lead, top)
            cost = cost_of(tour, prices)
    gained = before - cost
    if gained > 1e-12 * before:
        return float(gained)
    for k in range(size + 1):
        tour.order[k] = room[1, k]
    settle(tour, prices, 0, size)
    return 0.0
