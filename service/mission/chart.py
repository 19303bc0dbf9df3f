"""Where things are: from what the telemetry says to cells, metres and ways around what must not be flown over. Pure."""

from __future__ import annotations

import logging
import math
from collections.abc import Sequence
from functools import lru_cache

import numpy as np
import shapely

from roisearch.directions import DIRECTIONS
from service.area import Grid, leads_out, leg_is_clear, way_home
from service.errors import BadInput
from service.geometry import Cell, LatLon, Metres
from service.mavlink.telemetry import Telemetry
from service.mission.fence import Fence
from service.places import written

log = logging.getLogger("roisearch")
GOES_MPS = 1.0
"""Slower than this it goes nowhere: the direction of so small a speed is noise."""
_PLACES = 64


def here(t: Telemetry) -> LatLon:
    """The aircraft's position in degrees, as last told."""
    return t.lat, t.lon


class Chart:
    """One grid, and what is asked of it in flight."""

    def __init__(self, grid: Grid) -> None:
        self.grid, self.frame = grid, grid.frame
        self._metres = lru_cache(_PLACES)(self._on_the_plane)

    def take(self, grid: Grid) -> None:
        """Other ground is excluded now; the cells are the same."""
        self.grid = grid

    def home(self, t: Telemetry) -> LatLon:
        """Where the autopilot lands: its home in degrees as told, else the launch point of the area."""
        return self.grid.launch if t.home is None else (t.home.lat, t.home.lon)

    def fence(self, home: LatLon, margin_m: float) -> Fence:
        """The fence of a search that starts and lands at the launch point or at `home`."""
        bases = [self.metres(self.grid.launch), self.metres(home)]
        return Fence.around(
            self.grid.outline, bases, self.grid.keep_out.zone.shape, self.frame.cell_m, margin_m
        )

    def cell(self, t: Telemetry) -> tuple[Cell, bool]:
        """The cell under the aircraft (the nearest one when it is off the grid), and whether it is on it."""
        cells, inside = self.frame.locate(np.array([here(t)]))
        return (int(cells[0, 0]), int(cells[0, 1])), bool(inside[0])

    def written(self, point: LatLon) -> str:
        """A position as the team writes places."""
        return written(point, self.grid.coordinates)

    def heading(self, t: Telemetry) -> str:
        """Where it goes, in the grid's eight directions; where its nose points while it goes nowhere, or that is
        not known; north while nothing is known."""
        north, east, _ = t.velocity_ned_mps
        heading = t.heading_deg
        if math.hypot(north, east) >= GOES_MPS or not math.isfinite(heading):
            heading = math.degrees(math.atan2(east, north))
        if not math.isfinite(heading):
            return DIRECTIONS[0]
        return DIRECTIONS[round(((heading - self.frame.bearing_deg) % 360.0) / 45.0) % 8]

    def latlon(self, cell: tuple[float, float]) -> LatLon:
        """The centre of a cell in degrees, or another point of the grid, in rows and columns."""
        return self.latlons([cell])[0]

    def latlons(self, cells: Sequence[tuple[float, float]]) -> list[LatLon]:
        """The same of several; many cost as little as one."""
        return [(float(lat), float(lon)) for lat, lon in self.frame.to_latlon(np.array(cells))]

    def metres(self, point: LatLon) -> Metres:
        """A position on the plane of the grid: (east, south). The last ones are kept: in each moment many ask where the
        aircraft and its home are."""
        return self._metres(point)

    def place(self, point: LatLon) -> tuple[float, float]:
        """A position in rows and columns; the middle of a cell has whole ones."""
        east, south = self.metres(point)
        return south / self.frame.cell_m - 0.5, east / self.frame.cell_m - 0.5

    def distance(self, start: LatLon, end: LatLon) -> float:
        """Metres between two positions."""
        return math.dist(self.metres(start), self.metres(end))

    def leg_allowed(self, start: LatLon, end: LatLon) -> bool:
        """Clear of every exclusion, or the straight way out of the one the aircraft has drifted into."""
        return leg_is_clear(self.grid, start, end) or leads_out(self.grid, start, end)

    def too_near(self, point: LatLon) -> bool:
        """Over an exclusion, or within its clearance, where no leg of the search may begin."""
        return bool(shapely.intersects_xy(self.grid.keep_out.zone.prepared, *self.metres(point)))

    def excluded(self, point: LatLon) -> bool:
        """Over an exclusion."""
        return bool(shapely.contains_xy(self.grid.keep_out.core.prepared, *self.metres(point)))

    def refuse_over_home(self, excluded: shapely.Geometry | None, t: Telemetry, name: str = "") -> None:
        """Raises BadInput where ground that is to be excluded (in degrees, x = longitude) has home in it, or nearer to
        it than legs may come: no way would lead home. `name`: the aircraft's, where there are several."""
        home, least = self.home(t), self.grid.clearance_m
        if excluded is None:
            return
        metres = shapely.distance(self.frame.flatten(excluded), shapely.Point(self.metres(home)))
        if metres < least:
            lies = f"lies {metres:.0f} m from it, less than {least:g} m" if metres else "lies in it"
            whose = f"the home of aircraft {name}" if name else "the aircraft's home"
            raise BadInput(f"the exclusion: {whose}, {self.written(home)}, {lies}; move one of the two")

    def route(self, start: LatLon, goal: LatLon) -> list[LatLon]:
        """The way to `goal` around the exclusions; straight there when they leave none."""
        try:
            return way_home(self.grid, start, goal)
        except BadInput as error:
            log.warning("%s", error)
            return [goal]

    def _on_the_plane(self, point: LatLon) -> Metres:
        east, south = self.frame.to_metres(np.array([point]))[0]
        return float(east), float(south)
