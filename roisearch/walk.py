"""How a target moves: it stands still, or it walks at random, and perhaps stops for good.

The walk is the random tour of search theory: straight legs at one speed, with a new direction, any of them alike, after
times that are exponential with a mean of `straight_s` (Washburn, 'The probability density of a moving particle', Naval
Research Logistics 16, 1969; Koopman, 'Search and Screening', 1980). Its mean square distance after t seconds tends to
2 speed^2 straight_s t, that of a diffusion with D = speed^2 straight_s / 2 in the plane, and as that it is reckoned:
a target on the cells of the map that may step to each of its four neighbours once a *tick*. So it spreads a little too
far while t is below `straight_s`. Borders reflect: for each target that leaves the area, one comes in.

On a map of mobilities the chance to step into a cell is multiplied by the mobility of that cell. So a walker keeps to
paths (mobility 1) among scrub (0.2), never enters water and cliffs (0), and where it has walked for long it is found in
proportion to the mobility of each cell. A target that evades, which reads the search and hides from it, is out of
scope: that is a game, and needs another theory.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from roisearch.kernels import walking

SHARE = 0.125
"""The chance to step into one open neighbour in a tick: half of all stay, so that no checkerboard can show."""
MOST_S = 1e8
"""The longest drift at once, three years."""


@dataclass(frozen=True, eq=False)
class Walk:
    """A random walk with a speed, and with stops.

    Args:
        speed_mps: of the target, metres a second, above 0.
        cell_m: edge of a cell, metres.
        straight_s: mean seconds between changes of direction.
        stops_per_hour: how often in an hour a target that walks stops for good, at random times.
        mobility: float [rows, cols] from 0 (closed) to 1 (as fast as `speed_mps` says); None: 1 everywhere.

    Raises:
        ValueError: when one of these cannot be.
    """

    speed_mps: float
    cell_m: float
    straight_s: float = 60.0
    stops_per_hour: float = 0.0
    mobility: ArrayLike | None = None
    _mobility: NDArray[np.float64] | None = field(init=False, repr=False, default=None)

    def __post_init__(self) -> None:
        for name in ("speed_mps", "cell_m", "straight_s"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise ValueError(f"{name} of a walk must be a finite number above 0, not {value}")
        if not (math.isfinite(self.stops_per_hour) and self.stops_per_hour >= 0.0):
            raise ValueError(f"stops_per_hour must be finite and at least 0, not {self.stops_per_hour}")
        if self.mobility is not None:
            mobility = np.array(self.mobility, dtype=np.float64)
            if mobility.ndim != 2 or not ((mobility >= 0.0) & (mobility <= 1.0)).all():
                raise ValueError("mobility must be a map of rows and columns with values from 0 to 1")
            object.__setattr__(self, "_mobility", mobility)

    @property
    def diffusion(self) -> float:
        """Square metres a second: each coordinate's variance grows by twice this where the mobility is 1."""
        return self.speed_mps**2 * self.straight_s / 2.0

    @functools.cached_property
    def tick_us(self) -> int:
        """Whole microseconds after which the target may step, at least 1."""
        return max(1, round(1e6 * SHARE * self.cell_m**2 / self.diffusion))

    def ways(self, shape: tuple[int, int], open_cells: NDArray[np.bool_] | None) -> Ways:
        """The walk on a map of `shape`, where only `open_cells`, bool [rows, cols], are walked; None: all.

        Raises:
            ValueError: when the mobility is of another shape.
        """
        if self._mobility is not None and self._mobility.shape != shape:
            raise ValueError(f"mobility has the shape {self._mobility.shape}, the map {shape}")
        inner = np.ones(shape) if self._mobility is None else self._mobility.copy()
        if open_cells is not None:
            inner[~open_cells] = 0.0
        share = self.diffusion * (self.tick_us * 1e-6) / self.cell_m**2
        into = np.zeros((shape[0] + 2, shape[1] + 2))
        into[1:-1, 1:-1] = min(share, 0.25) * inner
        return Ways(self, into, -math.expm1(-self.stops_per_hour * self.tick_us / 3.6e9))


@dataclass(frozen=True, eq=False)
class Ways:
    """A walk on one map: `into`, float [rows + 2, cols + 2], the chance to step into each cell in a tick, and `stops`,
    that to stop after it. See `roisearch.kernels.walking`."""

    walk: Walk
    into: NDArray[np.float64]
    stops: float

    def __deepcopy__(self, memo: dict[int, object]) -> Ways:
        return self  # it never changes

    def going(self) -> NDArray[np.float64]:
        """What part of each cell's mass walks at first: [cells], or [0] where nobody ever stops and all do."""
        rows, cols = self.into.shape
        return np.ones((rows - 2) * (cols - 2) if self.stops > 0.0 else 0)

    def go(self, weights: NDArray[np.float64], going: NDArray[np.float64], ticks: int) -> None:
        """Let those who walk walk for some ticks; `weights` [cells] and `going`, as of `going()`, change in place."""
        room = walking.Room(np.empty(self.into.shape), np.empty(self.into.shape))
        walking.set_out(weights, going, room)
        for _ in range(ticks):
            walking.tick(weights, self.into, self.stops, room)
            room = walking.Room(room.then, room.now)
        walking.arrive(weights, going, room)


class Drift:
    """How far a belief's walk has been reckoned: whole ticks, and the microseconds since, which wait.

    Time is kept in whole microseconds, so that any two ways to the same time are the same to the last bit.
    """

    def __init__(self, ways: Ways) -> None:
        self.ways, self.going = ways, ways.going()
        self.waiting_us = 0

    def wait(self, seconds: float) -> int:
        """Let time pass; how many ticks are due, which whoever asks then has to go.

        Raises:
            ValueError: when `seconds` is not a time that can pass.
        """
        if not 0.0 <= seconds <= MOST_S:
            raise ValueError(f"a belief drifts for 0 to {MOST_S:g} seconds, not {seconds}")
        ticks, self.waiting_us = divmod(self.waiting_us + round(seconds * 1e6), self.ways.walk.tick_us)
        return ticks

    def copy(self) -> Drift:
        """An independent one at the same time, on the same map."""
        twin = Drift.__new__(Drift)
        twin.ways, twin.going, twin.waiting_us = self.ways, self.going.copy(), self.waiting_us
        return twin
