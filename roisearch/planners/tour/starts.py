"""Tours to begin with: lawnmowers over everything, over one level after the other, and a rule's tour."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np

from roisearch.kernels.compiled import kernel
from roisearch.kernels.records import Floats, Ints
from roisearch.planners.lanes import CORNERS, lawnmower
from roisearch.planners.tour.tour import Prices, Tour, bearing_of, corner_between, leg

POWER = 1.3
"""The rule's exponent of worth: how much a likely look counts against a near one."""
TURNING = 0.05
"""What part of its price a corner has for the rule; at the full price it leaves crumbs to be fetched later."""
BANDS = (4.0, 6.0, 10.0)
"""Looks whose worth differs by less than this factor are flown over in one go."""
_LEAST_SHARE = 1e-30
"""Looks of which none is worth a larger share of the best are flown over in one go, too."""
PLAIN = 2 * len(CORNERS)
"""So many of `swept` come first: lawnmowers over everything at once."""


@kernel
def by_rule(likely: Floats, left: Ints, tour: Tour, prices: Prices) -> None:
    """Order the looks by a rule: next comes the one with the largest worth ** POWER / seconds.

    `likely` and `left` are of the tour's length, room to work in.
    """
    size = tour.size[0]
    for node in range(1, size + 1):
        left[node - 1] = tour.order[node]
    for i in range(size):
        likely[i] = tour.worth[left[i]] ** POWER
    here, before = 0, tour.size[1]
    for k in range(1, size + 1):
        best, chosen = -1.0, 0
        row, col = tour.row[here], tour.col[here]
        for i in range(size + 1 - k):
            to = left[i]
            apart = max(abs(tour.row[to] - row), abs(tour.col[to] - col)) * prices.axis[0]
            if likely[i] <= best * apart:
                continue
            bend = TURNING * corner_between(
                before, bearing_of(tour.row[to] - row, tour.col[to] - col), prices
            )
            score = likely[i] / (bend + leg(row, col, tour.row[to], tour.col[to], prices))
            if score > best:
                best, chosen = score, i
        to = left[chosen]
        tour.order[k] = to
        before = bearing_of(tour.row[to] - row, tour.col[to] - col)
        here = to
        left[chosen], likely[chosen] = left[size - k], likely[size - k]


def swept(cells: Ints, worth: Floats, cols: int, at: int) -> Iterator[Ints]:
    """Orders of the looks at `cells` [n] along lawnmowers, int [n]: all at once, and band after band of worth.

    A further look at a cell waits for the next lawnmower. `at` is where the aircraft is, flat.
    """
    for factor in (np.inf, *BANDS):
        band = np.zeros(cells.size, dtype=np.int64)
        if np.isfinite(factor):
            least = worth.max() * _LEAST_SHARE  # a walk leaves next to nothing in some cells
            band = np.floor(np.log(worth.max() / np.maximum(worth, least)) / np.log(factor)).astype(np.int64)
        band = _one_look_each(cells, band)
        for turned, corner in itertools.product((False, True), CORNERS):
            pieces: list[Ints] = []
            here = at
            for value in np.unique(band):
                chosen = np.flatnonzero(band == value)
                begin = _nearest_corner(cells[chosen], cols, here) if pieces else corner
                pieces.append(chosen[_along(cells[chosen], cols, turned, begin)])
                here = int(cells[pieces[-1][-1]])
            yield np.concatenate(pieces)


def _one_look_each(cells: Ints, band: Ints) -> Ints:
    """`band` with every further look at a cell moved to a later band than the one before."""
    band = band.copy()
    last, level = -1, -1
    for i in np.lexsort((band, cells)).tolist():
        level = max(int(band[i]), level + 1) if cells[i] == last else int(band[i])
        band[i], last = level, int(cells[i])
    return band


def _along(cells: Ints, cols: int, turned: bool, corner: tuple[bool, bool]) -> Ints:
    """The order of `cells`, all different, along a lawnmower over them."""
    rows, columns = np.divmod(cells, cols)
    rows, columns = rows - rows.min(), columns - columns.min()
    shape = (int(rows.max()) + 1, int(columns.max()) + 1)
    wanted = np.zeros(shape, dtype=bool)
    wanted[rows, columns] = True
    local = rows * shape[1] + columns
    place = np.empty(wanted.size, dtype=np.int64)
    order = lawnmower(wanted, wanted, turned, corner)
    place[order] = np.arange(order.size)
    return np.argsort(place[local])


def _nearest_corner(cells: Ints, cols: int, here: int) -> tuple[bool, bool]:
    """The corner of the box around `cells` that is nearest to `here`."""
    rows, columns = np.divmod(cells, cols)
    row, col = divmod(here, cols)
    return bool(2 * row > rows.min() + rows.max()), bool(2 * col > columns.min() + columns.max())
