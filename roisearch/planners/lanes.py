"""Lawnmowers over any shape: lanes along rows or along columns, one after the other without jumps if that can be.

A lane is cut into runs where there is nothing to look at. From the end of a run the nearest end of an unflown run comes
next, which on a convex shape is the next lane, there and back, and in a concave one finishes an arm before it
comes back for the other.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from roisearch.kernels.compiled import kernel

CORNERS = ((False, False), (False, True), (True, False), (True, True))
"""Where a lawnmower begins: at the bottom instead of the top, at the right instead of the left."""


def lawnmowers(
    wanted: NDArray[np.bool_], flyable: NDArray[np.bool_], swath: int = 1
) -> list[NDArray[np.int64]]:
    """Every lawnmower over what is `wanted`: rows and columns, each from each corner; see `lawnmower`."""
    found = [
        lawnmower(wanted, flyable, turned, corner, swath) for turned in (False, True) for corner in CORNERS
    ]
    return [order for order in found if order.size]


def lawnmower(
    wanted: NDArray[np.bool_],
    flyable: NDArray[np.bool_],
    turned: bool,
    corner: tuple[bool, bool],
    swath: int = 1,
) -> NDArray[np.int64]:
    """The flyable cells to enter in order, flat, int [n], so that all that is `wanted`, bool [rows, cols], is seen.

    `turned`: along columns instead of rows; `corner`: one of CORNERS; `swath`: rows seen from one lane.
    """
    runs = lane_runs(wanted.T, flyable.T, swath) if turned else lane_runs(wanted, flyable, swath)
    if not len(runs):
        return np.zeros(0, dtype=np.int64)
    if turned:
        cols, rows = in_order(runs, corner[1], corner[0])
    else:
        rows, cols = in_order(runs, *corner)
    flat: NDArray[np.int64] = rows * wanted.shape[1] + cols
    return flat


def lane_runs(wanted: NDArray[np.bool_], flyable: NDArray[np.bool_], swath: int) -> NDArray[np.int64]:
    """The runs along rows, a swath apart: lane, first and last cell, int [runs, 3], by lane and then by cell."""
    rows, cols = wanted.shape
    along = np.zeros((rows, cols + 2), dtype=np.int8)
    along[:, 1:-1] = lanes_over(wanted, flyable, swath)
    edges = np.argwhere(np.diff(along, axis=1))  # where a run begins, and behind its end, in turn
    return np.stack([edges[::2, 0], edges[::2, 1], edges[1::2, 1] - 1], axis=1).astype(np.int64)


def lanes_over(wanted: NDArray[np.bool_], flyable: NDArray[np.bool_], swath: int) -> NDArray[np.bool_]:
    """Where lanes along rows lead, bool [rows, cols]: through the middle of each swath, beside what is not flyable
    there as near to it as can be, and once more where something wanted would not be seen."""
    if swath == 1:
        return wanted & flyable
    rows, half = wanted.shape[0], (swath - 1) // 2
    beyond = swath - 1 - half  # a lane sees so many rows below it, and `half` above
    flown = np.zeros_like(wanted)
    for top in range(0, rows, swath):
        left, middle = wanted[top : top + swath].any(axis=0), min(top + half, rows - 1)
        for row in sorted(range(top, min(top + swath, rows)), key=lambda row: abs(row - middle)):
            flown[row] = left & flyable[row]
            left = left & ~flown[row]
    seen = np.zeros_like(wanted)
    for row in range(rows):
        seen[row] = flown[max(0, row - beyond) : row + half + 1].any(axis=0)
    for row, col in np.argwhere(wanted & ~seen).tolist():
        near = [each for each in range(max(0, row - beyond), min(rows, row + half + 1)) if flyable[each, col]]
        if near:
            flown[min(near, key=lambda each: abs(each - row)), col] = True
    return flown


def in_order(
    runs: NDArray[np.int64], bottom: bool, right: bool
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The cells of `runs` as flown from a corner: lane and place along it, int [n] each."""
    lanes, begins = np.unique(runs[:, 0], return_index=True)
    bounds = np.append(begins, len(runs)).astype(np.int64)
    order = np.zeros(len(runs), dtype=np.int64)
    backwards, flown = (np.zeros(len(runs), dtype=np.bool_) for _ in range(2))
    chain_runs(np.ascontiguousarray(runs), lanes, bounds, bottom, right, order, backwards, flown)
    along = [
        np.arange(end, begin - 1, -1) if turned else np.arange(begin, end + 1)
        for (_, begin, end), turned in zip(runs[order].tolist(), backwards.tolist(), strict=True)
    ]
    which = np.repeat(runs[order, 0], [cells.size for cells in along])
    return which, np.concatenate(along)


@kernel
def chain_runs(
    runs: NDArray[np.int64],
    lanes: NDArray[np.int64],
    bounds: NDArray[np.int64],
    bottom: bool,
    right: bool,
    order: NDArray[np.int64],
    backwards: NDArray[np.bool_],
    flown: NDArray[np.bool_],
) -> None:
    """Fill `order` and `backwards` [runs]: each time the unflown run with the nearest end, onward among equals.

    The runs of the lane numbered l, lanes[l], are those from bounds[l] to bounds[l + 1]; `flown` [runs] begins False.
    """
    lane = lanes.size - 1 if bottom else 0
    run = bounds[lane + 1] - 1 if right else bounds[lane]
    turned = right
    onward = -1 if bottom else 1
    for k in range(runs.shape[0]):
        order[k], backwards[k], flown[run] = run, turned, True
        at, here = runs[run, 0], runs[run, 1] if turned else runs[run, 2]
        best = np.inf
        for away in range(lanes.size):
            nearest = np.inf
            for side in range(2 if away > 0 else 1):
                number = lane + away * (onward if side == 0 else -onward)
                if number < 0 or number >= lanes.size:
                    continue
                apart = abs(lanes[number] - at)
                nearest = min(nearest, apart)
                if apart >= best:
                    continue
                for other in range(bounds[number], bounds[number + 1]):
                    if flown[other]:
                        continue
                    for end in range(2):
                        off = abs(runs[other, 1 + end] - here)
                        far = max(apart, off) + 0.4 * min(apart, off)
                        if far < best - 1e-9:
                            best, run, turned = far, other, end == 1
            if nearest >= best:
                break
        lane = np.searchsorted(lanes, runs[run, 0])
