"""Random small worlds for hypothesis: priors, obstacles, sensors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from hypothesis import strategies as st
from numpy.typing import NDArray

from roisearch import FieldOfView

SENSORS = (FieldOfView.point(), FieldOfView.donut(), FieldOfView.wide_angle())


@dataclass(frozen=True)
class World:
    """A map with hills, where one can fly, where one starts, and what one sees."""

    prior: NDArray[np.float64]
    flyable: NDArray[np.bool_]
    start: tuple[int, int]
    fov: FieldOfView


@st.composite
def worlds(draw: st.DrawFn, obstacles: bool = True, sensors: tuple[FieldOfView, ...] = SENSORS) -> World:
    """A world of 3 x 3 to 14 x 14 cells whose start has a flyable neighbour."""
    rows, cols = draw(st.integers(3, 14)), draw(st.integers(3, 14))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    down, right = np.mgrid[0:rows, 0:cols]
    prior = np.full((rows, cols), 1e-3)
    for _ in range(draw(st.integers(0, 3))):
        row, col, width = rng.uniform(0, rows), rng.uniform(0, cols), rng.uniform(0.7, 3.0)
        prior += np.exp(-((down - row) ** 2 + (right - col) ** 2) / (2 * width**2))
    flyable = np.ones((rows, cols), dtype=bool)
    if obstacles and draw(st.booleans()):
        flyable = rng.random((rows, cols)) > 0.3
    start = (int(rng.integers(rows)), int(rng.integers(cols)))
    flyable[start] = True
    beside = (start[0], start[1] + 1) if start[1] + 1 < cols else (start[0], start[1] - 1)
    flyable[beside] = True
    return World(prior / prior.sum(), flyable, start, draw(st.sampled_from(sensors)))
