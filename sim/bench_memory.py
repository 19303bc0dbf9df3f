"""What a search keeps in memory, in bytes a cell; for `roisearch-sim bench`.

Counted are the allocations that Python and numpy tell `tracemalloc`: the same on every machine, and what is reserved
and never touched included. The map is small, since the bytes of a cell do not depend on how many there are.
"""

from __future__ import annotations

import tracemalloc
from typing import NamedTuple

import numpy as np

from roisearch import Belief, FieldOfView, Motion, SearchState, make_planner

SIDE, SMALL = 600, 60
PLANNERS: dict[str, dict[str, object]] = {
    "puct-regions-lite": {"iterations": 1},
    "puct-regions-lite with a motion": {"iterations": 1, "motion": Motion(cell_m=25.0)},
    "puct-regions": {"iterations": 1},
}


class Memory(NamedTuple):
    """Bytes a cell: of the belief, of the planner beside it after its first plan, and at most until then."""

    belief: float
    planner: float
    peak: float


def hill(side: int) -> np.ndarray:
    """One hill on a square map."""
    down, right = np.mgrid[:side, :side] / side - 0.5
    return np.asarray(np.exp(-20.0 * (down**2 + right**2)))


def begin(name: str, belief: Belief) -> object:
    """A planner that has made its first plan."""
    options = dict(PLANNERS[name])
    planner = make_planner(name.split()[0], fov=FieldOfView.point(), **options)
    planner.plan(belief, SearchState((1, 1)), np.random.default_rng(0))
    return planner


def memory_of(name: str) -> Memory:
    """What a search with one of `PLANNERS` keeps."""
    begin(name, Belief(hill(SMALL)))  # compiled, and loaded, before it counts
    prior, cells = hill(SIDE), SIDE * SIDE
    tracemalloc.start()
    try:
        belief = Belief(prior)
        known = tracemalloc.get_traced_memory()[0]
        tracemalloc.reset_peak()
        planner = begin(name, belief)
        kept, peak = tracemalloc.get_traced_memory()
        del planner
    finally:
        tracemalloc.stop()
    return Memory(known / cells, (kept - known) / cells, peak / cells)


def table() -> str:
    """The bytes of a cell as Markdown."""
    lines = ["| bytes a cell | belief | planner | most, at the start |", "|---|---|---|---|"]
    for name in PLANNERS:
        found = memory_of(name)
        lines.append(f"| {name} | {found.belief:.1f} | {found.planner:.1f} | {found.peak:.1f} |")
    return "\n".join(lines)
