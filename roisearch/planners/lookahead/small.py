"""On small ground a plan may begin as a tour of looks, annealed as a whole.

Lines that sweep leave single cells behind, and on ground of a few hundred cells that is most of the loss: random maps
of 10 x 10 to 32 x 32 cells were searched in 0.85 to 0.94 of the steps with the tour as a start, maps of 4 x 5 in 1.0001
of the exact optimum for 1.067. It becomes the plan only when it is the better one by the plan's own reckoning, and is
searched and annealed on like any other. On large smooth ground the sweeps are ahead, and the tour would cost seconds.
"""

from __future__ import annotations

import time

import numpy as np
from numpy.typing import NDArray

from roisearch.belief import Belief
from roisearch.decision import SearchState
from roisearch.fov import HEADINGS, FieldOfView
from roisearch.kernels.records import Ints, Pose
from roisearch.motion import Motion
from roisearch.planners.tour.planner import TourPlanner
from roisearch.planners.tour.settings import TourSettings

MOST_CELLS = 1024
"""Of a map, for which it is tried."""
_LOOKS, _SPELLS = 2048, 100


def tour_from(
    pose: Pose,
    mass: NDArray[np.float64],
    fov: FieldOfView,
    flyable: NDArray[np.bool_] | None,
    random: int,
    until: float,
) -> Ints:
    """The cells that a tour of looks enters from here, a step each: int [k], at most 2048, none when there is nothing.

    mass: float [rows, cols], what a certain look at each cell detects. until: of `time.perf_counter`, when to be done.
    """
    if not mass.any():
        return np.zeros(0, dtype=np.int64)
    settings = TourSettings(looks=_LOOKS, first=_SPELLS, iterations=0, path=_LOOKS)
    planner = TourPlanner(settings, fov=fov, motion=Motion.steps(), flyable=flyable)
    state = SearchState((pose.row, pose.col), HEADINGS[pose.heading])
    left = None if np.isinf(until) else until - time.perf_counter()
    decision = planner.plan(Belief(mass), state, np.random.default_rng(random), deadline_s=left)
    return np.array([row * mass.shape[1] + col for row, col in decision.path], dtype=np.int64)
