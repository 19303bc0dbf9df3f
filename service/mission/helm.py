"""The helm: where the aircraft is, and the one place where a waypoint leaves for it, after every check."""

from __future__ import annotations

import logging
import math
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass

import numpy as np
import shapely

from service.area import Grid, leads_out, leg_is_clear, way_home
from service.clock import Clock
from service.config import Settings
from service.errors import BadInput
from service.evidence.observe import grid_heading
from service.mavlink import LinkError, Vehicle
from service.mission.fence import Fence, Straying, height_objection
from service.mission.flight import LatLon
from service.mission.limits import Lasting, PositionTrust, Progress, wind_objection
from service.mission.navigator import Cell

log = logging.getLogger("roisearch")
TICK_S, RETRY_S = 0.1, 1.0  # how often a mission looks at things, and after what it tries again
LEAST_PATIENCE_WALL_S = 1.5
WINDY_S = 5.0
STRAYED_S = 2.0


@dataclass(frozen=True, slots=True)
class NotSent:
    """Why something was not sent; `cause` is what must pass first: "position", "limits", "link" or "state"."""

    cause: str
    reason: str


class Helm:
    """Sends waypoints and holds for one mission.

    Args:
        may_move: whether the mission's state allows motion now; asked again right before sending.
        write: writes a row to the journal and returns once it is on disk.
    """

    def __init__(
        self,
        settings: Settings,
        clock: Clock,
        grid: Grid,
        vehicle: Vehicle,
        *,
        may_move: Callable[[], bool],
        write: Callable[[str, Mapping[str, object]], Awaitable[None]],
    ) -> None:
        self.settings, self.clock, self.grid, self.vehicle = settings, clock, grid, vehicle
        self.frame = grid.frame
        self.altitude_m = 0.0  # of every waypoint, above sea level; known once home is
        flight = settings.flight
        self.trust = PositionTrust(flight, vehicle.settings.position_fresh_s)
        patience = max(flight.stuck_after_s, LEAST_PATIENCE_WALL_S * clock.speedup)
        self._progress = Progress(patience, max(flight.corner_m, 0.3 * self.frame.cell_m))
        self._windy = Lasting(WINDY_S)
        self._strayed, self._straying = Lasting(STRAYED_S), Straying()
        self._target: LatLon | None = None
        self._on_way = False  # the last waypoint was one of the way to the area or home
        self._may_move, self._write = may_move, write

    def begin(self) -> None:
        """The vehicle is there, and so is its home: height and fence follow from it."""
        telemetry, flight, grid = self.vehicle.telemetry, self.settings.flight, self.grid
        self.altitude_m = telemetry.home_alt_amsl_m + flight.altitude_m
        bases = [self._metres(grid.launch), self._metres(self.home())]
        zone, cell_m = grid.keep_out.zone, self.frame.cell_m
        self._fence = Fence.around(grid.outline, bases, zone, cell_m, flight.margin_m)

    # ---- sending -----------------------------------------------------------------------------------------

    async def send(self, point: LatLon, *, on_way: bool = False) -> NotSent | None:
        """Send the aircraft to a point, if nothing speaks against it; else says what does.

        `on_way`: the point is one of the way to the area or home, and not of the search.
        """
        if (objection := self.objection(point, on_way=on_way)) is not None:
            return objection
        body = {"command": "reposition", "lat": point[0], "lon": point[1], "alt_amsl_m": self.altitude_m}
        await self._write("command", body)
        if (
            objection := self.objection(point, on_way=on_way)
        ) is not None:  # something happened while the row was written
            return objection
        try:
            self.vehicle.reposition(point[0], point[1], self.altitude_m)
        except LinkError as error:
            return NotSent("link", str(error))
        if self._target is None or self.distance(self._target, point) > 1.0:
            self._progress.clear()
        self._target, self._on_way = point, on_way
        return None

    async def hover(self, *, wanted: Callable[[], bool]) -> NotSent | None:
        """Stop here, if that is still `wanted` when it is sent."""
        if not wanted():
            return NotSent("state", "the mission is not to hold any more")
        if doubts := self.doubts():
            self.rest()
            return NotSent("position", "; ".join(doubts))
        await self._write("command", {"command": "hold"})
        return self.stop() if wanted() else NotSent("state", "the mission is not to hold any more")

    def stop(self) -> NotSent | None:
        """Stop here, now. A stop is a waypoint too: none is sent while the position is not trusted."""
        self.rest()
        if doubts := self.doubts():
            return NotSent("position", "; ".join(doubts))
        try:
            self.vehicle.hold()
        except LinkError as error:
            return NotSent("link", str(error))
        return None

    def rest(self) -> None:
        """No waypoint is being flown any more, nor sent again."""
        self.vehicle.stand_by("the mission wants something else now")
        self._target = None
        self._progress.clear()
        self._straying.forget()

    # ---- checks ------------------------------------------------------------------------------------------

    def doubts(self) -> list[str]:
        """Why the position is not to be trusted now."""
        return self.trust.update(self.vehicle.telemetry, self.clock.now())

    def objection(self, point: LatLon, *, on_way: bool) -> NotSent | None:
        """Why a waypoint must not be sent now, or nothing."""
        if not self._may_move():
            return NotSent("state", "the mission is not to move the aircraft")
        if doubts := self.doubts():
            return NotSent("position", "; ".join(doubts))
        where = f"the waypoint {point[0]:.6f}, {point[1]:.6f}"
        if not self._leg_allowed(point):
            return NotSent("limits", f"{where} lies behind an excluded area")
        if outside := self._fence.leg_objection(
            self._metres(self.here()), self._metres(point), on_way=on_way
        ):
            return NotSent("limits", f"{where} {outside}")
        if height := height_objection(
            self.altitude_m - self.vehicle.telemetry.home_alt_amsl_m, self.settings.flight
        ):
            return NotSent("limits", f"{where} is {height}")
        limit = self.settings.flight.max_launch_distance_m
        if self.distance(self.grid.launch, point) > limit:
            return NotSent("limits", f"{where} is more than {limit:g} m from the launch point")
        return None

    def _leg_allowed(self, point: LatLon) -> bool:
        """Clear of every exclusion, or the straight way out of the one the aircraft has drifted into."""
        here = self.here()
        return leg_is_clear(self.grid, here, point) or leads_out(self.grid, here, point)

    def too_near(self) -> bool:
        """Over an exclusion, or within its clearance, where no leg of the search may begin."""
        return bool(shapely.intersects_xy(self.grid.keep_out.zone, *self._metres(self.here())))

    def trouble(self, *, moving: bool) -> NotSent | None:
        """What stands against flying on while the autopilot follows our waypoints, or nothing."""
        doubts = self.doubts()
        if not self.vehicle.telemetry.guided:
            return None
        if doubts:
            return NotSent("position", "; ".join(doubts))
        if moving and self._target is not None:
            stuck = self._progress.stuck(self.distance(self.here(), self._target), self.clock.now())
            return NotSent("progress", stuck) if stuck else None
        return None

    def too_windy(self) -> str:
        """Why the wind is too much, once it has lasted, or nothing."""
        objection = wind_objection(self.vehicle.telemetry, self.settings.flight)
        return self._windy.after(objection, self.clock.now())

    def strayed(self) -> str:
        """Why the aircraft is where it must not be, after it has been where it may, once that has lasted."""
        here, telemetry = self._metres(self.here()), self.vehicle.telemetry
        objection = height_objection(telemetry.alt_home_m, self.settings.flight)
        if away := self._fence.outside_m(here, on_way=self._on_way):
            objection = f"{away:.0f} m outside {self._fence.name(on_way=self._on_way)}"
        elif shapely.contains_xy(self.grid.keep_out.core, *here):
            objection = "over an excluded area"
        strayed = self._straying.read(objection)
        return self._strayed.after(f"the aircraft is {strayed}" if strayed else "", self.clock.now())

    def route(self, goal: LatLon) -> list[LatLon]:
        """The way from here to `goal` around the exclusions; straight there when they leave none."""
        try:
            return way_home(self.grid, self.here(), goal)
        except BadInput as error:
            log.warning("%s", error)
            return [goal]

    def heard(self) -> bool:
        """A heartbeat has come lately."""
        age = self.clock.now() - self.vehicle.telemetry.heartbeat_time
        return age < self.vehicle.settings.heartbeat_fresh_s

    # ---- where things are --------------------------------------------------------------------------------

    def here(self) -> LatLon:
        """The aircraft's position in degrees, as last told."""
        telemetry = self.vehicle.telemetry
        return telemetry.lat, telemetry.lon

    def home(self) -> LatLon:
        """Where the autopilot lands: its home in degrees as told, else the launch point of the area."""
        home = self.vehicle.telemetry.home
        return self.grid.launch if home is None else (home.lat, home.lon)

    def under_way(self) -> bool:
        """It flies to a waypoint, and is too far from it to brake for it."""
        flight = self.settings.flight
        braking = flight.speed_mps**2 / (2.0 * flight.deceleration_mps2) + flight.speed_mps
        return self._target is not None and self.distance(self.here(), self._target) > braking

    def cell(self) -> tuple[Cell, bool]:
        """The cell under the aircraft (the nearest one when it is off the grid), and whether it is on it."""
        cells, inside = self.frame.locate(np.array([self.here()]))
        return (int(cells[0, 0]), int(cells[0, 1])), bool(inside[0])

    def heading(self) -> str:
        """Where its nose points, in the grid's directions."""
        return grid_heading(self.vehicle.telemetry.heading_deg, self.frame.bearing_deg)

    def latlon(self, cell: Cell) -> LatLon:
        """The centre of a cell in degrees."""
        lat, lon = self.frame.to_latlon(np.array([cell]))[0]
        return float(lat), float(lon)

    def distance(self, here: LatLon, there: LatLon) -> float:
        """Metres between two positions."""
        (east, south), (east2, south2) = self.frame.to_metres(np.array([here, there]))
        return math.hypot(east2 - east, south2 - south)

    def _metres(self, point: LatLon) -> tuple[float, float]:
        east, south = self.frame.to_metres(np.array([point]))[0]
        return float(east), float(south)

    def metres_to(self, cell: Cell) -> float:
        """Metres from the aircraft to the centre of a cell."""
        return self.distance(self.here(), self.latlon(cell))

    def hovering(self) -> bool:
        """In the air, armed, in the guided mode."""
        telemetry = self.vehicle.telemetry
        return telemetry.landed_state == "in_air" and telemetry.guided and telemetry.armed

    def on_ground(self) -> bool:
        """On the ground with the motors off."""
        return not self.vehicle.telemetry.armed and self.vehicle.telemetry.landed_state == "on_ground"
