"""How long a flight along cells takes, before it is flown.

The aircraft flies each straight leg with the search's speed and the braking of `flight.deceleration_mps2`, which is
taken for speeding up as well, and comes to a stand at every turn. That is an allowance and no law: in two simulated
searches of 220 steps with cells of 25 m, an aircraft like PX4 took 3 % longer than this and one like ArduPilot, which
cuts corners, 19 % shorter. Wind, and false alarms beyond those of the detector's p_tn, come on top.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from service.area import Grid, way_home
from service.area.model import LatLon
from service.area.projection import FloatArray
from service.config import FlightSettings

ARMING_S = 4.0

ALLOWANCE = "every turn taken as a full stop (PX4 simulated: 3 % slower, ArduPilot simulated: 19 % faster)"


def leg_seconds(length_m: float, flight: FlightSettings) -> float:
    """Seconds for a straight leg from standstill to standstill."""
    speed, braking = flight.speed_mps, flight.deceleration_mps2
    if length_m >= speed**2 / braking:
        return length_m / speed + speed / braking
    return 2.0 * float(np.sqrt(length_m / braking))


def climb_seconds(flight: FlightSettings) -> float:
    """Seconds for the take-off to the height of the search, arming and settling included.

    The simulated flights took 18 and 19 s to 30 m, with `flight.climb_mps` at 2.
    """
    return flight.altitude_m / flight.climb_mps + ARMING_S


def cell_seconds(
    cells: Sequence[tuple[int, int]], stops: Sequence[int], cell_m: float, flight: FlightSettings
) -> NDArray[np.float64]:
    """Seconds at which each of `cells` is entered, float [n], the first at 0; neighbours follow each other.

    `stops`: indices of cells, beside those where the path turns, at which the aircraft stops.
    """
    moves = np.diff(np.asarray(cells, dtype=np.int64).reshape(-1, 2), axis=0)
    turned = np.flatnonzero((moves[1:] != moves[:-1]).any(axis=1)) + 1
    inner = {int(stop) for stop in stops if 0 < stop < len(moves)}
    ends = [*sorted({*turned.tolist(), *inner}), len(moves)] if len(moves) else []
    times, begun = [0.0], 0
    for end in ends:
        count = end - begun
        seconds = leg_seconds(count * cell_m, flight)
        times += [times[begun] + seconds * (step + 1) / count for step in range(count)]
        begun = end
    return np.array(times)


def way_metres(grid: Grid, start: LatLon, end: LatLon) -> FloatArray:
    """The way around what must not be flown over, its start included, in metres of the grid [k, 2]."""
    return grid.frame.to_metres([start, *way_home(grid, start, end)])


def route_seconds(grid: Grid, flight: FlightSettings, start: LatLon, end: LatLon) -> float:
    """Seconds for that way, at the height of the search."""
    legs = np.hypot(*np.diff(way_metres(grid, start, end), axis=0).T)
    return sum(leg_seconds(float(length), flight) for length in legs)


def farthest_from_launch(grid: Grid) -> LatLon:
    """The flyable cell that is farthest from the launch point, as the crow flies."""
    cells = grid.frame.to_latlon(np.argwhere(grid.flyable))
    metres = grid.frame.to_metres(cells) - grid.frame.to_metres([grid.launch])[0]
    lat, lon = cells[int(np.hypot(*metres.T).argmax())]
    return float(lat), float(lon)
