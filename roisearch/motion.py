"""How long a path takes: the seconds of flight that a plan costs."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from roisearch.decision import Cell
from roisearch.directions import DIRECTIONS, STEPS, direction_between, direction_index
from roisearch.kernels.motion import Climb, Pace, arrive, climb_along, straight_seconds

TURNS = (45, 90, 135, 180)
"""The corners of a path over eight neighbours, in degrees."""


class Leg(NamedTuple):
    """A straight part of a path: from the middle of one cell to that of another, in one direction."""

    start: Cell
    end: Cell
    direction: str
    cells: int


def leg_seconds(metres: float, speed_mps: float, acceleration_mps2: float, braking_mps2: float) -> float:
    """Seconds for a straight way from a stand to a stand."""
    return float(straight_seconds(metres, 0.0, 0.0, speed_mps, acceleration_mps2, braking_mps2))


@dataclass(frozen=True)
class Motion:
    """What speed, turns, starts, wind and climbing cost. Metres, seconds, degrees.

    A path is flown from middle to middle of its cells. A corner is rounded: the aircraft leaves the leg
    `corner_m` before the middle and joins the next as far behind it, on an arc that it can hold with its
    acceleration, which gives the one speed there; turning round is a full stop. It speeds up with
    `acceleration_mps2` and brakes with `braking_mps2` in between, never faster than `speed_mps`. (For who brakes
    much more weakly than it speeds up, and would brake in one corner for the next, that is up to a fifth too long.)

    Attributes:
        cell_m: length of a cell's side.
        speed_mps: ground speed on a straight leg.
        acceleration_mps2: infinite for a vehicle that has its speed at once.
        braking_mps2: None for the same as `acceleration_mps2`.
        corner_m: how far before a corner the turn begins, at most half a cell; 0 for a full stop at each.
        corners_mps: the speeds at corners of 45, 90, 135 and 180 degrees, where they are known better than by
            that arc; 0 is a full stop.
        turning_dps: how fast it turns on the spot, where it stops and must turn before it flies on; infinite
            for an aircraft that flies sideways as well.
        wind_mps: what the air does, (down the rows, right along the columns), in the grid's own frame.
        airspeed_mps: the most through the air: against a strong wind it is slower over ground.
        climb_mps: how fast it climbs; where heights are given, no cell is reached sooner than that lets it.
        descent_mps: how fast it sinks; None for the same.
        slack_m: how far below and above the height that is given for a cell it may be when it gets there.
        diagonal: whether it flies to eight neighbours; else to four.

    Raises: ValueError when a value is out of range, or the wind is so strong that it cannot fly against it.
    """

    cell_m: float
    speed_mps: float = 8.0
    acceleration_mps2: float = 1.5
    braking_mps2: float | None = None
    corner_m: float = 5.0
    corners_mps: tuple[float, float, float, float] | None = None
    turning_dps: float = math.inf
    wind_mps: tuple[float, float] = (0.0, 0.0)
    airspeed_mps: float = math.inf
    climb_mps: float = 2.0
    descent_mps: float | None = None
    slack_m: tuple[float, float] = (0.0, 0.0)
    diagonal: bool = True

    def __post_init__(self) -> None:
        for name in ("cell_m", "speed_mps"):
            if not 0.0 < getattr(self, name) < math.inf:
                raise ValueError(f"{name} must be above 0 and finite, not {getattr(self, name)}")
        for name in ("acceleration_mps2", "turning_dps", "airspeed_mps", "climb_mps"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"{name} must be above 0, not {getattr(self, name)}")
        for name in ("braking_mps2", "descent_mps"):
            if getattr(self, name) is not None and not getattr(self, name) > 0.0:
                raise ValueError(f"{name} must be above 0, not {getattr(self, name)}")
        if not all(0.0 <= metres < math.inf for metres in self.slack_m):
            raise ValueError(f"slack_m is metres below and above of at least 0, not {self.slack_m}")
        if not 0.0 <= self.corner_m < math.inf:
            raise ValueError(f"corner_m must be at least 0 and finite, not {self.corner_m}")
        speeds = self.corners_mps
        if speeds is not None and (len(speeds) != len(TURNS) or not all(0.0 <= v < math.inf for v in speeds)):
            raise ValueError(f"corners_mps is four speeds of at least 0, for {TURNS} degrees, not {speeds}")
        for name, speed in zip(DIRECTIONS, self._cruise, strict=True):
            if not speed > 0.0:
                raise ValueError(f"with this wind {self.wind_mps} it cannot fly {name} at all")

    @classmethod
    def steps(cls) -> Motion:
        """The paper's world: a second for each move to one of four neighbours, and turns are free."""
        return cls(cell_m=1.0, speed_mps=1.0, acceleration_mps2=math.inf, corner_m=0.0, diagonal=False)

    @property
    def is_steps(self) -> bool:
        """Whether every move takes the same time, whatever the path: then steps say it all."""
        return not self.diagonal and math.isinf(self.acceleration_mps2) and len(set(self._cruise)) == 1

    @property
    def _cruise(self) -> tuple[float, ...]:
        """Speed over ground in each of the eight directions."""
        return tuple(
            self._speed_towards(down / math.hypot(down, right), right / math.hypot(down, right))
            for down, right in STEPS
        )

    def _speed_towards(self, down: float, right: float) -> float:
        along = self.wind_mps[0] * down + self.wind_mps[1] * right
        across = self.wind_mps[0] * right - self.wind_mps[1] * down
        if math.isinf(self.airspeed_mps):
            return self.speed_mps
        spare = self.airspeed_mps**2 - across**2
        return min(self.speed_mps, along + math.sqrt(spare)) if spare > 0.0 else 0.0

    def corner_speed(self, degrees: int) -> float:
        """The speed in a corner of 45, 90, 135 or 180 degrees."""
        if self.corners_mps is not None:
            return min(self.speed_mps, self.corners_mps[TURNS.index(degrees)])
        if math.isinf(self.acceleration_mps2):
            return self.speed_mps
        if degrees == 180 or self.corner_m == 0.0:
            return 0.0
        radius = self._cut / math.tan(math.radians(degrees) / 2.0)
        return min(self.speed_mps, math.sqrt(self.acceleration_mps2 * radius))

    def corner_seconds(self, degrees: int) -> float:
        """What a corner of 45, 90, 135 or 180 degrees costs beside the straight line at full speed."""
        if math.isinf(self.acceleration_mps2):
            return degrees / self.turning_dps if self.corner_speed(degrees) <= 0.0 else 0.0
        pace, turn = self.pace, TURNS.index(degrees) + 1
        speed = float(pace.speed[turn])
        slowed = (self.speed_mps - speed) ** 2 / (2.0 * self.speed_mps)
        lost = slowed / pace.accelerate + slowed / pace.brake
        if speed <= 0.0:
            return lost + float(pace.wait[turn])
        return lost + float(pace.arc[turn]) / speed - 2.0 * float(pace.zone[turn]) / self.speed_mps

    @property
    def _cut(self) -> float:
        return min(self.corner_m, self.cell_m / 2.0)

    @cached_property
    def pace(self) -> Pace:
        """The same for the kernels."""
        speed, zone, arc, wait = np.full(5, np.inf), np.zeros(5), np.zeros(5), np.zeros(5)
        for i, degrees in enumerate(TURNS, start=1):
            speed[i] = self.corner_speed(degrees)
            wait[i] = degrees / self.turning_dps
            if speed[i] > 0.0 and degrees < 180 and not math.isinf(self.acceleration_mps2):
                zone[i] = self._cut
                arc[i] = self._cut / math.tan(math.radians(degrees) / 2.0) * math.radians(degrees)
        brake = self.acceleration_mps2 if self.braking_mps2 is None else self.braking_mps2
        length = (float(self.cell_m), self.cell_m * math.sqrt(2.0))
        cruise = np.array(self._cruise)
        return Pace(*length, float(self.acceleration_mps2), float(brake), cruise, speed, zone, arc, wait)

    def arrivals(
        self,
        path: Sequence[Cell],
        start: Cell,
        heading: str = "north",
        speed_mps: float = 0.0,
        heights: ArrayLike | None = None,
    ) -> NDArray[np.float64]:
        """Seconds from now until each cell of `path` is reached, float [n].

        Args:
            path: cells, each a neighbour of the last, the first a neighbour of `start`.
            start: the cell where the aircraft is.
            heading: the direction it flies in; one of `roisearch.directions.DIRECTIONS`.
            speed_mps: how fast it is there. The path's end is flown over at speed.
            heights: metres at `start` and at each cell, float [n + 1], for flights over ground that is not flat:
                see `climbed`.

        Raises:
            ValueError: when cells are not neighbours, or a corner neighbour where the motion has four.
        """
        rows, cols, _ = self._checked(path, start)
        times = self._arrivals(rows, cols, direction_index(heading), speed_mps)
        if heights is not None:
            along = np.asarray(heights, dtype=np.float64)
            if along.shape != times.shape:
                raise ValueError(f"heights are one for the start and each cell of the path, {times.size}")
            times = self.climbed(times, along)
        return times[1:]

    def climbed(self, times: NDArray[np.float64], heights: NDArray[np.float64]) -> NDArray[np.float64]:
        """`times` [n] of a path over flat ground, over one where it is flown at `heights` [n].

        The aircraft climbs and sinks while it flies from cell to cell, and where that is too little for `slack_m` it
        takes longer: without slack each move takes what the way across or the way up or down takes, the longer one.
        """
        later = times.copy()
        climb_along(np.ascontiguousarray(heights), self.climb(None), later)
        return later

    def upright_s(self, rise: ArrayLike) -> NDArray[np.float64]:
        """Seconds for changes of height, in metres, up above 0 and down below."""
        metres = np.asarray(rise, dtype=np.float64)
        return np.where(metres > 0.0, metres / self.climb_mps, -metres / self._descent)

    @property
    def _descent(self) -> float:
        return self.climb_mps if self.descent_mps is None else self.descent_mps

    def climb(self, heights: ArrayLike | None) -> Climb:
        """For the kernels: what it costs to fly over each cell at `heights`, float [rows, cols]; None: flat ground.

        Raises: ValueError when a height is not finite.
        """
        flat = np.zeros(0) if heights is None else np.array(heights, dtype=np.float64).ravel()
        if not np.isfinite(flat).all():
            raise ValueError("the heights at which cells are flown over must be finite")
        return Climb(flat, 1.0 / self.climb_mps, 1.0 / self._descent, *map(float, self.slack_m))

    def seconds(
        self,
        at: int,
        path: NDArray[np.int64],
        direction: int,
        cols: int,
        heights: NDArray[np.float64] | None = None,
    ) -> NDArray[np.float64]:
        """As `arrivals`, of flat cells of a map with `cols` columns, from `at` at full speed; nothing is checked.

        `heights` are those of all cells, float [cells]; None: flat ground.
        """
        cells = np.concatenate([[at], path]).astype(np.int64)
        times = self._arrivals(cells // cols, cells % cols, direction, self.speed_mps)
        return times[1:] if heights is None else self.climbed(times, heights[cells])[1:]

    def _arrivals(
        self, rows: NDArray[np.int64], cols: NDArray[np.int64], direction: int, speed_mps: float
    ) -> NDArray[np.float64]:
        times = np.zeros(rows.size)
        room = np.zeros(rows.size, dtype=np.int64), np.zeros(rows.size)
        arrive(rows, cols, direction, float(speed_mps), self.pace, *room, times)
        return times

    def leg_seconds(self, metres: float) -> float:
        """Seconds for a straight way from a stand to a stand, in no wind."""
        return leg_seconds(metres, self.speed_mps, self.pace.accelerate, self.pace.brake)

    def legs(self, path: Sequence[Cell], start: Cell) -> list[Leg]:
        """The straight legs of `path` as flown from `start`; raises ValueError as `arrivals` does."""
        found: list[Leg] = []
        _, _, directions = self._checked(path, start)
        here = start
        for cell, direction in zip(path, directions, strict=True):
            if found and found[-1].direction == direction:
                found[-1] = Leg(found[-1].start, cell, direction, found[-1].cells + 1)
            else:
                found.append(Leg(here, cell, direction, 1))
            here = cell
        return found

    def _checked(
        self, path: Sequence[Cell], start: Cell
    ) -> tuple[NDArray[np.int64], NDArray[np.int64], list[str]]:
        """Rows and columns of the start and the path, int [n + 1] each, and the direction of each move."""
        cells = [start, *path]
        directions = [direction_between(a, b) for a, b in itertools.pairwise(cells)]
        for i, direction in enumerate(directions):
            if not self.diagonal and direction_index(direction) % 2:
                raise ValueError(
                    f"this motion flies to four neighbours: {cells[i]} to {cells[i + 1]} is none"
                )
        both = np.array(cells, dtype=np.int64).T
        return np.ascontiguousarray(both[0]), np.ascontiguousarray(both[1]), directions
