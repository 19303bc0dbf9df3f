"""Is there enough in the battery for the way home? Pure: telemetry's numbers and the time go in, sentences come out.

What the way home needs is its time times what a second in the air has cost so far. The time is that of climbing to the
height at which the autopilot returns, of the way around the exclusions at the speed that the wind leaves, and of the
descent. The cost is measured: the battery's percent, as they fell, over the seconds in which they fell.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from roisearch.motion import leg_seconds
from service.config import FlightSettings
from service.geometry import LatLon, Metres
from service.mavlink.telemetry import Telemetry, Wind

_RECENT = 6  # falls of the battery's percent that count as 'of late'
_FEWEST = 2  # falls that are needed to say anything
_CORRECTION_PERCENT = 5.0  # a fall by more at once is the autopilot correcting itself, not consumption
_SLOWEST_MPS = 0.5  # slower over ground counts as not getting home at all


_WORN = frozenset({"low", "critical", "emergency", "failed", "unhealthy"})
_STUCK_PERCENT = 10.0  # a level that stands still while so much is used is no level
_RISE_PERCENT = 10.0  # nor is one that has risen by more, in flight
_TAKEN_BACK_S = 10.0  # for so long after a fall all at once it may have been a single wrong word
_LANDING_PERCENT = 3.0  # is left, beyond what a landing takes, when one begins that is not at home
_FIRST_WORD_S = 15.0  # so long after the first look the battery may not have been told yet


class Level:
    """The battery's level, counted down while nobody tells it, or what is told stands still."""

    def __init__(self) -> None:
        self._percent: float | None = None
        self._at = self._since = 0.0
        self._fell_from, self._fell_at = 0.0, -math.inf
        self.doubt = ""
        """Why what is told cannot be true: it has stood still for too long, or has risen; as the end of a sentence."""

    def update(self, told: float | None, percent_per_s: float, now: float) -> float | None:
        """Take in what is told (None: nothing) at a time in seconds; returns the level to reckon with, in percent.

        Untold, it is the last one told, less what `percent_per_s` has cost since; None while it never was. One that has
        not changed while `percent_per_s` has cost `_STUCK_PERCENT` is what it was when it was told first, less that.
        Nor is one believed that is higher by more than `_RISE_PERCENT` than the last: no battery is charged in flight.
        """
        before = self._percent
        if told is not None and before is not None and before - told > _CORRECTION_PERCENT:
            self._fell_from, self._fell_at = before, now
        if (
            told is not None
            and now - self._fell_at <= _TAKEN_BACK_S
            and told <= self._fell_from + _RISE_PERCENT
        ):
            before = self._fell_from  # of a fall all at once that is taken back no more is believed
        rises = told is not None and before is not None and told > before + _RISE_PERCENT
        believed = None if rises else told
        if believed is not None and believed != self._percent:
            self._percent, self._since = believed, now
        used = percent_per_s * (now - self._since)
        stuck = believed is not None and used > _STUCK_PERCENT
        self.doubt = "has risen in flight" if rises else "stands still" if stuck else ""
        if believed is not None:
            self._at = self._since if stuck else now
        if self._percent is None:
            return None
        return max(0.0, self._percent - percent_per_s * (now - self._at))


def cost_per_s(measured: float | None, flight: FlightSettings) -> float:
    """What a second in the air costs, in percent: as measured, else as a full battery is said to last."""
    return 100.0 / flight.full_battery_s if measured is None else measured


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

    def level(self, percent: float, now: float) -> float:
        """The level between two whole percents, reckoned down since it fell to the one that is told, in percent."""
        if not self._falls or self._rate is None or self._falls[-1][1] != percent:
            return percent
        return max(percent - 1.0, percent - self._rate * (now - self._falls[-1][0]))

    @property
    def percent_per_s(self) -> float | None:
        """Percent of the battery a second; None while too little of it was used to say."""
        return self._rate


def speed_over_ground(
    leg: Metres, wind: Wind | None, flight: FlightSettings, speed_mps: float | None = None
) -> float:
    """Metres a second that the aircraft makes good along a leg (its vector in metres) in a wind.

    It flies at `speed_mps` over ground where it can, None: at `flight.speed_mps`; and through the air never faster than
    `flight.max_airspeed_mps`: of that, the part that keeps it on the leg against a wind from the side is lost.
    """
    calm = flight.speed_mps if speed_mps is None else speed_mps
    length = math.hypot(*leg)
    if wind is None or length == 0.0:
        return calm
    east, north = leg[0] / length, leg[1] / length
    along = wind.east_mps * east + wind.north_mps * north
    across = wind.east_mps * north - wind.north_mps * east
    ahead = math.sqrt(max(flight.max_airspeed_mps**2 - across**2, 0.0))
    return min(calm, ahead + along)


