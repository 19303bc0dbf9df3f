"""Where on the ground a pixel lies, how sure that is, and which cells it may be in.

The uncertainty is of first order: the errors of pixel, attitude, position and height, taken as independent, through
the projection's derivatives. They are differences over one standard deviation, so a ground that bends within it is
told as the straight line through both ends.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import ndtri

from service.camera.ground import Ground
from service.camera.optics import Floats, Sight, rotation
from service.geometry import Cell

_POINTS = 233  # of a Fibonacci lattice, which fills the square evenly in both directions at once
_LATTICE = np.stack([np.arange(_POINTS), np.arange(_POINTS) * 144 % _POINTS], axis=1)
_CLOUD = ndtri((_LATTICE + 0.5) / _POINTS)
_CLOUD /= _CLOUD.std(axis=0)
_LEAST_INSIDE = 0.05  # a detection with less of its probability in the cells looked at lies beside them


@dataclass(frozen=True)
class Errors:
    """Standard deviations: of the camera's direction about each axis, of its place in each direction and of its
    height above the ground."""

    attitude_deg: float
    position_m: float
    height_m: float


@dataclass(frozen=True, eq=False)
class Spot:
    """A place on the ground: (east, south) in metres, and its covariance [2, 2] in square metres."""

    point: Floats
    covariance: Floats


def locate_pixel(
    sight: Sight, pixel: ArrayLike, pixel_sigma: ArrayLike, ground: Ground, errors: Errors, max_range_m: float
) -> Spot | None:
    """Where the ray through `pixel` (x, y) meets the ground; `pixel_sigma` in pixels (x, y).

    None when it does not within `max_range_m`, or when an error of one standard deviation would lift it over the
    horizon or beyond that range: such a pixel says nothing about where its object is.
    """
    x, y = np.asarray(pixel, dtype=np.float64)
    sigma_x, sigma_y = np.asarray(pixel_sigma, dtype=np.float64)
    turn = np.radians(errors.attitude_deg)
    moves: list[tuple[Sight, float, float]] = [(sight, x, y)]
    for sign in (1.0, -1.0):
        moves += [(sight, x + sign * sigma_x, y), (sight, x, y + sign * sigma_y)]
        moves += [(_turned(sight, sign * turn, axis), x, y) for axis in range(3)]
        moves += [(_raised(sight, sign * errors.height_m), x, y)]
    rays = np.concatenate([moved.rays([[px, py]]) for moved, px, py in moves])
    reach = 2.0 * max_range_m
    points = []
    for (moved, _, _), ray in zip(moves, rays, strict=True):
        far = float(ground.meet(moved.position, ray[None], reach)[0])
        if not np.isfinite(far):
            return None
        points.append(moved.position[:2] + far * ray[:2])
    if np.linalg.norm(points[0] - sight.position[:2]) > max_range_m:
        return None
    half = (len(points) - 1) // 2
    columns = 0.5 * (np.array(points[1 : 1 + half]) - np.array(points[1 + half :]))
    covariance = columns.T @ columns + np.eye(2) * errors.position_m**2
    return Spot(points[0], covariance)


def _turned(sight: Sight, angle: float, axis: int) -> Sight:
    """The camera turned by a small angle (radians) about one of its own axes (forward, right, down)."""
    angles = np.zeros(3)
    angles[axis] = np.degrees(angle)
    roll, pitch, yaw = angles
    return Sight(sight.camera, sight.position, rotation(yaw, pitch, roll).T @ sight.axes)


def _raised(sight: Sight, metres: float) -> Sight:
    return Sight(sight.camera, sight.position + np.array([0.0, 0.0, metres]), sight.axes)


def spread(spot: Spot, cell_m: float) -> dict[Cell, float]:
    """The probability of each cell that `spot` may lie in: the share of 233 equally probable points of its Gaussian,
    so each is right to about one in a hundred."""
    values, vectors = np.linalg.eigh(spot.covariance)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    cells = np.floor((spot.point + _CLOUD @ root.T) / cell_m).astype(np.int64)
    found, counts = np.unique(cells[:, ::-1], axis=0, return_counts=True)
    return {(int(r), int(c)): float(n) / len(_CLOUD) for (r, c), n in zip(found, counts, strict=True)}


def spread_hits(
    found: Sequence[tuple[Spot, float | None]],
    cells: NDArray[np.int64],
    p_tp: Floats,
    p_tn: Floats,
    cell_m: float,
) -> tuple[dict[Cell, float], list[int]]:
    """What detections that may each be the hit of several cells say about the cells looked at.

    In each cell in view the detector has a hit or has none, as always (p_tp, p_tn); which cell a detection is the hit
    of is known only with the share s_c (see `shares`). Summing over the cells gives Bayes' rule for cell c exactly:
    its odds are multiplied by s_c * L + (1 - s_c) * (1 - p_tp) / p_tn, the mean of a hit and a miss, with the hit's
    likelihood ratio L = p_tp / (1 - p_tn) unless it has one of its own. Several detections that share no cell are
    exact too; of those that do, one at least is a hit of the cell with 1 - prod(1 - s_c), and L is their mean.

    The exception: the cell that a detection points at is never less likely for it than a hit there would make it. In
    a frame of very many cells a single detection of no known place is fewer than the false alarms to be expected, and
    Bayes' rule would have all of them less likely, that one too; nobody who reports a target is to be heard like that.

    Args:
        found: where each detection is, and its likelihood ratio, None for the cell's.
        cells, p_tp, p_tn: int [k, 2], float [k]: the cells that count as looked at.

    Returns:
        The likelihood ratio of every cell that a detection may be a hit of, and which of `found` lie in these cells.
    """
    none, weight, worth = np.ones(len(cells)), np.zeros(len(cells)), np.zeros(len(cells))
    on_it = []
    for number, (spot, ratio) in enumerate(found):
        share, inside = shares(spread(spot, cell_m), cells, p_tn)
        if inside >= _LEAST_INSIDE or len(_own(spot, cells, cell_m)):
            on_it.append(number)
            none *= 1.0 - share
            weight += share
            worth += share * (p_tp / (1.0 - p_tn) if ratio is None else ratio)
    one = 1.0 - none
    total = one * worth / np.maximum(weight, 1e-300) + (1.0 - one) * (1.0 - p_tp) / p_tn
    for number in on_it:
        spot, ratio = found[number]
        own = _own(spot, cells, cell_m)
        least = p_tp[own] / (1.0 - p_tn[own]) if ratio is None else ratio
        total[own] = np.maximum(total[own], np.minimum(1.0, least))
        weight[own] = np.maximum(weight[own], 1e-300)
    hit = np.flatnonzero(weight > 0.0)
    return {(int(cells[i, 0]), int(cells[i, 1])): float(total[i]) for i in hit}, on_it


def _own(spot: Spot, cells: NDArray[np.int64], cell_m: float) -> NDArray[np.int64]:
    """Which of the cells [k, 2] holds the middle of the spot: int [1], or [0] when none does."""
    return np.flatnonzero((cells == np.floor(spot.point[::-1] / cell_m)).all(axis=1))


def shares(
    chances: dict[Cell, float], cells: NDArray[np.int64], p_tn: NDArray[np.float64]
) -> tuple[NDArray[np.float64], float]:
    """For each of the frame's cells [k, 2] the probability that a detection is a hit of that cell: float [k], and how
    much of the detection lies in them at all.

    Where a detection comes from is weighed by how likely a hit is at all: with Q = (1 - p_tn) / p_tn, the odds of a
    false alarm, the share of cell c is w_c Q_c / sum(w Q).
    """
    w = np.array([chances.get((row, col), 0.0) for row, col in cells.tolist()])
    weighed = w * (1.0 - p_tn) / p_tn
    total = float(weighed.sum())
    return (weighed / total if total > 0.0 else weighed), float(w.sum())
