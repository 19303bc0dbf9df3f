"""Is there enough in the battery for the way home? Pure: telemetry's numbers and the time go in, sentences come out.

What the way home needs is its time times what a second in the air has cost so far. The time is that of climbing to the
height at which the autopilot returns, of the way around the exclusions at the speed that the wind leaves, and of the
descent. The cost is measured: the battery's percent, as they fell, over the seconds in which they fell.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from service.config import FlightSettings
from service.mavlink.telemetry import Wind

Metres = tuple[float, float]
"""(east, north)."""

_RECENT = 6  # falls of the battery's percent that count as 'of late'
_FEWEST = 2  # falls that are needed to say anything
_CORRECTION_PERCENT = 5.0  # a fall by more at once is the autopilot correcting itself, not consumption
_STEADY_MPS, _STEADY_S = 0.7, 4.0
_FELT_FOR_S = 300.0
_SLOWEST_MPS = 0.5  # slower over ground counts as not getting home at all


class Consumption:
    """What a second in the air costs, in percent of the battery.

    A battery tells whole percents, so only the moments at which they fall are exact. The dearer of the whole flight
    and of the last few percents counts: it may have become colder, windier or steeper.
    """

    def __init__(self) -> None:
        self._falls: deque[tuple[float, float]] = deque(maxlen=_RECENT)  # time, percent just reached
        self._first: tuple[float, float] | None = None
        self._last_percent = math.nan
        self._rate: float | None = None

    def update(self, percent: float, now: float) -> None:
        """Take the battery's percent in, at a time in seconds, while in the air."""
        last, self._last_percent = self._last_percent, percent
        if not percent < last:
            if percent > last:  # a new battery, or a correction upwards: measure anew
                self._falls.clear()
                self._first = None
            return
        if last - percent > _CORRECTION_PERCENT:
            self._falls.clear()
            self._first = None
            return
        self._falls.append((now, percent))
        if self._first is None:
            self._first = now, percent
        self._rate = self._measured() or self._rate

    def _measured(self) -> float | None:
        if len(self._falls) <= _FEWEST or self._first is None:
            return None
        until, left = self._falls[-1]
        rates = [
            (had - left) / (until - since) for since, had in (self._first, self._falls[0]) if until > since
        ]
        return max(rates, default=None)

    @property
    def percent_per_s(self) -> float | None:
        """Percent of the battery a second; None while too little of it was used to say."""
        return self._rate


def speed_over_ground(leg: Metres, wind: Wind | None, flight: FlightSettings) -> float:
    """Metres a second that the aircraft makes good along a leg (its vector in metres) in a wind.

    It flies at `flight.speed_mps` over ground where it can, and through the air never faster than
    `flight.max_airspeed_mps`: of that, the part that keeps it on the leg against a wind from the side is lost.
    """
    length = math.hypot(*leg)
    if wind is None or length == 0.0:
        return flight.speed_mps
    east, north = leg[0] / length, leg[1] / length
    along = wind.east_mps * east + wind.north_mps * north
    across = wind.east_mps * north - wind.north_mps * east
    ahead = math.sqrt(max(flight.max_airspeed_mps**2 - across**2, 0.0))
    return min(flight.speed_mps, ahead + along)


class WindFelt:
    """The wind as the autopilot tells it, else as the speed that is missing says.

    An aircraft that is under way, steadily, and slower over ground than it should be flies as fast through the air as
    it can: the wind against it is what is missing to `flight.max_airspeed_mps`. That is kept for a while.
    """

    def __init__(self, flight: FlightSettings) -> None:
        self._flight = flight
        self._felt: Wind | None = None
        self._felt_at = self._steady_since = -math.inf
        self._speed = math.nan

    def update(self, told: Wind | None, velocity: Metres, under_way: bool, now: float) -> Wind | None:
        """Take one moment in: the wind told, the velocity (east, north) over ground in m/s, and whether the aircraft
        is too far from its waypoint to brake for it. Returns the wind to reckon with; None: there is none."""
        if told is not None:
            return told
        speed = math.hypot(*velocity)
        if not under_way or not abs(speed - self._speed) < _STEADY_MPS:
            self._speed, self._steady_since = speed, now if under_way else math.inf
        elif now - self._steady_since >= _STEADY_S and speed > _SLOWEST_MPS:
            missing = self._flight.max_airspeed_mps - speed
            if speed < self._flight.speed_mps - 1.0 and missing > 0.0:
                east, north = velocity[0] / speed, velocity[1] / speed
                self._felt, self._felt_at = Wind(-missing * north, -missing * east), now
        if now - self._felt_at > _FELT_FOR_S:
            self._felt = None
        return self._felt


@dataclass(frozen=True, slots=True)
class WayHome:
    """What is left to fly: metres over ground, seconds until on the ground, and the wind against it (m/s, 0: none)."""

    length_m: float
    seconds: float
    against_mps: float

    @classmethod
    def along(
        cls, points: Sequence[Metres], height_m: float, wind: Wind | None, flight: FlightSettings
    ) -> WayHome:
        """The way through points (here first, home last), from a height above home in metres.

        Its seconds are infinite when the wind does not let the aircraft get there.
        """
        length = seconds = head = 0.0
        for here, there in pairwise(points):
            leg = (there[0] - here[0], there[1] - here[1])
            metres = math.hypot(*leg)
            speed = speed_over_ground(leg, wind, flight)
            seconds += metres / speed if speed >= _SLOWEST_MPS else (math.inf if metres > 0 else 0.0)
            length += metres
            if wind is not None and metres > 0:
                head -= wind.east_mps * leg[0] + wind.north_mps * leg[1]
        climb = max(0.0, flight.return_height_m - height_m)
        descent = max(flight.return_height_m, height_m)
        seconds += climb / flight.climb_mps + descent / flight.descent_mps
        return cls(length, seconds, max(0.0, head / length) if length > 0 else 0.0)


@dataclass(frozen=True, slots=True)
class Energy:
    """The battery (percent), what a second costs (percent; None: not known yet), and the way home."""

    percent: float | None
    percent_per_s: float | None
    home: WayHome

    def needed(self) -> float | None:
        """Percent of the battery that the way home needs; None while that is not known."""
        return None if self.percent_per_s is None else self.percent_per_s * self.home.seconds

    def seconds_left(self, flight: FlightSettings) -> float | None:
        """How long the search can go on before the way home must begin, in seconds; None while not known."""
        needed = self.needed()
        if self.percent is None or needed is None or not self.percent_per_s:
            return None
        kept = max(needed + flight.reserve_percent, flight.min_battery_percent)
        return max(0.0, (self.percent - kept) / self.percent_per_s)

    def objection(self, flown_s: float, flight: FlightSettings) -> str:
        """Why the aircraft must fly home now, or nothing; it has been in the air for `flown_s` seconds."""
        if flown_s >= flight.max_flight_s:
            return f"{flown_s:.0f} s in the air"
        if self.percent is None:
            return ""
        if self.percent <= flight.min_battery_percent:
            return f"battery at {self.percent:.0f} %"
        needed = self.needed()
        if needed is None or self.percent > needed + flight.reserve_percent:
            return ""
        way = f"the way home, {self.home.length_m:.0f} m"
        if self.home.against_mps >= 0.5:
            way += f" against {self.home.against_mps:.0f} m/s of wind"
        if math.isinf(needed):
            return f"battery {self.percent:.0f} %: {way}, cannot be flown in this wind"
        return f"battery {self.percent:.0f} %: {way}, needs {needed:.0f} % and {flight.reserve_percent:g} % are kept"
