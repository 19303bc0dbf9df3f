"""What it takes until a search on a large map has its first decision; for `roisearch-sim bench`.

One hill as wide as the map, so that everything is worth a look somewhere. Each map is begun in a process of its own,
so that the most memory is that of this map: resident, the libraries among it.
"""

from __future__ import annotations

import multiprocessing
import resource
import time
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from roisearch import Belief, FieldOfView, Motion, SearchState, make_planner, segment_regions

SIDES = (200, 1000, 4000, 10_000)
SMALL = 60


class Begun(NamedTuple):
    """Seconds of the processor for the belief, the regions and the first decision, and the most memory in bytes."""

    belief_s: float
    regions_s: float
    decision_s: float
    most_bytes: float


def wide_hill(side: int) -> NDArray[np.float64]:
    """One hill on a square map, which nothing of the map's size is needed for beside."""
    across = np.exp(-20.0 * np.linspace(-0.5, 0.5, side) ** 2)
    return np.outer(across, across)


def begin(side: int) -> Begun:
    """Begin a search with the default planner, as the service flies it."""
    prior = wide_hill(side)
    times = [time.thread_time()]
    belief = Belief(prior)
    times.append(time.thread_time())
    regions = segment_regions(prior)
    times.append(time.thread_time())
    planner = make_planner(
        "puct-regions-lite", fov=FieldOfView.point(), regions=regions, motion=Motion(cell_m=25.0)
    )
    planner.plan(belief, SearchState((1, 1)), np.random.default_rng(0))
    times.append(time.thread_time())
    most = 1024.0 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    known, segmented, decided = np.diff(times).tolist()
    return Begun(known, segmented, decided, most)


def begun(side: int) -> Begun:
    """The same in a process of its own, all compiled before."""
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        pool.apply(begin, (SMALL,))
        return pool.apply(begin, (side,))


def table(largest: int, sides: Sequence[int] = SIDES) -> str:
    """What each map up to the largest takes, as Markdown."""
    lines = ["| a search begins on | belief, s | regions, s | first decision, s | most memory, GB |"]
    lines.append("|---|---|---|---|---|")
    for side in sides:
        if side <= largest:
            took = begun(side)
            lines.append(
                f"| {side} x {side} cells | {took.belief_s:.2f} | {took.regions_s:.2f} | {took.decision_s:.2f} | "
                f"{took.most_bytes / 1e9:.2f} |"
            )
    return "\n".join(lines)
