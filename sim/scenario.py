"""The scenes that planners are tried on."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

PAPER_SHAPE = (200, 200)
PAPER_START = (5, 5)
PAPER_STEPS = 40_000


def paper_prior(rng: np.random.Generator, shape: tuple[int, int] = PAPER_SHAPE) -> NDArray[np.float64]:
    """A prior of the paper's experiment (section IV): a sum of 1 to 5 Gaussians, normalised.

    Means are uniform over the map; the standard deviation along each axis is uniform in 0.04 to 0.12 on a
    map that spans [-1, 1], that is 4 to 12 cells on 200 x 200. The Gaussians have equal weight. Returns
    float [rows, cols] summing to 1.
    """
    total = np.zeros(shape)
    for _ in range(int(rng.integers(1, 6))):
        profiles = []
        for size in shape:
            mean = rng.uniform(0.0, size)
            std = rng.uniform(0.04, 0.12) * size / 2.0
            profiles.append(np.exp(-0.5 * ((np.arange(size) + 0.5 - mean) / std) ** 2) / std)
        total += np.outer(profiles[0], profiles[1])
    normalised: NDArray[np.float64] = total / total.sum()
    return normalised
