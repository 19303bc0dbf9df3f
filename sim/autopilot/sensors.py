"""What the vehicle believes and what its GPS receiver says: the truth plus slowly wandering errors."""

from __future__ import annotations

import math
import random

PERIOD_S = 0.1  # the errors are drawn this often


class Wander:
    """A first-order Gauss-Markov error: standard deviation and correlation time stay what they are told."""

    __slots__ = ("_keep", "_kick", "_random", "value")

    def __init__(
        self, deviation: float, seconds: float, source: random.Random, period: float = PERIOD_S
    ) -> None:
        self._random = source
        self._keep = math.exp(-period / seconds)
        self._kick = deviation * math.sqrt(1.0 - self._keep**2)
        self.value = 0.0

    def draw(self) -> float:
        """Move on by one period and return the error."""
        self.value = self._keep * self.value + self._kick * self._random.gauss(0.0, 1.0)
        return self.value


class Estimator:
    """The vehicle's own position and velocity estimate, as errors in metres and m/s on the truth."""

    __slots__ = (
        "_draws",
        "bad",
        "east",
        "jump",
        "north",
        "up",
        "velocity_east",
        "velocity_north",
        "velocity_up",
    )

    def __init__(self, position_m: float, velocity_mps: float, source: random.Random) -> None:
        self._draws = tuple(Wander(position_m, 15.0, source) for _ in range(3)) + tuple(
            Wander(velocity_mps, 0.3, source) for _ in range(3)
        )
        self.north = self.east = self.up = 0.0
        self.velocity_north = self.velocity_east = self.velocity_up = 0.0
        self.jump = (0.0, 0.0)  # metres north and east that a GPS jump has put on the estimate
        self.bad = False  # the filter has diverged: variances out of bounds

    def draw(self) -> None:
        """New errors."""
        north, east, up, vn, ve, vu = (each.draw() for each in self._draws)
        self.north, self.east, self.up = north + self.jump[0], east + self.jump[1], 0.5 * up
        self.velocity_north, self.velocity_east, self.velocity_up = vn, ve, 0.5 * vu


class GpsReceiver:
    """Fix, satellites and the receiver's own position error in metres."""

    __slots__ = ("_draws", "east", "jump", "lost", "north", "up")

    def __init__(self, source: random.Random) -> None:
        self._draws = (Wander(0.6, 20.0, source), Wander(0.6, 20.0, source), Wander(1.0, 20.0, source))
        self.north = self.east = self.up = 0.0
        self.lost = False
        self.jump = (0.0, 0.0)

    def draw(self) -> None:
        """New errors."""
        north, east, up = (each.draw() for each in self._draws)
        self.north, self.east, self.up = north + self.jump[0], east + self.jump[1], up

    @property
    def satellites(self) -> int:
        """Satellites in use."""
        return 0 if self.lost else 10


class Wind:
    """A mean wind and gusts: the velocity of the air towards north and east, m/s."""

    __slots__ = ("_gusts", "mean")

    def __init__(self, mean: tuple[float, float], gust: float, source: random.Random) -> None:
        self.mean = mean
        self._gusts = (Wander(gust, 3.0, source), Wander(gust, 3.0, source)) if gust > 0 else None

    def draw(self) -> tuple[float, float]:
        """The wind until the next period."""
        if self._gusts is None:
            return self.mean
        return self.mean[0] + self._gusts[0].draw(), self.mean[1] + self._gusts[1].draw()
