"""Where the simulated target is: drawn from the prior, with a seed."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def draw_target(probability: NDArray[np.float64], rng: np.random.Generator) -> tuple[float, float] | None:
    """A position as (row, col), in cells with fractions (cell (0, 0) spans 0..1), drawn from `probability`
    (float [rows, cols]); None with what is missing to a sum of 1: then the target is not on the map."""
    edges = np.cumsum(probability.ravel())
    index = int(np.searchsorted(edges, rng.random(), side="right"))
    if index >= edges.size:
        return None
    row, col = divmod(index, probability.shape[1])
    low, high = rng.uniform(0.1, 0.9, size=2)
    return row + float(low), col + float(high)
