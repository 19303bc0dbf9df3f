"""Which cells a camera that looks ahead sees over ground with heights, and which lie behind a ridge for it.

The evidence asks of every frame what its lines of sight met (`service.camera.terrain`). Here it is asked beforehand,
for the plan and for what is foreseen: of the eight directions in which a cell may be flown to, in how many the middle
of the image would show it.
"""

from __future__ import annotations

import math

import numpy as np

from roisearch.directions import STEPS
from service.area import Grid
from service.config import Settings
from service.ground.flown import heights_over
from service.ground.relief import Floats, Relief

_STRAIGHT_DOWN_DEG = -85.0  # nothing stands between a camera and what is below it
_TOLERANCE_M = 0.5  # ground this little above a line of sight hides nothing: rounding of the posts


def seen_share(grid: Grid, settings: Settings) -> Floats | None:
    """In how many of eight directions each cell is seen, as a share: float [rows, cols], 0 to 1.

    None where that is all of them everywhere: without heights of the ground, without a camera of the settings, or with
    one that looks down.
    """
    relief, sensor = grid.relief, settings.sensor
    if relief is None or sensor.profile != "camera" or sensor.camera_pitch_deg < _STRAIGHT_DOWN_DEG:
        return None
    rows, cols = np.indices(grid.frame.shape)
    middles = (np.column_stack([cols.ravel(), rows.ravel()]).astype(np.float64) + 0.5) * grid.frame.cell_m
    away = settings.flight.altitude_m / math.tan(math.radians(-sensor.camera_pitch_deg))
    seen = np.zeros(len(middles))
    for down, right in STEPS:
        behind = away / math.hypot(down, right) * np.array([right, down], dtype=np.float64)
        eyes = middles - behind
        seen += _in_sight(relief, eyes, heights_over(relief, eyes, settings.flight), middles)
    share = seen.reshape(grid.frame.shape) / len(STEPS)
    return None if (share >= 1.0).all() else share


def _in_sight(relief: Relief, eyes: Floats, up: Floats, middles: Floats) -> Floats:
    """Whether the ground stays below the lines from `eyes` [k, 2], `up` [k] metres high, to `middles` [k, 2]: 1 or 0.

    What is not known hides nothing.
    """
    to = relief.height_at(middles)
    clear = np.ones(len(eyes), dtype=np.bool_)
    pieces = max(2, math.ceil(float(np.hypot(*(middles - eyes).T).max()) / (0.5 * relief.step_m)))
    for share in np.arange(1, pieces) / pieces:
        line = up + share * (to - up)
        above = relief.height_at(eyes + share * (middles - eyes)) - line
        clear &= ~(np.isfinite(above) & (above > _TOLERANCE_M))
    return clear.astype(np.float64)
