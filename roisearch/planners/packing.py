"""What several planners pack alike for their kernels; the fields are in `roisearch.kernels.groups`."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from roisearch.fov import FieldOfView
from roisearch.planners.base import Scene

STACK = 144
"""Room for a way down a tree of the forest: at most 15 siblings a level, 16 ** 9 cells."""


def forest_of(scene: Scene, roots: NDArray[np.int64]) -> dict[str, Any]:
    """The regions as trees; `roots` are those that are searched, -1 for one that is left out."""
    f = scene.forest
    return {"cell_of": f.cell_of, "first": f.first, "last": f.last, "box": f.box, "roots": roots}


def land_of(scene: Scene) -> dict[str, Any]:
    """Where the drone can go."""
    return {"legal": scene.part.legal, "cols": scene.ground.shape[1]}


def sight_of(fov: FieldOfView, detection: bool) -> dict[str, Any]:
    """What it sees; a cell's gain is its chance of `detection`, p_tp, or 1."""
    gains = fov.p_tp if detection else np.ones(len(fov.p_tp))
    return {"offsets": fov.offsets, "gains": gains, "is_point": fov.is_point}


def fading_of(fov: FieldOfView, cells: int, fades: bool, looks: int) -> dict[str, Any]:
    """Room for what fades in thought on a map of so many cells, in at most so many looks."""
    return {
        "miss": 1.0 - fov.p_tp,
        "fade": np.ones(cells if fades else 1),
        "fades": fades,
        "log": np.zeros(looks * len(fov.p_tp), dtype=np.int64),
    }


def ranging_of(scene: Scene, fov: FieldOfView, alpha: float) -> dict[str, Any]:
    """What distance leaves of a weight, steps ** (-1 / alpha), and room for distances around obstacles."""
    rows, cols = scene.ground.shape
    around = 0 if scene.ground.is_open else rows * cols
    worth = np.ones(farthest(scene))
    worth[1:] = np.arange(1, worth.size, dtype=np.float64) ** (-1.0 / alpha)
    return {
        "worth": worth,
        "reach": fov.reach,
        "forward": np.zeros(around, dtype=np.int32),
        "queue": np.zeros(around, dtype=np.int64),
        "stack": np.zeros(STACK, dtype=np.int64),
    }


def farthest(scene: Scene) -> int:
    """More steps than any way on this ground has."""
    rows, cols = scene.ground.shape
    return 8 + (rows + cols if scene.ground.is_open else rows * cols)
