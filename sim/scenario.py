"""The scenes that planners are tried on."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

PAPER_SHAPE = (200, 200)
PAPER_START = (5, 5)
PAPER_STEPS = 40_000
EQUAL = ("height", "mass", "neither")
"""What the Gaussians of a prior of the paper's kind may have in common."""


def paper_prior(
    rng: np.random.Generator, shape: tuple[int, int] = PAPER_SHAPE, *, equal: str = "height"
) -> NDArray[np.float64]:
    """A prior of the paper's experiment (section IV): 1 to 5 Gaussians, summed and normalised.

    Means are uniform over the map; the standard deviation along each axis is uniform in 0.04 to 0.12 on a
    map that spans [-1, 1], that is 4 to 12 cells on 200 x 200.

    Args: equal: what the Gaussians have in common before the sum is normalised: "height" (a wide one then
        holds more mass); "mass", each a probability density; or "neither", with heights uniform in 0.18 to
        0.88, as the authors' test code draws them. The paper does not say which.

    Returns float [rows, cols] summing to 1. Raises ValueError for another `equal`.
    """
    if equal not in EQUAL:
        raise ValueError(f"equal is one of {', '.join(EQUAL)}, not '{equal}'")
    count = int(rng.integers(1, 6))
    means = rng.uniform(0.0, shape, (count, 2))
    stds = rng.uniform(0.04, 0.12, (count, 2)) * np.array(shape) / 2.0
    heights = rng.uniform(0.18, 0.88, count) if equal == "neither" else np.ones(count)
    total = np.zeros(shape)
    for mean, std, height in zip(means, stds, heights, strict=True):
        bells = [np.exp(-0.5 * ((np.arange(n) - mean[i]) / std[i]) ** 2) for i, n in enumerate(shape)]
        total += height * np.outer(*bells) / (std.prod() if equal == "mass" else 1.0)
    normalised: NDArray[np.float64] = total / total.sum()
    return normalised


def trail_prior(
    rng: np.random.Generator, shape: tuple[int, int], *, width: float = 1.5, bends: int = 3
) -> NDArray[np.float64]:
    """A prior along a trail: from the left edge to the right one in straight parts, a Gaussian of `width` cells across.

    The trail enters, bends `bends` times at even distances and leaves at rows drawn over the middle eight tenths.

    Returns float [rows, cols] summing to 1.
    """
    rows, cols = shape
    at = np.linspace(0.0, cols - 1.0, bends + 2)
    heights = rng.uniform(0.1, 0.9, bends + 2) * rows
    points = np.argwhere(np.ones(shape, dtype=bool)).astype(np.float64)
    nearest = np.full(len(points), np.inf)
    for i in range(bends + 1):
        begin, end = np.array([heights[i], at[i]]), np.array([heights[i + 1], at[i + 1]])
        along = np.clip((points - begin) @ (end - begin) / ((end - begin) @ (end - begin)), 0.0, 1.0)
        nearest = np.minimum(nearest, np.linalg.norm(points - begin - along[:, None] * (end - begin), axis=1))
    likely = np.exp(-0.5 * (nearest / width) ** 2).reshape(shape)
    normalised: NDArray[np.float64] = likely / likely.sum()
    return normalised


def hills(
    shape: tuple[int, int], middles: list[tuple[float, float]], width: float = 8.0
) -> NDArray[np.float64]:
    """Equal Gaussian hills of `width` cells on a map of `shape`, summing to one."""
    prior = np.zeros(shape)
    for row, col in middles:
        top, left = max(0, int(row - 12 * width)), max(0, int(col - 12 * width))
        near = prior[top : int(row + 12 * width), left : int(col + 12 * width)]
        down = np.arange(top, top + near.shape[0])[:, None] - row
        right = np.arange(left, left + near.shape[1])[None, :] - col
        near += np.exp(-(down**2 + right**2) / (2.0 * width**2))
    prior /= prior.sum()
    return prior


FIVE_HILLS = [(60.0, 50.0), (40.0, 140.0), (110.0, 100.0), (160.0, 40.0), (150.0, 160.0)]
"""Where five hills stand on 200 x 200 cells."""


def scattered_hills(side: int) -> NDArray[np.float64]:
    """The same five hills, as wide as ever, as far apart as a map of `side` x `side` cells is large."""
    return hills((side, side), [(row * side / 200, col * side / 200) for row, col in FIVE_HILLS])
