"""The energy of one flight, kept up to date: what the battery costs, what the wind is, and how far home is."""

from __future__ import annotations

import math

from service.clock import Clock
from service.config import FlightSettings
from service.mission.energy import Consumption, Energy, Metres, WayHome, WindFelt
from service.mission.flight import LatLon
from service.mission.helm import Helm

_METRES_PER_DEGREE = 111_194.93
_MOVED_M = 20.0  # the way home is looked for anew after so many metres


class Homeward:
    """Looks at the vehicle whenever `update` is called, several times a second."""

    def __init__(self, helm: Helm, clock: Clock, flight: FlightSettings) -> None:
        self._helm, self._clock, self._flight = helm, clock, flight
        self._consumption, self._wind = Consumption(), WindFelt(flight)
        self._route: list[LatLon] = []
        self._routed_from: LatLon = (math.inf, math.inf)
        self.energy = Energy(None, None, WayHome(0.0, 0.0, 0.0))

    def update(self) -> None:
        """Take in what the vehicle tells now; nothing on the ground, or while the position is not known."""
        t, now = self._helm.vehicle.telemetry, self._clock.now()
        if t.landed_state != "in_air" or not t.position_known:
            return
        if t.battery_percent is not None:
            self._consumption.update(t.battery_percent, now)
        north, east, _ = t.velocity_ned_mps
        wind = self._wind.update(t.wind, (east, north), self._helm.under_way(), now)
        home = WayHome.along(self._way(), t.alt_home_m, wind, self._flight)
        self.energy = Energy(t.battery_percent, self._consumption.percent_per_s, home)

    def _way(self) -> list[Metres]:
        """From here home around the exclusions, as (east, north) of here in metres."""
        here = self._helm.here()
        if not self._route or self._helm.distance(here, self._routed_from) > _MOVED_M:
            self._route, self._routed_from = self._helm.route(self._helm.home()), here
        narrowing = math.cos(math.radians(here[0]))
        return [
            ((lon - here[1]) * narrowing * _METRES_PER_DEGREE, (lat - here[0]) * _METRES_PER_DEGREE)
            for lat, lon in (here, *self._route)
        ]
