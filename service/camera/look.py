"""Which cells a frame shows, how much of each, and what a look at them is worth.

Each cell is sampled at a square of points. A point is in view when it projects into the image, is near enough and
not too flat to see, and no terrain hides it; so the horizon needs no case of its own, and what is above it or too
far is cut. The covered part is then right to half a sample's width along an edge: with 6 x 6 samples each edge
that runs along a cell's side is off by at most 1/12 of the cell.

A target may be anywhere in its cell, so a cell's p_tp is the mean over its points, those out of view counting as 0.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from service.area.frame import GridFrame
from service.camera.detect import Detectability
from service.camera.ground import Ground
from service.camera.optics import Floats, Sight

SAMPLES = 6
_UNIT = (
    np.stack(np.meshgrid(np.arange(SAMPLES), np.arange(SAMPLES)), axis=-1).reshape(-1, 2) + 0.5
) / SAMPLES


@dataclass(frozen=True, eq=False)
class Looks:
    """The cells int [k, 2] that are in view at all, the covered part of each, float [k], and its p_tp, float [k]."""

    cells: NDArray[np.int64]
    covered: Floats
    p_tp: Floats


def look_at_cells(
    sight: Sight,
    ground: Ground,
    frame: GridFrame,
    detect: Detectability,
    *,
    max_range_m: float,
    min_grazing_deg: float,
    bounded: bool = True,
) -> Looks:
    """The cells of the grid (of the endless plane unless `bounded`) that `sight` shows."""
    nothing = Looks(np.empty((0, 2), dtype=np.int64), np.empty(0), np.empty(0))
    if sight.position[2] <= float(ground.height_at(sight.position[None, :2])[0]):
        return nothing
    sin_least = math.sin(math.radians(min_grazing_deg))
    above = float(sight.position[2]) - ground.lowest_m
    reach = min(max_range_m, above / max(sin_least, 1e-9))  # what is farther is seen too flat
    cells = _candidates(sight, ground, frame, reach, bounded)
    if not len(cells):
        return nothing
    flat = ((cells[:, None, ::-1] + _UNIT[None]) * frame.cell_m).reshape(-1, 2)
    points = np.column_stack([flat, ground.height_at(flat)])
    gap = points - sight.position
    far = np.linalg.norm(gap, axis=1)
    sin_grazing = -gap[:, 2] / np.maximum(far, 1e-9)
    seen = sight.in_image(points) & (far <= max_range_m)
    seen &= sin_grazing >= sin_least
    at = np.flatnonzero(seen)
    at = at[ground.in_sight(sight.position, points[at])]
    chance = np.zeros(len(points))
    chance[at] = detect.chance(detect.pixels(sight.camera.focal_px, far[at], sin_grazing[at]))
    by_cell = chance.reshape(len(cells), -1)
    covered, p_tp = (by_cell > 0.0).mean(axis=1), by_cell.mean(axis=1)
    shown = covered > 0.0
    return Looks(cells[shown], covered[shown], p_tp[shown])


def _candidates(
    sight: Sight, ground: Ground, frame: GridFrame, max_range_m: float, bounded: bool
) -> NDArray[np.int64]:
    """The cells of a box around all that can be in view, int [k, 2]."""
    rays = sight.rays(sight.camera.border())
    height = float(sight.position[2]) - ground.lowest_m
    down = np.maximum(-rays[:, 2], 1e-9)
    far = np.where(rays[:, 2] < 0.0, np.minimum(height / down, max_range_m), max_range_m)
    ends = sight.position[:2] + far[:, None] * rays[:, :2]
    middle = sight.rays([[sight.camera.cx, sight.camera.cy]])[0]
    corners = np.vstack([ends, sight.position[:2]]) if _sees_below(sight, middle, ground) else ends
    low = np.floor(corners.min(axis=0) / frame.cell_m).astype(np.int64) - 1
    high = np.floor(corners.max(axis=0) / frame.cell_m).astype(np.int64) + 1
    if bounded:
        low, high = np.maximum(low, 0), np.minimum(high, np.array([frame.cols - 1, frame.rows - 1]))
    if (low > high).any():
        return np.empty((0, 2), dtype=np.int64)
    rows, cols = np.mgrid[low[1] : high[1] + 1, low[0] : high[0] + 1]
    return np.stack([rows.ravel(), cols.ravel()], axis=1)


def _sees_below(sight: Sight, middle: Floats, ground: Ground) -> bool:
    """Whether the box has to reach back to the camera: it looks down at itself, or hills may be nearer."""
    return bool(middle[2] < -0.5 or float(ground.height_at(sight.position[None, :2])[0]) != ground.lowest_m)
