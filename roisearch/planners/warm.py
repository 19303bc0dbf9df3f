"""Compile before it matters: one look and one decision on tiny maps, telling how far it is."""

from __future__ import annotations

import numpy as np

from roisearch.belief import Belief
from roisearch.decision import SearchState
from roisearch.fov import FieldOfView
from roisearch.planners.base import Planner, Progress


def warm_up(planner: Planner, fov: FieldOfView, progress: Progress | None) -> None:
    """Compile what a belief and a fresh `planner` need; `progress` is told each step and the end."""

    def say(step: str, number: int) -> None:
        if progress is not None:
            progress(step, number, 3)

    say("belief", 1)
    rows = cols = 5 + 2 * fov.reach
    hill = np.exp(-((np.arange(rows)[:, None] - 3.0) ** 2 + (np.arange(cols)[None, :] - 3.0) ** 2) / 4.0)
    belief = Belief(hill, outside=0.1)
    belief.observe([[0, 0]], False, 0.9, 0.9)
    say(f"planner {planner.name}", 2)
    rng = np.random.default_rng(0)
    decision = planner.plan(belief, SearchState((0, 0)), rng)
    belief.observe([decision.path[0]], True, 0.9, 0.9)
    planner.plan(belief, SearchState(decision.path[0], "east"), rng)
    say("ready", 3)
