"""How long the rest of a flight takes, before it is flown: up, to the search, and home.

How long the search itself takes, from cell to cell, `roisearch.Motion` says.
"""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

from roisearch import Motion
from service.area import Grid, way_home
from service.area.projection import FloatArray
from service.config import FlightSettings
from service.geometry import LatLon
from service.ground.flown import heights_over
from service.ground.relief import Relief
from service.motion import motion_of

ARMING_S = 4.0


def climb_seconds(flight: FlightSettings, grid: Grid) -> float:
    """Seconds for the take-off to the height of the search at the launch point, arming and settling included.

    The simulated flights took 18 and 19 s to 30 m, with `flight.climb_mps` at 2.
    """
    return take_off_m(flight, grid) / flight.climb_mps + ARMING_S


def take_off_m(flight: FlightSettings, grid: Grid) -> float:
    """The height of the search above the launch point, there."""
    if grid.relief is None:
        return flight.altitude_m
    height = float(heights_over(grid.relief, grid.frame.to_metres([grid.launch]), flight)[0])
    return height if math.isfinite(height) else flight.altitude_m


def way_metres(grid: Grid, start: LatLon, end: LatLon) -> FloatArray:
    """The way around what must not be flown over, its start included, in metres of the grid [k, 2]."""
    return grid.frame.to_metres([start, *way_home(grid, start, end)])


def route_seconds(grid: Grid, flight: FlightSettings, start: LatLon, end: LatLon) -> float:
    """Seconds for that way, at the height of the search, with a stop at each bend; over ground with heights it takes
    what its climbs and descents take, where that is longer."""
    motion = motion_of(flight, grid.frame.cell_m)
    points = way_metres(grid, start, end)
    legs = np.hypot(*np.diff(points, axis=0).T)
    seconds = sum(motion.leg_seconds(float(length)) for length in legs)
    if grid.relief is None:
        return seconds
    return seconds + sum(_climbing_s(grid.relief, motion, flight, a, b) for a, b in pairwise(points))


def _climbing_s(
    relief: Relief, motion: Motion, flight: FlightSettings, a: FloatArray, b: FloatArray
) -> float:
    """What a leg's climbs and descents add to it, piece by piece of half a cell at the most."""
    length = math.hypot(*(b - a))
    pieces = max(1, math.ceil(2.0 * length / motion.cell_m))
    heights = heights_over(relief, a + np.linspace(0.0, 1.0, pieces + 1)[:, None] * (b - a), flight)
    upright = motion.upright_s(np.diff(heights[np.isfinite(heights)]))
    return float(np.maximum(upright - length / pieces / motion.speed_mps, 0.0).sum())


def farthest_from_launch(grid: Grid) -> LatLon:
    """The flyable cell that is farthest from the launch point, as the crow flies."""
    cells = grid.frame.to_latlon(np.argwhere(grid.flyable))
    metres = grid.frame.to_metres(cells) - grid.frame.to_metres([grid.launch])[0]
    lat, lon = cells[int(np.hypot(*metres.T).argmax())]
    return float(lat), float(lon)