def legs_seconds(
    legs: NDArray[np.float64], wind: Wind | None, flight: FlightSettings, speed_mps: float | None = None
) -> NDArray[np.float64]:
    """Seconds for each of many legs, (east, north) in metres [n, 2], as `WayHome.along` reckons them, float [n]."""
    length = np.hypot(*legs.T)
    speed = np.full(len(legs), flight.speed_mps if speed_mps is None else speed_mps)
    if wind is not None:
        east, north = legs.T / np.maximum(length, 1e-9)
        along, across = (
            wind.east_mps * east + wind.north_mps * north,
            wind.east_mps * north - wind.north_mps * east,
        )
        speed = np.minimum(speed, np.sqrt(np.maximum(flight.max_airspeed_mps**2 - across**2, 0.0)) + along)
    goes = speed >= _SLOWEST_MPS
    both = 1.0 / flight.acceleration_mps2 + 1.0 / flight.deceleration_mps2
    peak = np.minimum(np.where(goes, speed, 1.0), np.sqrt(2.0 * np.maximum(length, 1e-9) / both))
    seconds = length / peak + 0.5 * peak * both
    return np.where(length <= 0.0, 0.0, np.where(goes, seconds, np.inf))


@dataclass(frozen=True, slots=True)
class WayHome:
    """What is left to fly: metres over ground, seconds until on the ground, and the wind against it (m/s, 0: none).

    `upright_s` of the seconds are climb and descent, and `waits_s` a hover over home while others land.
    """

    length_m: float
    seconds: float
    against_mps: float
    upright_s: float = 0.0
    waits_s: float = 0.0

    def waiting(self, seconds: float) -> WayHome:
        """The same with a wait over home."""
        return replace(self, seconds=self.seconds + seconds, waits_s=self.waits_s + seconds)

    @classmethod
    def along(
        cls,
        points: Sequence[Metres],
        height_m: float,
        wind: Wind | None,
        flight: FlightSettings,
        return_m: float | None = None,
        speed_mps: float | None = None,
    ) -> WayHome:
        """The way through points (here first, home last), with a stop at each, from a height above home in metres,
        flown at `return_m` above home, None: as the autopilot's own return is set; and at `speed_mps`, None: as asked.

        Its seconds are infinite when the wind does not let the aircraft get there.
        """
        length = seconds = head = 0.0
        for here, there in pairwise(points):
            leg = (there[0] - here[0], there[1] - here[1])
            metres = math.hypot(*leg)
            speed = speed_over_ground(leg, wind, flight, speed_mps)
            if metres > 0.0 and speed < _SLOWEST_MPS:
                seconds = math.inf
            elif metres > 0.0:
                seconds += leg_seconds(metres, speed, flight.acceleration_mps2, flight.deceleration_mps2)
            length += metres
            if wind is not None and metres > 0:
                head -= wind.east_mps * leg[0] + wind.north_mps * leg[1]
        highest = flight.return_height_m if return_m is None else return_m
        climb = max(0.0, highest - height_m)
        descent = max(highest, height_m)
        upright = climb / flight.climb_mps + descent / flight.descent_mps
        return cls(length, seconds + upright, max(0.0, head / length) if length > 0 else 0.0, upright)


@dataclass(frozen=True, slots=True)
class Left:
    """What a battery leaves, in seconds from now: until the aircraft must be on the ground, and until its search must
    be over wherever it is; `here_s` is the way home from here, `upright_s` of them climb and descent. With the place
    where it lands, the wind, and the speed of the way home, None: as asked."""

    ground_s: float
    search_s: float
    here_s: float
    upright_s: float
    home: LatLon
    wind: Wind | None = None
    speed_mps: float | None = None

    @property
    def spare_s(self) -> float:
        """How long the search could go on if it ended as far from home as now."""
        return min(self.search_s, self.ground_s - self.here_s)

    def after(self, seconds: float) -> Left:
        """What is left so many seconds later."""
        return replace(self, ground_s=self.ground_s - seconds, search_s=self.search_s - seconds)


