"""The looks that other searchers are going to make, as a simulation meets them on its way.

A simulation of one searcher's plan takes the others' plans as flown: with every step that it makes, it makes those of
their looks whose time has come. So what it adds up is the area under the survival curve of all searchers together,
given what the others will do. A cell that another one reaches sooner is worth little by then; one that it reaches much
later may be taken from it, and it will plan without it when its turn comes.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from roisearch.kernels.records import Floats, Ints

MOST = 1 << 16
"""Looks of others that are reckoned with; later ones are not."""
COUNT, NEXT, CLOCK, SIZE = 0, 1, 2, 3


class Others(NamedTuple):
    """The looks to come, the soonest first.

    when: float [MOST], in steps from now, above 0. cell: int [MOST], row by row. p_tp: float [MOST]. counters: int
    [4]: how many looks there are, the next one and the step in this simulation, and how many searchers there are.
    """

    when: Floats
    cell: Ints
    p_tp: Floats
    counters: Ints


def nobody() -> Others:
    """No other searcher yet, and room for their looks: memory is taken only when it is used."""
    counters = np.array([0, 0, 0, 1], dtype=np.int64)
    return Others(np.zeros(MOST), np.zeros(MOST, dtype=np.int64), np.zeros(MOST), counters)


class OthersLooks(NamedTuple):
    """Looks of others that are still to be made, in any order.

    when: float [k], in steps of the searcher that reckons with them, from now. cells: int [k, 2]. p_tp: float [k].
    """

    when: NDArray[np.float64]
    cells: NDArray[np.int64]
    p_tp: NDArray[np.float64]


def fill(others: Others, looks: OthersLooks, searchers: int, cols: int) -> None:
    """Put `looks` in the place of those that there were; `searchers` there are, this one included."""
    soonest = np.argsort(looks.when, kind="stable")
    soonest = soonest[looks.when[soonest] > 0.0][: others.when.size]
    count = soonest.size
    others.when[:count] = looks.when[soonest]
    others.cell[:count] = looks.cells[soonest, 0] * cols + looks.cells[soonest, 1]
    others.p_tp[:count] = looks.p_tp[soonest]
    others.counters[:] = (count, 0, 0, searchers)
