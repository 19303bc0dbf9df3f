"""How high the search flies over each place of a ground with heights: what climbs and descents are reckoned by."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from service.area import Grid
from service.config import SPARE_M, FlightSettings
from service.geometry import Metres
from service.ground.leg import profile
from service.ground.relief import Floats, Relief


def heights_over(relief: Relief, points: Floats, flight: FlightSettings) -> Floats:
    """How high above the launch point the search flies over points [k, 2] (east, south): float [k], metres.

    As high above the ground as it is set, and clear of the highest within reach. Not finite where the ground is not
    known.
    """
    wanted = relief.height_at(points) + flight.altitude_m
    return np.maximum(wanted, relief.roof_at(points) + flight.clearance_m + SPARE_M)


def highest_along(relief: Relief, way: Sequence[Metres], flight: FlightSettings) -> float:
    """How high above the launch point one height is at which a way through places (east, south) is flown: that over
    the highest of its legs' ends, and clear of the highest within reach. Infinite where some is not known."""
    highest = -math.inf
    for start, end in pairwise(way):
        seen = profile(relief, start, end)
        below = float(seen.ground[-1])
        over = below + flight.altitude_m if math.isfinite(below) else math.inf
        highest = max(highest, over, seen.highest_m + flight.clearance_m + SPARE_M)
    return highest


def flown_heights(grid: Grid, flight: FlightSettings) -> Floats | None:
    """The same over the middle of each cell, float [rows, cols]; None where the ground is taken as flat.

    Where the ground is not known nothing is flown, and the height is that of the lowest cell.
    """
    if grid.relief is None:
        return None
    rows, cols = np.indices(grid.frame.shape)
    middles = (np.column_stack([cols.ravel(), rows.ravel()]).astype(np.float64) + 0.5) * grid.frame.cell_m
    heights = heights_over(grid.relief, middles, flight)
    known = np.isfinite(heights)
    lowest = float(heights[known].min()) if known.any() else 0.0
    return np.where(known, heights, lowest).reshape(grid.frame.shape)
