"""What an aircraft's motion costs, learnt from where it was when."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from roisearch.decision import Cell
from roisearch.directions import direction_index
from roisearch.motion import TURNS, Motion

MOST_MPS2 = 10.0
"""Harder than this no multicopter speeds up or brakes; short legs may not tell."""


@dataclass(frozen=True)
class Flown:
    """A flown path: the cells entered from `start` on, and the seconds at which each was reached, float [n].

    `heights` are those at `start` and at each cell, in metres, float [n + 1]; None: all alike.
    """

    start: Cell
    heading: str
    path: Sequence[Cell]
    arrivals: ArrayLike
    heights: ArrayLike | None = None

    def durations(self) -> NDArray[np.float64]:
        """Seconds from cell to cell, without the first: from where and how fast it began is not known."""
        return np.diff(np.asarray(self.arrivals, dtype=np.float64))


def learnt(motion: Motion, flights: Sequence[Flown]) -> Motion:
    """`motion` with the speed, acceleration, braking and speeds at corners that explain `flights` best.

    Corners of a kind that were not flown keep what `motion` says, in proportion to those that were. At least
    some twenty cells with some corners are needed to tell one from another. Raises ValueError when no flight
    has two cells.
    """
    flights = [flight for flight in flights if len(flight.path) > 1]
    if not flights:
        raise ValueError("to learn a motion takes a flight of at least two cells")
    measured = np.concatenate([flight.durations() for flight in flights])
    known = _parameters(motion)
    seen = _corners_flown(motion, flights)

    def wrong(logarithms: NDArray[np.float64]) -> float:
        """How far off the times are; what nothing speaks for stays near where it was."""
        found = _motion(motion, known * np.exp(logarithms), seen)
        said = [
            np.diff(found.arrivals(f.path, f.start, f.heading, found.speed_mps, f.heights)) for f in flights
        ]
        return float(((np.concatenate(said) - measured) ** 2).mean() + 1e-4 * (logarithms**2).mean())

    from scipy import optimize

    start = np.zeros(known.size)
    for _ in range(3):  # the simplex begun anew: once it may stick
        found = optimize.minimize(wrong, start, method="Nelder-Mead", options={"maxiter": 600, "fatol": 1e-6})
        start = found.x
    return _motion(motion, known * np.exp(start), seen)


def _parameters(motion: Motion) -> NDArray[np.float64]:
    pace = motion.pace
    corners = [max(0.2, motion.corner_speed(degrees)) for degrees in TURNS]
    return np.array([motion.speed_mps, pace.accelerate, pace.brake, *corners])


def _motion(motion: Motion, values: NDArray[np.float64], seen: NDArray[np.bool_]) -> Motion:
    speed, accelerate, brake = (float(value) for value in values[:3])
    accelerate, brake = min(accelerate, MOST_MPS2), min(brake, MOST_MPS2)
    corners, known = values[3:].copy(), _parameters(motion)[3:]
    if seen.any() and not seen.all():
        corners[~seen] = known[~seen] * float(np.exp(np.log(corners[seen] / known[seen]).mean()))
    speeds = tuple(min(float(corner), speed) for corner in corners)
    return replace(
        motion,
        speed_mps=speed,
        acceleration_mps2=accelerate,
        braking_mps2=brake,
        corners_mps=(speeds[0], speeds[1], speeds[2], speeds[3]),
    )


def _corners_flown(motion: Motion, flights: Sequence[Flown]) -> NDArray[np.bool_]:
    """Which of the corners of 45, 90, 135 and 180 degrees were flown, bool [4]."""
    seen = np.zeros(len(TURNS) + 1, dtype=bool)
    for flight in flights:
        directions = [leg.direction for leg in motion.legs(flight.path, flight.start)]
        for before, after in itertools.pairwise(directions):
            apart = (direction_index(after) - direction_index(before)) % 8
            seen[min(apart, 8 - apart)] = True
    return seen[1:]
