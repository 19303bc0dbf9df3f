"""The ground that the camera looks at: flat, or (in `terrain`) as a height model has it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from service.camera.optics import Floats


class Ground(Protocol):
    """Where the ground is, in metres up from the launch point."""

    @property
    def lowest_m(self) -> float:
        """The lowest ground there is."""
        ...

    def height_at(self, points: Floats) -> Floats:
        """Up at points [k, 2] (east, south): float [k]."""
        ...

    def meet(self, origin: Floats, rays: Floats, max_range_m: float) -> Floats:
        """How far along each of the unit `rays` [k, 3] from `origin` [3] the ground is: float [k], NaN where a ray
        does not meet it within `max_range_m`."""
        ...

    def in_sight(self, origin: Floats, points: Floats) -> NDArray[np.bool_]:
        """Which of the ground's points [k, 3] nothing hides from `origin` [3]."""
        ...


@dataclass(frozen=True)
class Flat:
    """Level ground at the launch point's height."""

    lowest_m: float = 0.0

    def height_at(self, points: Floats) -> Floats:
        """The same everywhere."""
        return np.full(len(points), self.lowest_m)

    def meet(self, origin: Floats, rays: Floats, max_range_m: float) -> Floats:
        """Where a ray that goes down meets the plane; one at or above the horizon never does."""
        down = np.where(rays[:, 2] < 0.0, -rays[:, 2], np.nan)
        far = (origin[2] - self.lowest_m) / down
        with np.errstate(invalid="ignore"):
            return np.where((far >= 0.0) & (far <= max_range_m), far, np.nan)

    def in_sight(self, origin: Floats, points: Floats) -> NDArray[np.bool_]:
        """All of them, from above."""
        return np.full(len(points), bool(origin[2] > self.lowest_m))
