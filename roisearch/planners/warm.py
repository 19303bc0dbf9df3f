"""Compile before it matters: some looks and decisions on a small map, telling how far it is."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from roisearch.belief import Belief
from roisearch.decision import SearchState
from roisearch.fov import FieldOfView
from roisearch.planners.base import Planner, Progress


def warm_up(
    make: Callable[[NDArray[np.bool_]], Planner], fov: FieldOfView, progress: Progress | None
) -> None:
    """Compile what a belief and a planner need, with and without obstacles.

    Args:
        make: makes a planner like the one to warm up, for a map of which this much is flyable.
        progress: called at the beginning of each step and at the end.
    """

    def say(step: str, number: int) -> None:
        if progress is not None:
            progress(step, number, 4)

    say("belief", 1)
    side = 7 + 2 * fov.reach
    away = (np.arange(side)[:, None] - 3.0) ** 2 + (np.arange(side)[None, :] - 3.0) ** 2
    belief = Belief(np.exp(-away / 4.0) + 1e-3, outside=0.1)
    belief.observe([(0, 0)], False, 0.9, 0.9)
    say("search", 2)
    flyable = np.ones((side, side), dtype=bool)
    _decide(make(flyable), belief)
    say("search around obstacles", 3)
    flyable[side // 2, side // 2] = False
    _decide(make(flyable), belief)
    say("ready", 4)


def _decide(planner: Planner, belief: Belief) -> None:
    """Two decisions with a hit between them."""
    rng = np.random.default_rng(0)
    decision = planner.plan(belief, SearchState((0, 0)), rng, deadline_s=1.0)
    belief.observe([decision.path[0]], True, 0.9, 0.9)
    planner.plan(belief, SearchState(decision.path[0], "east"), rng, deadline_s=1.0)
