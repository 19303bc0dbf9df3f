"""The release bound in seconds of flight: a straight line at full speed, and so many seconds from cell to cell.

Setting. As in `roisearch.bounds.counting`, but time is what a `Motion` says. A cell is looked at when it is *reached*:
at its middle, or at the middle of the arc that cuts its corner. F(s) is the probability that the target is detected
within s seconds; the search ends with the first true hit.

Let v be the highest ground speed in any direction. A corner begins z metres before the cell's middle and has an arc
of a metres; the rounded way is shorter by 2 z - a than the one through the middle. Two facts hold for every path:

1. *At least tau seconds lie between two cells that are reached one after the other.* Their middles are at least
   cell_m apart, each end may be shortened by the greatest z - a / 2, and no part is flown faster than v:
   tau = (cell_m - 2 max(z - a / 2)) / v.
2. *Cell c is not reached before r_c seconds.* What is reached may be the middle of an arc, and so may be where the
   flight begins; both lie at most o metres from the middles of their cells, and a straight line between them is the
   shortest way: r_c = max(tau, (distance - 2 o) / v). The arc of a corner touches both legs z from the cell's
   middle, so its own middle lies z (1 / cos b - tan b) from it, with b half of the angle between the legs. Where
   only four neighbours are flown to, c is so many moves away as rows and columns together, and none of them takes
   less than tau by 1: r_c is at least moves tau as well. (Not the length of the moves less 2 o: a staircase is cut
   at every step of it.)

So put the looks into slots j = 1, 2, ... at the times j tau, a look at s into slot floor(s / tau): by 1 no two looks
share a slot and the first has one, and by 2 no look at c comes before slot floor(r_c / tau). That is a legal order
for the greedy heap of the release bound with those releases. The heap maximises what is found after every slot,
hence F(s) of any path is at most what the heap has found after slot floor(s / tau), for every s.

It holds for a point field of view, and for every p_tn. A start with speed changes nothing: v bounds it as well.
"""

from __future__ import annotations

import math

import numpy as np

from roisearch.bounds.counting import check, checked_mass
from roisearch.bounds.kernels import greedy_looks
from roisearch.kernels.records import Floats
from roisearch.motion import TURNS, Motion


def release_seconds(
    prior: Floats, start: tuple[int, int], p_tp: float, motion: Motion, seconds: float
) -> tuple[Floats, Floats]:
    """The best detection curve over time that any path of this motion can have.

    Args:
        prior: float [rows, cols], the mass of each cell; it may sum to less than 1.
        start: (row, col) of the cell where the aircraft is. p_tp: of a look at the target's cell.
        motion: how fast it is. seconds: for how long.

    Returns:
        times, float [n + 1], in seconds from 0; F, float [n + 1], what is found at most from each time to the next.

    Raises:
        ValueError: for a start off the map, seconds below 0, or a mass or p_tp that is no probability.
    """
    mass = checked_mass(prior)
    check(p_tp, 0, 1)
    rows, cols = prior.shape
    if not (0 <= start[0] < rows and 0 <= start[1] < cols):
        raise ValueError(f"the start {start} is not on the map of {rows} x {cols} cells")
    if not 0.0 <= seconds < math.inf:
        raise ValueError(f"seconds must be 0 or more and finite, not {seconds}")
    apart, off = least_between_looks(motion)
    row, col = np.indices(prior.shape)
    down, right = np.abs(row - start[0]), np.abs(col - start[1])
    line_s = (motion.cell_m * np.hypot(down, right) - 2.0 * off) / float(motion.pace.cruise.max())
    moves = np.maximum(down, right) if motion.diagonal else down + right
    reached = np.maximum(line_s, apart * np.maximum(moves, 1))
    slots = math.floor(seconds / apart + 1e-9)
    released = np.floor(reached / apart + 1e-9).astype(np.int64).ravel()
    found = greedy_looks(mass, released, np.ones(slots, dtype=np.int64), float(p_tp))
    times: Floats = apart * np.arange(slots + 1, dtype=np.float64)
    return times, found


def least_between_looks(motion: Motion) -> tuple[float, float]:
    """tau of the text above, in seconds, and o, in metres."""
    pace = motion.pace
    cut = float(np.max(pace.zone - 0.5 * pace.arc))
    off = 0.0
    for turn, degrees in enumerate(TURNS, start=1):
        half = math.radians(180 - degrees) / 2.0
        if pace.zone[turn] > 0.0:
            off = max(off, float(pace.zone[turn]) * (1.0 / math.cos(half) - math.tan(half)))
    return (pace.straight_m - 2.0 * cut) / float(pace.cruise.max()), off


def expected_seconds(times: Floats, found: Floats, cap_s: float) -> float:
    """Mean of min(T, cap_s): the integral of 1 - F from 0 to `cap_s`, F constant from each time to the next.

    times, found: float [n], as `release_seconds` gives them. Raises ValueError when they begin after 0.
    """
    if len(times) == 0 or times[0] != 0.0:
        raise ValueError("the curve must begin at 0 seconds")
    ends = np.append(times[1:], cap_s)
    return float(((1.0 - found) * np.clip(ends, 0.0, cap_s) - (1.0 - found) * np.minimum(times, cap_s)).sum())
