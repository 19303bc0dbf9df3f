"""How long an aircraft can stay in the air, and what of that the way home takes: what a battery leaves to a plan."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from roisearch.decision import Cell
from roisearch.motion import Motion


@dataclass(frozen=True, eq=False)
class Endurance:
    """What is left of a battery, in seconds.

    A cell may be entered `t` seconds from now when `t + home_s[cell] <= remaining_s`: from there the aircraft still
    gets home.

    Attributes:
        remaining_s: until the aircraft must be on the ground, reserve not counted.
        home_s: what the way home takes from each cell, landing included, float [rows, cols]; infinite where there is
            none.

    Raises: ValueError when `remaining_s` is not a number, or a way home takes less than nothing.
    """

    remaining_s: float
    home_s: NDArray[np.float64]

    def __post_init__(self) -> None:
        if not self.remaining_s > -np.inf:
            raise ValueError(f"remaining_s must be a number of seconds, not {self.remaining_s}")
        if self.home_s.ndim != 2 or not (self.home_s >= 0.0).all():
            raise ValueError("home_s is seconds of at least 0 for each cell, [rows, cols]")

    def search_s(self, cell: Cell) -> float:
        """How long the search can go on if it ends at `cell`, in seconds; below 0 when it is too late."""
        return self.remaining_s - float(self.home_s[cell])


def straight_home(
    motion: Motion, shape: tuple[int, int], home: tuple[float, float], landing_s: float = 0.0
) -> NDArray[np.float64]:
    """Seconds home from each cell, float [rows, cols]: straight from a stand to a stand, in no wind, and landing.

    Args:
        home: rows and columns; the middle of a cell has whole ones. It may lie off the map.
    """
    down, right = np.indices(shape)
    metres = motion.cell_m * np.hypot(down - home[0], right - home[1])
    seconds = np.array([motion.leg_seconds(float(each)) for each in metres.ravel()])
    return seconds.reshape(shape) + landing_s
