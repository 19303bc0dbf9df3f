"""The energy of one flight, kept up to date: what the battery costs, what the wind is, and how far home is."""

from __future__ import annotations

import math
from collections.abc import Callable

from service.config import FlightSettings
from service.geometry import LatLon, Metres, offset_m
from service.mavlink.telemetry import Telemetry, Wind
from service.mission.chart import Chart, here
from service.mission.energy import Consumption, Energy, Level, WayHome, cost_per_s
from service.mission.situation import on_ground
from service.mission.wind import WindFelt

_MOVED_M = 20.0  # the way home is looked for anew after so many metres


class Reserve:
    """Looks at the vehicle whenever `update` is called, several times a second."""

    def __init__(
        self, chart: Chart, flight: FlightSettings, highest_m: Callable[[list[LatLon]], float] | None = None
    ) -> None:
        """`highest_m`: how high above home a way through points is flown by us."""
        self._chart, self._flight, self._highest_m = chart, flight, highest_m
        self._return_m = flight.return_height_m
        self._consumption, self._wind, self._level = Consumption(), WindFelt(flight), Level()
        self._route: list[LatLon] = []
        self._routed_from = self._routed_to = (math.inf, math.inf)
        self.energy = Energy(None, None, WayHome(0.0, 0.0, 0.0))
        self.wind: Wind | None = None
        """As told, else as reckoned; None while it is not known."""

    def update(
        self,
        t: Telemetry,
        now: float,
        *,
        under_way: bool,
        waits_s: float = 0.0,
        speed_mps: float | None = None,
    ) -> None:
        """Take in what the vehicle tells now; nothing on the ground, and the battery alone while the position is
        not known. `waits_s`: how long it may have to wait over home for others to land; `speed_mps`: how fast it flies
        there, None: as asked."""
        if on_ground(t):
            return
        if t.battery_percent is not None:
            self._consumption.update(t.battery_percent, now)
        rate, home = self._consumption.percent_per_s, self.energy.home
        percent = self._level.update(t.battery_percent, cost_per_s(rate, self._flight), now)
        if t.position_known and t.landed_state == "in_air":
            self.wind = self._wind.update(t, under_way, now)
        if t.position_known:  # whatever it says of the ground: what is armed may fly
            way, up_m = self._way(t), t.alt_home_m
            home = WayHome.along(way, up_m, self.wind, self._flight, self._return_m, speed_mps)
            home = home.waiting(waits_s)
        level, doubt = percent, self._level.doubt
        if told := t.battery_percent is not None and not doubt:
            level = self._consumption.level(t.battery_percent, now)
        self.energy = Energy(percent, rate, home, told, t.battery_state, level, self.wind, doubt, speed_mps)

    def forget_way(self) -> None:
        """Other ground is excluded now: the way home may lead elsewhere."""
        self._route = []

    def _way(self, t: Telemetry) -> list[Metres]:
        """From here home around the exclusions, as (east, north) of here in metres."""
        (lat, lon), home = here(t), self._chart.home(t)
        moved = self._chart.distance((lat, lon), self._routed_from) > _MOVED_M
        if not self._route or home != self._routed_to or moved:
            self._route, self._routed_from, self._routed_to = (
                self._chart.route((lat, lon), home),
                (lat, lon),
                home,
            )
            if self._highest_m is not None:
                ours = self._highest_m([(lat, lon), *self._route])
                self._return_m = max(ours, self._flight.return_height_m)
        return [offset_m((lat, lon), to) for to in ((lat, lon), *self._route)]
