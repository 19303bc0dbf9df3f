"""How far the battery reaches: what the way home takes from every cell, as the flight reckons it."""

from __future__ import annotations

import math
import threading
from concurrent.futures import Future
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from roisearch.endurance import Endurance
from service.area import Grid, way_home
from service.config import FlightSettings
from service.errors import BadInput
from service.geometry import LatLon, distance_m, offset_m
from service.ground.flown import flown_heights, highest_along
from service.mission.energy import Left, legs_seconds

SAME_HOME_M = 5.0
"""A home that has moved less is the same: what it takes from there differs by less than a second, and
`Energy.objection` has the last word."""


class WaysHome(NamedTuple):
    """The ways from all cells to one home: `legs` (east, north) in metres [n, 2], each of the cell in `owners` [n], and
    the cells from which none leads around what is excluded. `upright_s` [cells] is what climb and descent take; none
    where the ground is taken as flat, for they are the same from everywhere."""

    home: LatLon
    owners: NDArray[np.int64]
    legs: NDArray[np.float64]
    none: NDArray[np.int64]
    upright_s: NDArray[np.float64]


class Reach:
    """The ways home over one grid; those to one home are looked for once, which takes minutes on a large map with
    exclusions."""

    def __init__(self, grid: Grid, flight: FlightSettings) -> None:
        self._grid, self._flight = grid, flight
        self._ways: WaysHome | None = None
        self._looking: Future[WaysHome] | None = None

    def knows(self, home: LatLon) -> bool:
        """Whether the ways to this home are known; if not, they are looked for in a thread from now on."""
        if self._looking is not None and self._looking.done():
            self._ways, self._looking = self._looking.result(), None
        if self._ways is not None and distance_m(self._ways.home, home) < SAME_HOME_M:
            return True
        if self._looking is None:
            self._looking = Future()
            work = (home, self._looking)
            threading.Thread(target=self._look, args=work, name="ways home", daemon=True).start()
        return False

    def _look(self, home: LatLon, looking: Future[WaysHome]) -> None:
        try:
            looking.set_result(self._find_ways(home))
        except Exception as error:
            looking.set_exception(error)

    def endurance(self, left: Left) -> Endurance:
        """What a battery leaves for planning: no cell is entered later than `Energy.objection` lets it be.

        Where the ways home are not known yet it looks for them, and waits.
        """
        return Endurance(left.ground_s, np.maximum(self.home_s(left), left.ground_s - left.search_s))

    def home_s(self, left: Left) -> NDArray[np.float64]:
        """Seconds home from each cell, landing included, float [rows, cols]; infinite where no way leads around what
        is excluded."""
        if not self.knows(left.home):
            assert self._looking is not None
            self._ways, self._looking = self._looking.result(), None
            if not self.knows(left.home):  # it was looking for those to another
                return self.home_s(left)
        ways = self._ways
        assert ways is not None
        rows, cols = self._grid.frame.shape
        seconds = np.bincount(
            ways.owners, legs_seconds(ways.legs, left.wind, self._flight, left.speed_mps), rows * cols
        )
        seconds[ways.none] = np.inf
        upright = ways.upright_s if ways.upright_s.size else left.upright_s
        return np.asarray((seconds + upright).reshape(rows, cols))

    def _find_ways(self, home: LatLon) -> WaysHome:
        """The legs of the way from each cell: straight, or around the exclusions."""
        frame = self._grid.frame
        cells = frame.to_latlon(np.argwhere(np.ones(frame.shape, dtype=bool)))
        clear = self._grid.keep_out.clear(frame.to_metres([home])[0], frame.to_metres(cells))
        owners, legs, none = [np.flatnonzero(clear)], [_legs(cells[clear], home)], []
        routes = {cell: [home] for cell in owners[0].tolist()}
        for cell in np.flatnonzero(~clear & self._grid.flyable.ravel()).tolist():
            here = (float(cells[cell, 0]), float(cells[cell, 1]))
            try:
                points = [here, *way_home(self._grid, here, home)]
            except BadInput:
                none.append(cell)
                continue
            routes[cell] = points[1:]
            parts = [offset_m(a, b) for a, b in pairwise(points)]
            owners.append(np.full(len(parts), cell))
            legs.append(np.array(parts).reshape(-1, 2))
        upright = self._upright_s(home, routes)
        return WaysHome(
            home, np.concatenate(owners), np.concatenate(legs), np.array(none, dtype=np.int64), upright
        )

    def _upright_s(self, home: LatLon, routes: dict[int, list[LatLon]]) -> NDArray[np.float64]:
        """Seconds up to the height at which the way home is flown, and down from it, for each cell that has a way."""
        relief, frame, flight = self._grid.relief, self._grid.frame, self._flight
        heights = flown_heights(self._grid, flight)
        if relief is None or heights is None:
            return np.zeros(0)
        there = frame.to_metres([home])[0]
        base = float(relief.height_at(there[None, :])[0])
        seconds = np.zeros(heights.size)
        for cell, route in routes.items():
            row, col = divmod(cell, frame.cols)
            way = [((col + 0.5) * frame.cell_m, (row + 0.5) * frame.cell_m)]
            way += [(float(east), float(south)) for east, south in frame.to_metres(route)]
            up = float(heights[row, col]) - base
            top = max(
                up, flight.altitude_m, flight.return_height_m, highest_along(relief, way, flight) - base
            )
            if math.isfinite(top):
                seconds[cell] = (top - up) / flight.climb_mps + top / flight.descent_mps
            else:
                seconds[cell] = math.inf
        return seconds


def _legs(cells: NDArray[np.float64], home: LatLon) -> NDArray[np.float64]:
    """Straight from each cell, (latitude, longitude) [n, 2], to home: (east, north) in metres [n, 2]."""
    return np.array([offset_m((lat, lon), home) for lat, lon in cells.tolist()]).reshape(-1, 2)
