"""A tour that is no later than a lawnmower at any level of POS.

The tour that costs the fewest expected seconds may leave crumbs for the end: where the prior is flat it finds half of
the mass sooner than a lawnmower, and nine tenths later. Who waits for nine tenths has then flown worse than a survey.
So where the annealed tour is later than the best lawnmower at one of `LEVELS`, lawnmowers are annealed gently, which
betters their ends and keeps their lanes; the cheapest that is late nowhere is flown, unless it costs too much more. On
a prior with hills the annealed tour is sooner at every level, and nothing is changed.
"""

from __future__ import annotations

import time

import numpy as np
from numpy.typing import NDArray

from roisearch.kernels.records import Floats, Ints
from roisearch.planners.tour.desk import Desk

LEVELS = (0.5, 0.75, 0.9)
"""Shares of the mass; at each the tour is to be no later."""
LATER = 1.02
"""So many times what the lawnmower takes to a level is not later."""
PAID = 1.03
"""What not being late may cost: so many times the fewest expected seconds."""
GENTLE = (0.01, 0.003, 0.001)
"""Temperatures, in seconds of a step, at which a lawnmower betters its ends and keeps its lanes."""
LAWNMOWERS = 2
"""The best so many are annealed, with every temperature."""
PROPOSALS = 500
"""Changes proposed a look, for each."""


def times_to(desk: Desk) -> Floats:
    """Seconds until the settled tour has found each of `LEVELS` of the mass, float [levels]; inf where it never has."""
    tour, size = desk.tour, desk.size
    wanted = np.array(LEVELS) * (float(tour.mass[size]) + float(desk.prices.rest[0]))
    at = np.searchsorted(tour.mass[1 : size + 1], wanted * (1.0 - 1e-9))
    reached: Floats = np.append(tour.time[1 : size + 1], np.inf)[at]
    return reached


def keep_up(
    desk: Desk,
    lawnmowers: list[Ints],
    step_heat: float,
    random: NDArray[np.uint64],
    until: float,
    proposal_s: float = 0.0,
) -> bool:
    """Put an annealed lawnmower in the place of a tour that is late; whether it was done.

    Args:
        desk: with the settled tour. lawnmowers: orders of its nodes, the best first, one or more.
        step_heat: the temperature of one second of a step. random: uint64 [1], the state of the draws.
        until: when to have ended, by `time.perf_counter`; what would not be over by then is not begun.
        proposal_s: seconds that a proposed change takes, as far as is known.
    """
    best, chosen, reached = desk.cost, desk.order(), times_to(desk)
    desk.put(lawnmowers[0])
    soon = LATER * times_to(desk)
    kept, takes_s = chosen, PROPOSALS * desk.size * proposal_s
    if not (reached <= soon).all():
        found: list[tuple[float, int, Ints]] = []
        for order in lawnmowers[:LAWNMOWERS]:
            for gentle in GENTLE:
                if time.perf_counter() + takes_s >= until:
                    break
                desk.put(order)
                heat = gentle * step_heat
                desk.anneal(1, desk.size, PROPOSALS * desk.size, (heat, 0.03 * heat), random)
                if (times_to(desk) <= soon).all() and desk.cost <= PAID * best:
                    found.append((desk.cost, len(found), desk.order()))
        if found:
            kept = min(found, key=lambda each: each[:2])[2]
    desk.put(kept)
    return kept is not chosen
