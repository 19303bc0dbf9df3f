"""Where the target most likely is: peaks of a belief with their neighbourhoods."""

from __future__ import annotations

from collections.abc import Iterable
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
    return place_at(probability, (row, col), radius)


def likely_places(
    probability: NDArray[np.float64],
    cells: Iterable[tuple[int, int]],
    *,
    radius: int = 1,
    least: float = 0.05,
    most: int = 8,
) -> list[Place]:
    """The squares around some of `cells`, the most probable cell first; no cell is in two of them.

    Squares with a probability below `least` are left out, and cells with less than a ninth of it themselves (so that
    few are left to look at, however many are given). At most `most` are returned.
    """
    places: list[Place] = []
    given = np.array(list(cells), dtype=np.int64).reshape(-1, 2)
    own = probability[given[:, 0], given[:, 1]]
    promising = [(row, col) for row, col in given[own >= least / 9.0].tolist()]
    for cell in sorted(promising, key=lambda each: (-probability[each], each)):
        near = any(max(abs(cell[i] - place.cell[i]) for i in (0, 1)) <= 2 * radius for place in places)
        if not near and (place := place_at(probability, cell, radius)).probability >= least:
            places.append(place)
            if len(places) == most:
                break
    return places


def place_at(probability: NDArray[np.float64], cell: tuple[int, int], radius: int = 1) -> Place:
    """The square of cells around `cell` on `probability` (float [rows, cols])."""
    row, col = cell
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
