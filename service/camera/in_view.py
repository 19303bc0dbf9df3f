"""What a frame shows of the ground, for detections: how far beside it a position lies, and what lies behind a box."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import shapely
from numpy.typing import NDArray

from service.area.frame import GridFrame
from service.camera.ground import Ground
from service.camera.optics import Floats, Sight
from service.evidence.plausible import Gap, ground_metres

_ON_THE_PLANE_M = 50_000.0  # farther off the grid's plane is not the ground any more


def beside_image(sight: Sight, frame: GridFrame, ground: Ground, max_range_m: float) -> Gap:
    """How far a position lies from the ground that the image shows: to where the nearest pixel looks, in metres."""

    def gap(point: Floats) -> float:
        there = np.array([[*point, float(ground.height_at(point[None])[0])]])
        pixels, depth = sight.project(there)
        from_camera = float(np.linalg.norm(point - sight.position[:2]))
        if not depth[0] > 0.0:
            return from_camera
        nearest = np.clip(pixels, 0.0, [sight.camera.width, sight.camera.height])
        if (nearest == pixels).all():
            return 0.0
        ray = sight.rays(nearest)
        far = float(ground.meet(sight.position, ray, 2.0 * max_range_m)[0])
        if not math.isfinite(far):
            return from_camera
        return float(np.linalg.norm(sight.position[:2] + far * ray[0, :2] - point))

    return _of_degrees(sight, frame, gap)


def beside_outline(outline: Floats, sight: Sight, frame: GridFrame) -> Gap:
    """How far a position lies beside a polygon [k, 2] on the grid's plane, in metres."""
    polygon = shapely.Polygon(outline)
    return _of_degrees(sight, frame, lambda point: float(polygon.distance(shapely.Point(point))))


def _of_degrees(sight: Sight, frame: GridFrame, gap: Callable[[Floats], float]) -> Gap:
    here = frame.from_metres(sight.position[None, :2])[0]

    def of_degrees(lat: float, lon: float) -> float:
        metres = ground_metres(float(here[0]), float(here[1]), lat, lon)
        return metres if metres > _ON_THE_PLANE_M else gap(frame.to_metres([[lat, lon]])[0])

    return of_degrees


def behind_box(
    sight: Sight,
    points: Floats,
    box: tuple[float, float, float, float],
    margin_px: float,
) -> NDArray[np.bool_]:
    """Which of the ground's points [k, 3] the image shows in a box, or within a margin around it."""
    pixels, _ = sight.project(points)
    x0, y0, x1, y1 = box
    with np.errstate(invalid="ignore"):
        inside: NDArray[np.bool_] = (
            (pixels[:, 0] >= x0 - margin_px)
            & (pixels[:, 0] <= x1 + margin_px)
            & (pixels[:, 1] >= y0 - margin_px)
            & (pixels[:, 1] <= y1 + margin_px)
        )
    return inside
