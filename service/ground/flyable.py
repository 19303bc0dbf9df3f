"""Which cells can be flown over ground with heights: clear of it, and not higher above it than is allowed."""

from __future__ import annotations

import math

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy import ndimage

from service.area import Grid
from service.area.frame import GridFrame
from service.config import SPARE_M, Settings, each_aircraft
from service.ground.reading import check_covered, read_relief
from service.ground.relief import Floats, Relief

_MOST_REACH_M = 5000.0
_AT_ONCE = 1_000_000


def over_ground(grid: Grid, settings: Settings) -> Grid:
    """The grid over the ground of the settings' files. Raises BadInput."""
    flight, files = settings.flight, settings.ground_files
    reach = flight.margin_m + min(flight.max_home_distance_m, _MOST_REACH_M)
    every = each_aircraft(settings).values()
    reach = max(
        reach, *(each.sensor.max_range_m if each.sensor.profile == "camera" else 0.0 for each in every)
    )
    relief = read_relief(
        files,
        grid.frame,
        grid.launch,
        reach_m=reach,
        near_m=settings.ground.position_error_m + flight.corner_m,
    )
    home = shapely.Point(grid.frame.to_metres([grid.launch])[0])
    check_covered(relief, shapely.convex_hull(shapely.union_all([grid.outline, home])), files)
    low, high = max(each.flight.clearance_m for each in every), flight.max_height_m  # of the highest layer
    clear = can_be_flown(relief, grid.frame, low, high)
    why = f"the ground is too steep there to be {low:g} m clear of it and at most {high:g} m above it"
    return grid.over(relief, clear, why)


def can_be_flown(
    relief: Relief, frame: GridFrame, clearance_m: float, max_height_m: float
) -> NDArray[np.bool_]:
    """Cells [rows, cols] from which every neighbour can be flown to at one height: that is clear of the highest ground
    in all of them by the clearance, and above the lowest in the cell by no more than the most."""
    roof, floor = _by_cell(relief, frame)
    highest = ndimage.maximum_filter(roof, size=3, mode="nearest")
    return np.asarray(highest + clearance_m + SPARE_M <= floor + max_height_m, dtype=np.bool_)


def _by_cell(relief: Relief, frame: GridFrame) -> tuple[Floats, Floats]:
    """The highest ground within reach of each cell, and the lowest in it; where that is not known, infinite and NaN."""
    n = math.ceil(frame.cell_m / relief.step_m) + 1
    at = (np.arange(n) + 0.5) / n * frame.cell_m
    roof, floor = np.empty(frame.shape), np.empty(frame.shape)
    east = (np.arange(frame.cols)[:, None] * frame.cell_m + at).ravel()
    rows_at_once = max(1, _AT_ONCE // (len(east) * n))
    for first in range(0, frame.rows, rows_at_once):
        rows = np.arange(first, min(first + rows_at_once, frame.rows))
        south = (rows[:, None] * frame.cell_m + at).ravel()
        points = np.stack(np.meshgrid(east, south), axis=-1).reshape(-1, 2)
        squares = (len(rows), n, frame.cols, n)
        roof[rows] = relief.roof_at(points).reshape(squares).max(axis=(1, 3))
        floor[rows] = relief.height_at(points).reshape(squares).min(axis=(1, 3))
    return roof, floor