@dataclass(frozen=True, slots=True)
class Energy:
    """The battery (percent), what a second costs (percent; None: not known yet), and the way home."""

    percent: float | None
    percent_per_s: float | None
    home: WayHome
    told: bool = True
    """The level is what the autopilot tells now, and not counted down from what it told last."""
    state: str = ""
    """What the autopilot calls the battery: "low", "critical", ..."""
    level: float | None = None
    """As `percent`, reckoned between two whole ones."""
    wind: Wind | None = None
    doubt: str = ""
    """Why it is not told for all that, as the end of a sentence: what is told stands still, say."""
    speed_mps: float | None = None
    """How fast it flies home; None: as asked."""

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

    def left(self, flown_s: float, home: LatLon, flight: FlightSettings) -> Left | None:
        """What the battery leaves, by the rule of `objection`; None while its level or its cost is not known.

        Never more than that rule permits: it is asked all the same, and has the last word.
        """
        level = self.percent if self.level is None else self.level
        if level is None or not self.percent_per_s or not math.isfinite(self.home.seconds):
            return None
        waits, here = self.home.waits_s, self.home.seconds - self.home.waits_s
        ground = (level - flight.reserve_percent) / self.percent_per_s - waits
        search = min((level - flight.min_battery_percent) / self.percent_per_s, flight.max_flight_s - flown_s)
        return Left(ground, search, here, self.home.upright_s, home, self.wind, self.speed_mps)

    def objection(self, flown_s: float, flight: FlightSettings) -> str:
        """Why the aircraft must fly home now, or nothing; it has been in the air for `flown_s` seconds."""
        if flown_s >= flight.max_flight_s:
            return f"{flown_s:.0f} s in the air"
        if self.state in _WORN:
            return f"the autopilot calls the battery {self.state}"
        if self.percent is None:
            unknown = flown_s > _FIRST_WORD_S and not flight.allow_unknown_battery
            return "the battery's level is not known" if unknown else ""
        if self.percent <= flight.min_battery_percent:
            return f"battery at {self.percent:.0f} %{self._reckoned()}"
        needed = self.needed()
        if needed is None or self.percent > needed + flight.reserve_percent:
            return ""
        way = f"the way home, {self.home.length_m:.0f} m"
        if self.home.against_mps >= 0.5:
            way += f" against {self.home.against_mps:.0f} m/s of wind"
        if self.home.waits_s:
            way += f" and {self.home.waits_s:.0f} s of waiting until others have landed"
        battery = f"battery {self.percent:.0f} %{self._reckoned()}"
        if math.isinf(needed):
            return f"{battery}: {way}, cannot be flown in this wind"
        return f"{battery}: {way}, needs {needed:.0f} % and {flight.reserve_percent:g} % are kept"

    def spent(self, flight: FlightSettings) -> str:
        """Why nothing on the way home can be waited for any longer, or nothing: half of what is kept beyond the way is
        used up, or the autopilot calls the battery worse than low."""
        if self.state in _WORN - {"low"}:
            return f"the autopilot calls the battery {self.state}"
        needed = cost_per_s(self.percent_per_s, flight) * (self.home.seconds - self.home.waits_s)
        if self.percent is None or self.percent > needed + 0.5 * flight.reserve_percent:
            return ""
        return f"battery {self.percent:.0f} %{self._reckoned()}: no more waiting on the way home"

    def falls_short(self, height_m: float, flight: FlightSettings) -> str:
        """Why it has to land where it is, `height_m` up, or nothing: the way home needs more than there is, and hardly
        more is left than a landing here takes. Only what is told counts, and is not contradicted by what was told."""
        level = self.percent if self.level is None else self.level
        cost = cost_per_s(self.percent_per_s, flight)
        home = cost * (self.home.seconds - self.home.waits_s)
        here = cost * max(height_m, 0.0) / flight.descent_mps
        if level is None or not self.told or level >= home or level > here + _LANDING_PERCENT:
            return ""
        needs = f"the way home needs {home:.0f} %, a landing here {here:.0f} %"
        return f"battery {level:.0f} %{self._reckoned()}: {needs}"

    def warning(self) -> str:
        """What the pilot and the page must know of the level, or nothing."""
        if self.percent is None:
            return "the battery's level is not known"
        if self.told:
            return ""
        return f"the battery's level {self._silence}: reckoned to be {self.percent:.0f} %"

    @property
    def _silence(self) -> str:
        return self.doubt or "is not told any longer"

    def _reckoned(self) -> str:
        return "" if self.told else f", reckoned since it {self._silence}"


def take_off_objection(t: Telemetry, seconds: float, flight: FlightSettings) -> str:
    """Why the battery does not let the aircraft take off, or nothing.

    `seconds` is how long the way out and home takes, without any search between.
    """
    percent = t.battery_percent
    if t.battery_state in _WORN:
        return f"no take-off: the autopilot calls the battery {t.battery_state}"
    if percent is None:
        if flight.allow_unknown_battery:
            return ""
        return (
            "no take-off: the battery's level is not known; "
            "flight.allow_unknown_battery = true in the settings lets it fly all the same"
        )
    if percent <= flight.min_battery_percent:
        return f"no take-off: battery at {percent:.0f} %, and {flight.min_battery_percent:g} % is the least"
    needed = seconds * cost_per_s(None, flight)
    if percent <= needed + flight.reserve_percent:
        return (
            f"no take-off: battery at {percent:.0f} %, the way out and home needs about {needed:.0f} % "
            f"and {flight.reserve_percent:g} % are kept"
        )
    return ""
