"""How high to fly: above flat ground at home's height, or above the ground that a height model has.

All heights inside are above the ground at the launch point, as those of the relief. What the autopilot is told is above
the sea: the altitude of home as it was when the flight began (`Telemetry.home_alt_amsl_m`), less the ground there. A
home that is set anew in the air changes where the aircraft lands, and no height.

Pure; it remembers the ground at home and the level of the sea as they were while the aircraft last stood on the ground,
and by how much a distance sensor has shown the ground to be higher than the model.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from service.config import SPARE_M, Settings
from service.evidence.mask import looks_count
from service.geometry import LatLon, Metres, between, moved
from service.ground.leg import GroundProfile, highest_above, least_clearance, passing, profile
from service.mavlink.telemetry import Telemetry
from service.mission.chart import Chart, here
from service.mission.fence import height_objection

CLIMBED_M = 1.0  # so far below the height that it climbs to it has climbed
_PLAN_M = 1.5  # more than the clearance is asked of a leg that is planned
_TOLERANCE_M = 0.5  # of a leg that is sent: heights have moved since it was planned
_REACTION_S = 0.5
_SHORTEST_PIECE_M = 40.0
_ON_THE_SPOT_M = 10.0  # the aircraft moves while a row is written
_MOST_BIAS_M = 60.0
_MOST_LOOKED_AT = 100
_MOST_CHANGE_M = 100.0  # in one leg: the link takes more for an altitude of another reference
_PLACES = 64  # whose ground is kept: that of the aircraft and of its home are asked for over and over
_MEASURED = "as it measures it"
_REPORTED = "by the autopilot's own heights of the ground"


def _distances(t: Telemetry) -> dict[str, float]:
    """How far below the ground is by what the vehicle tells of it, by the words for what that is."""
    told = {_MEASURED: t.ground_distance_m, _REPORTED: t.terrain_distance_m}
    return {by: below for by, below in told.items() if below is not None}


@dataclass(frozen=True, slots=True)
class Leg:
    """How a leg is flown: its target's altitude above the sea, and whether the aircraft climbs to that first, or sinks
    to it, on the spot."""

    altitude_m: float
    climbs: bool = False
    sinks: bool = False


class Heights:
    """The heights of one aircraft over one ground."""

    def __init__(self, chart: Chart, settings: Settings) -> None:
        self._chart, self._flight, self._ground = chart, settings.flight, settings.ground
        self.relief = chart.grid.relief
        self._home: Metres = chart.metres(chart.grid.launch)
        self._home_amsl_m = math.nan
        self._home_m = 0.0 if self.relief is None else math.nan
        self._lands_m = self._home_m  # the ground where it lands, should that have moved
        self._level_amsl_m = math.nan
        self.bias_m = 0.0
        """By how much the ground counts as higher than the model."""
        self._ground_at = lru_cache(_PLACES)(self._height_at)
        self._climb_mps, self._descent_mps = settings.flight.climb_mps, settings.flight.descent_mps
        self._ways = self._straight_home()

    # ---- what they are counted from

    def reckon(self, t: Telemetry, home: LatLon) -> None:
        """Take in where home is now, and how high, and how fast the aircraft may climb and sink by its parameters."""
        self._home_amsl_m = t.home_alt_amsl_m
        self._climb_mps = min(self._flight.climb_mps, t.most_climb_mps or math.inf)
        self._descent_mps = min(self._flight.descent_mps, t.most_descent_mps or math.inf)
        if self.relief is None:
            return
        self._home = self._chart.metres(home)
        below = self._ground_at(self._home)
        self._lands_m = below
        if not t.armed or not math.isfinite(self._level_amsl_m):
            self._home_m, self._level_amsl_m = below, self._home_amsl_m - below

    @property
    def home_m(self) -> float:
        """The ground at home as it was when the flight began, above that at the launch point; NaN: not known."""
        return self._home_m

    def up(self, t: Telemetry) -> float:
        """The aircraft's height above the ground at the launch point."""
        return t.alt_home_m + self._home_m

    def _amsl(self, up: float) -> float:
        return self._home_amsl_m + up - self._home_m

    def up_of(self, altitude_m: float) -> float:
        """The height above the ground at the launch point of an altitude above the sea."""
        return altitude_m - self._home_amsl_m + self._home_m

    def contradiction(self, t: Telemetry) -> str:
        """Why the height above the ground is not to be trusted, or nothing: by home, and by the sea as its level was
        when the aircraft stood on the ground, it has to be the same."""
        if self.relief is None or not t.position_known:
            return ""
        if not math.isfinite(self._home_m):
            return "the height of the ground at home is not known"
        by_home, by_sea = self.up(t), t.alt_amsl_m - self._level_amsl_m
        if abs(by_home - by_sea) <= self._flight.max_jump_m:
            return ""
        return f"it is {by_home:.0f} m above the launch point by home, and {by_sea:.0f} m by the sea as at the take-off"

    def datum_note(self) -> str:
        """That file and autopilot mean different heights of the launch point, when a person should know; or nothing."""
        if self.relief is None or not math.isfinite(self._level_amsl_m):
            return ""
        by_file, by_autopilot = self.relief.launch_amsl_m, self._level_amsl_m
        if abs(by_file - by_autopilot) <= self._ground.max_datum_difference_m:
            return ""
        return (
            f"the launch point is {by_file:.0f} m above the sea by the ground file and {by_autopilot:.0f} m by the "
            "autopilot; is it the right file, and in metres?"
        )

    # ---- legs

    def leg(self, point: LatLon, t: Telemetry, *, on_way: bool = True) -> Leg:
        """How to fly from here to a point. Unlike a way, a search sinks first where it would be too high on the leg."""
        if self.relief is None:
            return Leg(self._home_amsl_m + self._flight.altitude_m)
        seen, beyond = self._profile(here(t), point), self._coasting(t)
        height = self._height_of(seen, max(seen.highest_m, beyond.highest_m))
        up = self.up(t)
        if not math.isfinite(height):
            return Leg(self._amsl(up))
        wanted = self._flight.clearance_m + _PLAN_M
        height = max(height, up - _MOST_CHANGE_M)
        least = least_clearance(seen, up, height, self._climb_per_m).metres - self.bias_m
        low = min(least, min(up, height) - beyond.highest_m - self.bias_m) < wanted
        if low and up < height - CLIMBED_M:
            return Leg(self._amsl(min(height, up + _MOST_CHANGE_M)), climbs=True)
        too_high = highest_above(seen, up, height, self._sink_per_m) > self._flight.max_height_m
        if too_high and not on_way:
            stop = self._profile(here(t), self.stop_place(t))
            sunk = max(height, self._height_of(stop, stop.highest_m))
            if sunk < up - 2.0 * CLIMBED_M and sunk - float(stop.ground[-1]) <= self._flight.max_height_m:
                return Leg(self._amsl(sunk), sinks=True)
        return Leg(self._amsl(height))

    def shows(self, places: Sequence[LatLon], end: LatLon, t: Telemetry) -> bool:
        """Whether the aircraft is at a height from which a look counts when it passes these places on its leg to `end`,
        be it that its autopilot flies a straight line in space, or climbs and sinks as fast as it may."""
        leg = self.leg(end, t, on_way=False)
        if self.relief is None or leg.climbs or leg.sinks:  # first it would leave the height at which it is
            return self.relief is None
        start, up, height = self._chart.metres(here(t)), self.up(t), self.up_of(leg.altitude_m)
        across = np.subtract(self._chart.metres(end), start)
        length = float(np.hypot(*across))
        for place in places:
            along = float(np.subtract(self._chart.metres(place), start) @ across) / max(length, 1e-9)
            if not 0.0 < along < length:
                continue
            most = self._climb_per_m if height > up else self._sink_per_m
            if not all(self._seen_from(place, each) for each in passing(along, length, up, height, most)):
                return False
        return True

    def level(self, place: LatLon, t: Telemetry) -> Leg | None:
        """The height to fly over a place, where a look at it from the present one does not count; or nothing."""
        up = self.up(t)
        if self.relief is None or not math.isfinite(up) or self._seen_from(place, up):
            return None
        wanted = self._home_m + self.over_m(place)
        if abs(wanted - up) <= CLIMBED_M:
            return None  # it is not seen any better than this
        return Leg(self._amsl(wanted), climbs=wanted > up, sinks=wanted < up)

    def _seen_from(self, place: LatLon, up: float) -> bool:
        """Whether a look at a place counts from a height above the launch point; nothing is known to speak against it
        where the ground is not known."""
        above = up - self._ground_at(self._chart.metres(place))
        return not math.isfinite(above) or looks_count(above, self._flight.altitude_m)

    def objection(
        self, point: LatLon, altitude_m: float, t: Telemetry, *, on_way: bool, stands: LatLon | None = None
    ) -> str:
        """Why the leg from here to a point at an altitude above the sea must not be flown, as a sentence's end, or
        nothing. Climbing where it comes to a stand anyway is never objected to: that is at `stands`, by default where
        it would if it were told to stop now."""
        if self.relief is None:
            said = height_objection(altitude_m - self._home_amsl_m, self._flight)
            return f"is {said}" if said else ""
        flight, up, height = self._flight, self.up(t), altitude_m - self._home_amsl_m + self._home_m
        if not (math.isfinite(up) and math.isfinite(height)):
            return "is at a height above the ground that is not known"
        seen, beyond = self._profile(here(t), point), self._coasting(t)
        stands = stands or self.stop_place(t)
        if self._chart.distance(point, stands) <= _ON_THE_SPOT_M and height >= up - CLIMBED_M:
            return ""
        least = least_clearance(seen, up, height, self._climb_per_m)
        metres = min(least.metres, min(up, height) - beyond.highest_m) - self.bias_m
        if metres == -math.inf:
            return f"leads over ground whose height is not known, {least.along_m:.0f} m from here"
        if metres < flight.clearance_m - _TOLERANCE_M:
            return (
                f"comes within {metres:.0f} m of the ground {least.along_m:.0f} m from here, nearer than "
                f"{flight.clearance_m:g} m"
            )
        above, low, high = height - float(seen.ground[-1]), flight.min_height_m, flight.max_height_m
        if above < low or (not on_way and self._off_ground(point, height, above) > high + CLIMBED_M):
            return f"is {above:.0f} m above the ground, not between {low:g} and {high:g} m"
        return ""

    def _off_ground(self, point: LatLon, up: float, above: float) -> float:
        """How far from the closest ground a place `above` the ground below it is: only as exactly as a limit needs."""
        if self.relief is None or not above > self._flight.max_height_m:
            return above
        return self.relief.nearest_m(self._chart.metres(point), up)

    def piece(self, point: LatLon, t: Telemetry) -> LatLon:
        """The point, or one on the way to it: as far as one height does that is not too high above the ground."""
        if self.relief is None:
            return point
        start = here(t)
        length = self._chart.distance(start, point)
        pieces = 1
        while length / pieces > _SHORTEST_PIECE_M:
            end = between(start, point, 1.0 / pieces)
            seen = self._profile(start, end)
            above = self._height_of(seen, seen.highest_m) - float(np.nanmin(seen.ground, initial=math.inf))
            if above <= self._flight.max_height_m:
                return end if pieces > 1 else point
            pieces *= 2
        return point if pieces == 1 else between(start, point, 1.0 / pieces)

    def take_off_m(self) -> float:
        """How high above home to climb from it."""
        return self._over_m(self._home)

    def over_m(self, place: LatLon) -> float:
        """How high above home it flies over a place."""
        return self._over_m(self._chart.metres(place))

    def _over_m(self, place: Metres) -> float:
        if self.relief is None:
            return self._flight.altitude_m
        seen = profile(self.relief, place, place)
        height = self._height_of(seen, seen.highest_m) - self._home_m
        return height if math.isfinite(height) else self._flight.altitude_m

    def least_stop_amsl_m(self, t: Telemetry) -> float:
        """The lowest that it may stop at, as an altitude above the sea; NaN where any height does, or none is known."""
        if self.relief is None:
            return math.nan
        least = self._coasting(t).highest_m + self.bias_m + self._flight.clearance_m
        if (below := min(_distances(t).values(), default=None)) is not None:
            least = max(least, self.up(t) + self._flight.clearance_m - below)
        return self._amsl(least) if math.isfinite(least) else math.nan

    # ---- where it is

    def above_ground(self, t: Telemetry) -> float:
        """How high it is above the ground of the model, or home while that is taken as flat; NaN: not known."""
        if self.relief is None:
            return t.alt_home_m
        return self.up(t) - self._ground_at(self._chart.metres(here(t)))

    def wrong(self, t: Telemetry, *, on_way: bool) -> str:
        """Why the aircraft must not be as high as it is, as a sentence's end, or nothing."""
        if self.relief is None:
            return height_objection(t.alt_home_m, self._flight)
        most, above = self._flight.max_height_m, self.above_ground(t)
        away = above if on_way else self._off_ground(here(t), self.up(t), above)
        if away > most + 2.0 * CLIMBED_M and not on_way:
            return f"{away:.0f} m from the closest ground, more than {most:g} m"
        return ""

    def low(self, t: Telemetry) -> str:
        """Why the aircraft is too near to the ground, by the model or by its own distance sensor, or nothing."""
        if self.relief is None:
            return ""
        clearance = self._flight.clearance_m
        above = self.above_ground(t) - self.bias_m
        if above < clearance - CLIMBED_M:
            return f"{above:.0f} m above the ground by the model, less than {clearance:g} m"
        for by, below in _distances(t).items():
            if below < clearance - CLIMBED_M:
                return f"{below:.0f} m above the ground {by}, less than {clearance:g} m"
        return ""

    def learn(self, t: Telemetry) -> None:
        """The ground is higher than the model by what the distance sensor misses: all legs are flown as much higher.

        The autopilot's own heights are coarse (a point every hundred metres by default): by them nothing is learnt but
        where they say that the aircraft is too low.
        """
        if self.relief is None:
            return
        for by, below in _distances(t).items():
            missing = self.above_ground(t) - below
            if math.isfinite(missing) and (by == _MEASURED or below < self._flight.clearance_m - CLIMBED_M):
                self.bias_m = min(max(self.bias_m, missing), _MOST_BIAS_M)

    # ---- the autopilot's own way home

    def return_clearance(self, start: LatLon, up: float, return_m: float) -> float:
        """How near to the ground the autopilot's own return comes, from a place and a height above the launch point.

        It climbs to `return_m` above home first, nearer to home than that to as much as it is away (the cone of both
        autopilots is steeper), and never sinks before it is there.
        """
        if self.relief is None:
            return math.inf
        seen = profile(self.relief, self._chart.metres(start), self._home)
        height = max(up, self._lands_m + min(return_m, seen.length_m))
        return height - seen.highest_m - self.bias_m

    def return_note(self, return_m: float) -> str:
        """That the autopilot's own return would not clear the ground from somewhere, when it would not; or nothing."""
        if self.relief is None or not math.isfinite(self._lands_m):
            return ""
        length, highest, up = self._ways.T
        clear = np.maximum(up, self._lands_m + np.minimum(return_m, length)) - highest - self.bias_m
        worst = int(np.argmin(clear))
        bad = int((clear < self._flight.clearance_m).sum())
        if not bad:
            return ""
        needed = return_m + self._flight.clearance_m - clear[worst]
        return (
            f"the autopilot's own return at {return_m:.0f} m above home would not clear the ground by "
            f"{self._flight.clearance_m:g} m from {bad} of {len(clear)} places ({clear[worst]:.0f} m at the worst): "
            f"the search flies home itself; {needed:.0f} m would do for when it cannot"
        )

    def _straight_home(self) -> NDArray[np.float64]:
        """From some of the cells straight to the launch point: length, highest ground and height flown there, float
        [k, 3]. Worked out before the flight: while it takes, nobody listens to the aircraft."""
        if self.relief is None:
            return np.zeros((0, 3))
        grid, ways = self._chart.grid, []
        flyable = np.argwhere(grid.flyable)
        for row, col in flyable[:: max(1, len(flyable) // _MOST_LOOKED_AT)].tolist():
            start = (col + 0.5) * grid.frame.cell_m, (row + 0.5) * grid.frame.cell_m
            there, seen = profile(self.relief, start, start), profile(self.relief, start, self._home)
            ways.append((seen.length_m, seen.highest_m, self._height_of(there, there.highest_m)))
        return np.array(ways)

    def highest_return_m(self, way: list[LatLon]) -> float:
        """The highest above home that a way home through these points is flown at by us."""
        highest = self._flight.altitude_m
        if self.relief is None:
            return highest
        for start, end in pairwise(way):
            seen = profile(self.relief, self._chart.metres(start), self._chart.metres(end))
            height = self._height_of(seen, seen.highest_m) - self._home_m
            highest = max(highest, height) if math.isfinite(height) else highest
        return highest

    # ---- inside

    def _height_at(self, place: Metres) -> float:
        """The ground at a place above that at the launch point; NaN where it is not known."""
        assert self.relief is not None
        return float(self.relief.height_at(np.array([place]))[0])

    @property
    def _climb_per_m(self) -> float:
        return self._climb_mps / self._flight.speed_mps

    @property
    def _sink_per_m(self) -> float:
        return self._descent_mps / self._flight.speed_mps

    @property
    def _ahead_m(self) -> float:
        speed = self._flight.speed_mps
        return speed**2 / (2.0 * self._flight.deceleration_mps2) + speed * _REACTION_S

    def _profile(self, start: LatLon, end: LatLon) -> GroundProfile:
        assert self.relief is not None
        metres = self._chart.metres
        return profile(self.relief, metres(start), metres(end), ahead_m=self._ahead_m)

    def _height_of(self, seen: GroundProfile, highest: float) -> float:
        """The height to fly a leg at: above the ground at its end as the search is, clear of all of it."""
        flight, end = self._flight, float(seen.ground[-1])
        wanted = end + flight.altitude_m if math.isfinite(end) else math.inf
        return max(wanted, highest + flight.clearance_m + SPARE_M) + self.bias_m

    def stop_place(self, t: Telemetry) -> LatLon:
        """Where the aircraft comes to a stand when it is told to now."""
        north, east, _ = t.velocity_ned_mps
        speed = t.ground_speed_mps
        if not speed > 0.5:
            return here(t)
        seconds = speed / (2.0 * self._flight.deceleration_mps2) + _REACTION_S
        return moved(here(t), seconds * east, seconds * north)

    def _coasting(self, t: Telemetry) -> GroundProfile:
        """The ground below until the aircraft stands, whatever it is told."""
        assert self.relief is not None
        metres = self._chart.metres
        return profile(self.relief, metres(here(t)), metres(self.stop_place(t)))
