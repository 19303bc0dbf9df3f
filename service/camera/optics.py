"""A pinhole camera and where it looks.

Angles are those of `service.evidence.reports`, in MAVLink's order: yaw clockwise from above, then pitch up, then roll
to the right; a pitch of -90 looks straight down with the top of the image to the nose. Pixels count from the top
left corner of the image, x to the right and y down.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Pinhole:
    """How directions become pixels: image size, focal lengths and principal point, all in pixels."""

    width: float
    height: float
    fx: float
    fy: float
    cx: float
    cy: float

    @classmethod
    def of_angles(
        cls, width: float, height: float, horizontal_fov_deg: float, vertical_fov_deg: float | None = None
    ) -> Pinhole:
        """From the angle between the left and the right edge, and between top and bottom (None: square pixels)."""
        fx = 0.5 * width / math.tan(math.radians(0.5 * horizontal_fov_deg))
        fy = fx if vertical_fov_deg is None else 0.5 * height / math.tan(math.radians(0.5 * vertical_fov_deg))
        return cls(width, height, fx, fy, 0.5 * width, 0.5 * height)

    @property
    def focal_px(self) -> float:
        """The focal length of a camera with square pixels of the same area."""
        return math.sqrt(self.fx * self.fy)

    def border(self, per_side: int = 8) -> Floats:
        """Pixels [4 * per_side, 2] around the image's border, from the top left corner clockwise."""
        along = np.arange(per_side) / per_side
        zero, one = np.zeros(per_side), np.ones(per_side)
        sides = [(along, zero), (one, along), (1.0 - along, one), (zero, 1.0 - along)]
        unit = np.concatenate([np.stack(side, axis=1) for side in sides])
        pixels: Floats = unit * np.array([self.width, self.height])
        return pixels


def rotation(yaw_deg: float, pitch_deg: float, roll_deg: float) -> Floats:
    """The turn [3, 3] of a body's axes (forward, right, down) into north, east, down."""
    cy, sy = math.cos(math.radians(yaw_deg)), math.sin(math.radians(yaw_deg))
    cp, sp = math.cos(math.radians(pitch_deg)), math.sin(math.radians(pitch_deg))
    cr, sr = math.cos(math.radians(roll_deg)), math.sin(math.radians(roll_deg))
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


@dataclass(frozen=True, eq=False)
class Sight:
    """A camera at a place: `position` [3] as (east, south, up), `axes` [3, 3] with the rows forward (the line of
    sight), right and down (of the image) in the same axes."""

    camera: Pinhole
    position: Floats
    axes: Floats

    def project(self, points: ArrayLike) -> tuple[Floats, Floats]:
        """Points [k, 3] to pixels [k, 2] and depths along the line of sight [k]; no pixel (NaN) behind the camera."""
        seen = (np.asarray(points, dtype=np.float64).reshape(-1, 3) - self.position) @ self.axes.T
        depth = seen[:, 0]
        ahead = np.where(depth > 1e-9, depth, np.nan)
        x = self.camera.cx + self.camera.fx * seen[:, 1] / ahead
        y = self.camera.cy + self.camera.fy * seen[:, 2] / ahead
        return np.stack([x, y], axis=1), depth

    def in_image(self, points: ArrayLike) -> NDArray[np.bool_]:
        """Which of the points [k, 3] lie ahead of the camera and within its image."""
        pixels, _ = self.project(points)
        with np.errstate(invalid="ignore"):
            inside: NDArray[np.bool_] = (
                (pixels[:, 0] >= 0.0)
                & (pixels[:, 0] <= self.camera.width)
                & (pixels[:, 1] >= 0.0)
                & (pixels[:, 1] <= self.camera.height)
            )
        return inside

    def rays(self, pixels: ArrayLike) -> Floats:
        """Unit directions [k, 3] through pixels [k, 2]."""
        at = np.asarray(pixels, dtype=np.float64).reshape(-1, 2)
        camera = self.camera
        right, down = (at[:, 0] - camera.cx) / camera.fx, (at[:, 1] - camera.cy) / camera.fy
        along = np.stack([np.ones_like(right), right, down], axis=1) @ self.axes
        rays: Floats = along / np.linalg.norm(along, axis=1, keepdims=True)
        return rays


def sight_from(camera: Pinhole, position: ArrayLike, turn: Floats) -> Sight:
    """A camera at (east, south, up) whose axes `turn` (see `rotation`) tells in north, east, down of the grid."""
    north, east, down = turn
    return Sight(camera, np.asarray(position, dtype=np.float64), np.stack([east, -north, -down], axis=1))
