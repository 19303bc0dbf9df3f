"""The scenes that planners are tried on."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

PAPER_SHAPE = (200, 200)
PAPER_START = (5, 5)
PAPER_STEPS = 40_000


def paper_prior(
    rng: np.random.Generator, shape: tuple[int, int] = PAPER_SHAPE, *, equal: str = "height"
) -> NDArray[np.float64]:
    """A prior of the paper's experiment (section IV): 1 to 5 Gaussians, summed and normalised.

    Means are uniform over the map; the standard deviation along each axis is uniform in 0.04 to 0.12 on a
    map that spans [-1, 1], that is 4 to 12 cells on 200 x 200.

    Args: equal: what the Gaussians have in common before the sum is normalised: "height", as in the
        authors' code, which adds bells exp(-x**2 / 2) (a wide one then holds more mass); or "mass", each a
        probability density.

    Returns float [rows, cols] summing to 1. Raises ValueError for another `equal`.
    """
    if equal not in ("height", "mass"):
        raise ValueError(f"equal is 'height' or 'mass', not '{equal}'")
    count = int(rng.integers(1, 6))
    means = rng.uniform(0.0, shape, (count, 2))
    stds = rng.uniform(0.04, 0.12, (count, 2)) * np.array(shape) / 2.0
    total = np.zeros(shape)
    for mean, std in zip(means, stds, strict=True):
        bells = [np.exp(-0.5 * ((np.arange(n) - mean[i]) / std[i]) ** 2) for i, n in enumerate(shape)]
        total += np.outer(*bells) / (std.prod() if equal == "mass" else 1.0)
    normalised: NDArray[np.float64] = total / total.sum()
    return normalised
