"""Where the target most likely is: the peak of a belief with its neighbourhood."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Place:
    """A cell, the probability of the (2 * radius + 1)-square around it, its centroid and covariance.

    `centroid` is (row, col) as floats, `covariance` float [2, 2] in cells squared, within the square; it includes
    the variance of a uniform position inside a cell (1/12).
    """

    cell: tuple[int, int]
    probability: float
    centroid: tuple[float, float]
    covariance: NDArray[np.float64]


def most_likely_place(probability: NDArray[np.float64], radius: int = 1) -> Place:
    """The square of cells around the most probable cell of `probability` (float [rows, cols])."""
    row, col = (int(i) for i in np.unravel_index(int(probability.argmax()), probability.shape))
    top, left = max(0, row - radius), max(0, col - radius)
    window = probability[top : row + radius + 1, left : col + radius + 1]
    mass = float(window.sum())
    if mass <= 0.0:
        return Place((row, col), 0.0, (float(row), float(col)), np.eye(2) / 12.0)
    rows, cols = np.mgrid[top : top + window.shape[0], left : left + window.shape[1]]
    weight = window / mass
    centre = float((weight * rows).sum()), float((weight * cols).sum())
    off = np.stack([(rows - centre[0]).ravel(), (cols - centre[1]).ravel()])
    covariance = (off * weight.ravel()) @ off.T + np.eye(2) / 12.0
    return Place((row, col), mass, centre, covariance)
