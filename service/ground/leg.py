"""What a straight leg clears the ground by: the least of it, wherever the autopilot is in between. Pure.

A target has one height, and autopilots differ in how they get there: ArduCopter flies the straight line in space, PX4
climbs and sinks as fast as it may while it flies. So a leg is judged by the lowest that any of them is: at the lower
height from the start on when it sinks, and when it climbs at the lower of the straight line and the climb rate. And as
the aircraft may be told to stop at any moment, it must clear what lies ahead by its braking distance at the height at
which it is then.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from service.geometry import Metres
from service.ground.relief import Floats, Relief

_MOST_SAMPLES = 20_000


@dataclass(frozen=True, eq=False)
class GroundProfile:
    """The ground along a leg.

    Attributes:
        along: float [n], metres from its start, at most half a step of the ground apart.
        roof: float [n], the highest ground within reach of the leg there, and ahead by the braking distance; above the
            launch point. Infinite: not known.
        ground: float [n], the ground below; NaN: not known.
    """

    along: Floats
    roof: Floats
    ground: Floats

    @property
    def length_m(self) -> float:
        """How long the leg is."""
        return float(self.along[-1])

    @property
    def highest_m(self) -> float:
        """The highest ground within reach."""
        return float(self.roof.max())


def profile(relief: Relief, start: Metres, end: Metres, *, ahead_m: float = 0.0) -> GroundProfile:
    """The ground along the straight leg between two places (east, south); `ahead_m`: the braking distance."""
    length = math.hypot(end[0] - start[0], end[1] - start[1])
    if not math.isfinite(length):
        return GroundProfile(np.zeros(1), np.full(1, np.inf), np.full(1, np.nan))
    pieces = max(1, math.ceil(length / (0.5 * relief.step_m)))
    if pieces > _MOST_SAMPLES:
        return GroundProfile(np.array([0.0, length]), np.full(2, np.inf), np.full(2, np.nan))
    share = np.linspace(0.0, 1.0, pieces + 1)
    points = np.array(start) + share[:, None] * (np.array(end) - np.array(start))
    return GroundProfile(
        share * length, _ahead(relief.roof_at(points), share * length, ahead_m), relief.height_at(points)
    )


def _ahead(roof: Floats, along: Floats, ahead_m: float) -> Floats:
    """The highest from each sample to `ahead_m` further on."""
    spacing = along[1] - along[0] if len(along) > 1 else 0.0
    if ahead_m <= 0.0 or spacing <= 0.0:
        return roof
    count = min(math.ceil(ahead_m / spacing), len(roof) - 1)
    padded = np.concatenate([roof, np.full(count, -np.inf)])
    return np.asarray(np.lib.stride_tricks.sliding_window_view(padded, count + 1).max(axis=1))


def lowest_path(seen: GroundProfile, start_m: float, end_m: float, climb_per_m: float) -> Floats:
    """The lowest that the aircraft may be along a leg that begins and ends at these heights: float [n].

    `climb_per_m` is how much it surely climbs in a metre over ground.
    """
    if end_m <= start_m:
        return np.full(len(seen.along), end_m)
    length = seen.length_m
    slope = min((end_m - start_m) / length, climb_per_m) if length > 0.0 else 0.0
    return np.minimum(start_m + slope * seen.along, end_m)


def passing(
    along_m: float, length_m: float, start_m: float, end_m: float, most_per_m: float
) -> tuple[float, float]:
    """The two heights between which the aircraft passes a place on a leg: on the straight line in space, and as soon as
    it may, where `most_per_m` is how much it changes its height in a metre over ground."""
    rise = end_m - start_m
    soon = math.copysign(min(abs(rise), most_per_m * along_m), rise)
    return start_m + along_m / length_m * rise, start_m + soon


def highest_above(seen: GroundProfile, start_m: float, end_m: float, sink_per_m: float) -> float:
    """How high above the ground below the aircraft may be at the most on a leg that begins and ends at these heights.

    `sink_per_m` is how much it surely sinks in a metre over ground; it may climb at once. Minus infinity where none of
    the ground is known.
    """
    highest = np.maximum(start_m - sink_per_m * seen.along, end_m) if end_m < start_m else end_m
    return float(np.nanmax(highest - seen.ground, initial=-math.inf))


@dataclass(frozen=True, slots=True)
class Least:
    """The least clearance of a leg, in metres (minus infinity where the ground is not known), and how far along."""

    metres: float
    along_m: float


def least_clearance(seen: GroundProfile, start_m: float, end_m: float, climb_per_m: float) -> Least:
    """How near to the ground a leg comes, between these heights above the launch point."""
    clear = lowest_path(seen, start_m, end_m, climb_per_m) - seen.roof
    where = int(np.argmin(clear))
    return Least(float(clear[where]), float(seen.along[where]))
