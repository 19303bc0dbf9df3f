"""Where the simulated target is: drawn from the prior, with a seed; and where it walks from there."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:  # a detector and a mock start many times in a campaign, and need no compiler
    from roisearch import Walk


def draw_target(probability: NDArray[np.float64], rng: np.random.Generator) -> tuple[float, float]:
    """A position as (row, col), in cells with fractions (cell (0, 0) spans 0..1), drawn from `probability`
    (float [rows, cols], sum 1); not within a tenth of a cell of its border."""
    cell = int(rng.choice(probability.size, p=probability.ravel()))
    row, col = divmod(cell, probability.shape[1])
    low, high = rng.uniform(0.1, 0.9, size=2)
    return row + float(low), col + float(high)


@dataclass(frozen=True, eq=False)
class Tour:
    """Where a target is at each time: straight legs between `places`, float [n, 2], at `seconds`, float [n], from 0 on.

    After the last it stays.
    """

    seconds: NDArray[np.float64]
    places: NDArray[np.float64]

    def at(self, seconds: float) -> tuple[float, float]:
        """The place at a time."""
        first, second = (float(np.interp(seconds, self.seconds, self.places[:, axis])) for axis in (0, 1))
        return first, second


STRIDE = 0.1
"""How far a target goes before it looks where it steps, in cells."""


def draw_tour(
    start: tuple[float, float],
    walk: Walk,
    open_cells: NDArray[np.bool_],
    seconds: float,
    rng: np.random.Generator,
) -> Tour:
    """A random tour from `start` (row, col, with fractions) for so long: what `roisearch.walk` reckons as a diffusion.

    Straight legs at the speed of `walk`, with a new direction after times that are exponential, and wherever the next
    stride would lead off `open_cells`, bool [rows, cols], or into a cell that it does not enter this time, as it does
    with the chance of that cell's mobility; until it stops for good.
    """
    mobility = None if walk.mobility is None else np.asarray(walk.mobility)
    stops_after = rng.exponential(3600.0 / walk.stops_per_hour) if walk.stops_per_hour > 0.0 else math.inf
    end, stride_s = min(seconds, stops_after), STRIDE * walk.cell_m / walk.speed_mps
    time, place = 0.0, np.array(start, dtype=np.float64)
    times, places = [0.0], [place]
    while time < end:
        angle = rng.uniform(0.0, 2.0 * math.pi)
        turn = min(time + rng.exponential(walk.straight_s), end)
        direction = np.array([math.sin(angle), math.cos(angle)]) / walk.cell_m * walk.speed_mps
        while time < turn:
            passed = min(stride_s, turn - time)
            there = place + direction * passed
            if not _is_open(there, open_cells) or not _enters(place, there, mobility, rng):
                time += 1e-3 * stride_s  # turning on the spot; whoever is walled in comes to an end too
                break
            time, place = time + passed, there
        times.append(time)
        places.append(place)
    return Tour(np.array(times), np.array(places))


def _enters(
    place: NDArray[np.float64],
    there: NDArray[np.float64],
    mobility: NDArray[np.float64] | None,
    rng: np.random.Generator,
) -> bool:
    """Whether a stride from `place` is made: into another cell with the chance of its mobility."""
    if mobility is None or np.array_equal(np.floor(place), np.floor(there)):
        return True
    return bool(rng.random() < mobility[math.floor(there[0]), math.floor(there[1])])


def _is_open(place: NDArray[np.float64], open_cells: NDArray[np.bool_]) -> bool:
    row, col = math.floor(place[0]), math.floor(place[1])
    rows, cols = open_cells.shape
    return 0 <= row < rows and 0 <= col < cols and bool(open_cells[row, col])
