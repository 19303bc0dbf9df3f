"""Whether decisions keep to their deadline: the default planner in seconds, with the service's settings, on a small map
and on the largest.

A search is flown in which nothing is found. The planner is handed a copy of the belief each time, as by the service,
and no time to think beyond its deadline; the first plan, which the service makes before the take-off, is not counted.
Times are of the thread's processor, so that another program on the machine is not taken for the planner.
"""

from __future__ import annotations

import time

import numpy as np

from roisearch import Belief, FieldOfView, Motion, SearchState, make_planner, segment_regions
from roisearch.directions import direction_between
from service.config import Settings
from sim.scenario import scattered_hills

PROMPT = 0.999
"""The part of all decisions that must not take longer than the deadline."""


def slowest_ms(side: int, decisions: int) -> float:
    """What 999 of 1000 decisions took at most, milliseconds, of so many on a map of so many cells a side."""
    search = Settings().search
    planner = make_planner(
        search.planner,
        fov=FieldOfView.point(),
        motion=Motion(cell_m=25.0),
        regions=segment_regions(np.ones((2, 2))),
        iterations=search.iterations,
        looks=search.looks_ahead,
    )
    belief, rng, state = Belief(scattered_hills(side)), np.random.default_rng(1), SearchState((5, 5))
    planner.plan(belief, state, rng)
    took = []
    for _ in range(decisions):
        thought = belief.copy()
        began = time.thread_time()
        cell = planner.plan(thought, state, rng, deadline_s=search.deadline_s).path[0]
        took.append(time.thread_time() - began)
        state = SearchState(cell, direction_between(state.cell, cell))
        belief.observe([cell], False, 0.9, 0.9)
    return 1e3 * float(np.quantile(took, PROMPT, method="higher"))
