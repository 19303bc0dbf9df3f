"""Where the simulated target is: drawn from the prior, with a seed."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def draw_target(probability: NDArray[np.float64], rng: np.random.Generator) -> tuple[float, float]:
    """A position as (row, col), in cells with fractions (cell (0, 0) spans 0..1), drawn from `probability`
    (float [rows, cols], sum 1); not within a tenth of a cell of its border."""
    cell = int(rng.choice(probability.size, p=probability.ravel()))
    row, col = divmod(cell, probability.shape[1])
    low, high = rng.uniform(0.1, 0.9, size=2)
    return row + float(low), col + float(high)
