"""The helm: everything that speaks against sending the aircraft somewhere, or against flying on.

Pure: telemetry and the time go in, objections come out. What it remembers is where the aircraft was sent last, how
long things have been the way they are, and the height and the fence that follow from home.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from service.config import Settings
from service.geometry import LatLon, between, offset_m
from service.mavlink.events import Target
from service.mavlink.target import distance_m
from service.mavlink.telemetry import Telemetry, Wind
from service.mission.apart import Other, called
from service.mission.chart import Chart, here
from service.mission.effects import SendWaypoint
from service.mission.energy import take_off_objection
from service.mission.fence import Straying
from service.mission.heights import Heights, Leg
from service.mission.limits import (
    Lasting,
    Objection,
    PositionTrust,
    Progress,
    not_airborne,
    reference_objection,
    wind_objection,
)
from service.mission.situation import Situation, on_ground
from service.mission.traffic import Traffic

WINDY_S = 5.0
FAR_M = 50.0
STRAYED_S = 2.0
BESIDE_M = 4.0
"""Whose home is nearer to another's may land on who stands there already: GPS is not better."""
LOW_S = 1.0
AIRBORNE_S = 2.0  # so long it may not say that it is in the air


class Helm:
    """What one aircraft may do now.

    Args:
        name: that of the aircraft, where there are several.
        fresh_s: how old a position may be.
        patience_s: how long it may come no nearer to its waypoint.
    """

    def __init__(
        self, chart: Chart, settings: Settings, *, fresh_s: float, patience_s: float, name: str = ""
    ) -> None:
        self._chart, self._flight = chart, settings.flight
        self.trust = PositionTrust(settings.flight, fresh_s)
        near_m = max(settings.flight.corner_m, 0.3 * chart.frame.cell_m)
        self._progress = Progress(patience_s, near_m)
        self._windy, self._aground = Lasting(WINDY_S), Lasting(max(AIRBORNE_S, fresh_s))
        self._strayed, self._straying = Lasting(STRAYED_S), Straying()
        self._low, self._sinking = Lasting(LOW_S), Straying()
        self.heights = Heights(chart, settings)
        self.traffic = Traffic(name, chart, self.heights, settings.flight, fresh_s)
        self._target: LatLon | None = None
        self._on_way = False  # the last waypoint was one of the way to the area or home
        self._home = chart.grid.launch
        self._fence = chart.fence(self._home, settings.flight.margin_m)

    def reckon(self, t: Telemetry) -> None:
        """Home may have moved: the height of every waypoint and the fence follow from it."""
        if not t.position_known:
            return
        home = self._chart.home(t)
        self.heights.reckon(t, home)
        if home != self._home:
            self._home, self._fence = home, self._chart.fence(home, self._flight.margin_m)

    def crosses(self, t: Telemetry) -> bool:
        """Whether the leg that is flown now leads over, or too near to, an exclusion."""
        return self._target is not None and not self._chart.leg_allowed(here(t), self._target)

    def regrid(self) -> None:
        """The ground has changed: the fence follows from it, and who is over an exclusion is on its way out."""
        self._fence = self._chart.fence(self._home, self._flight.margin_m)
        self._straying.forget()

    def unfit(self, t: Telemetry, others: Sequence[Other]) -> str:
        """Why this aircraft is not the one to begin with, or nothing: it is too far away, must not land where it would,
        or is another mission's."""
        return self.no_way_home(t, others) or self.traffic.twin(t, others)

    def no_way_home(self, t: Telemetry, others: Sequence[Other]) -> str:
        """Why where this aircraft would land is no place to come home to, or nothing."""
        return self.too_far(t) or self._no_home(t, others)

    def grounded(self, seen: Situation) -> str:
        """Why this aircraft must not take off as it stands there, or nothing."""
        t, others = seen.telemetry, seen.others
        return self.unfit(t, others) or self.traffic.uneven(t, others) or self.too_empty(seen)

    def _no_home(self, t: Telemetry, others: Sequence[Other]) -> str:
        """Why it must not land where its autopilot would, or nothing. Among others the last leg home is ours, too."""
        home, least = self._chart.home(t), self._chart.grid.clearance_m
        if self._chart.excluded(home):
            return f"home, {self._chart.written(home)}, lies in an excluded area; move one of the two"
        if others and self._chart.too_near(home):
            said = f"lies within {least:g} m of an excluded area"
            return f"home, {self._chart.written(home)}, {said}; move one of the two"
        return ""

    def too_far(self, t: Telemetry) -> str:
        """Why the aircraft is too far from where the search is to begin, or nothing."""
        away, limit = self._from_launch_m(t), self._flight.max_home_distance_m
        if away <= limit:
            return ""
        return f"home is {_metres(away)} from the launch point, more than {_metres(limit)}; is it the right area file?"

    def too_empty(self, seen: Situation) -> str:
        """Why the battery does not let it take off, for the way out and home and the wait for others, or nothing."""
        t, flight, start = seen.telemetry, self._flight, self._chart.latlon(self._chart.grid.start)
        way_s = 2.0 * self._chart.distance(here(t), start) / seen.flies_mps(flight.speed_mps)
        height = max(self.heights.highest_return_m([here(t), start]), flight.return_height_m)
        up_s, down_s = height / flight.climb_mps, height / flight.descent_mps
        return take_off_objection(t, way_s + up_s + down_s + self.traffic.wait_s(t, seen.others), flight)

    def far(self, t: Telemetry) -> str:
        """That home is not at the launch point, when a person should know, or nothing."""
        away = self._from_launch_m(t)
        return f"home is {_metres(away)} from the launch point" if away > FAR_M else ""

    def beside(self, t: Telemetry, others: Sequence[Other]) -> str:
        """That it lands where another aircraft lands, and may stand, when a person should know, or nothing."""
        for other in others:
            if t.home is None or other.home == self._chart.grid.launch:  # one is not told yet
                continue
            metres = math.hypot(*offset_m(self._chart.home(t), other.home))
            if metres < BESIDE_M:
                return (
                    f"home is {metres:.0f} m from that of {called(other)}: "
                    "who lands second may come down on who stands there"
                )
        return ""

    def _from_launch_m(self, t: Telemetry) -> float:
        """Metres between home and the launch point, on the ellipsoid: the plane of the grid ends near the area.

        A home that is not told is where the aircraft stands before its flight.
        """
        stands = t.home is None and t.position_known and on_ground(t)
        (lat, lon), (lat2, lon2) = self._chart.grid.launch, here(t) if stands else self._chart.home(t)
        return distance_m(Target(lat, lon, 0.0), Target(lat2, lon2, 0.0))

    def return_m(self, t: Telemetry) -> float:
        """How high above home the autopilot flies home by itself: as its parameter says, else the settings."""
        return self._flight.return_height_m if t.return_height_m is None else t.return_height_m

    def returns_clear(self, start: LatLon, t: Telemetry) -> bool:
        """Whether the autopilot's own return from a place, at the height flown there or the present one if that
        is lower, is clear of the ground. One that does not tell how high that goes is not relied on to climb."""
        up = min(self.heights.up(t), self.heights.home_m + self.heights.over_m(start))
        clearance = self.heights.return_clearance(start, up, t.return_height_m or 0.0)
        return clearance >= self._flight.clearance_m

    def of_the_ground(self, t: Telemetry) -> list[str]:
        """What a person should know of the ground before a flight."""
        said = [self.heights.datum_note(), self.heights.return_note(self.return_m(t))]
        return [each for each in said if each]

    def sent(self, point: LatLon, *, on_way: bool) -> None:
        """The aircraft has been sent to a point."""
        if self._target is None or self._chart.distance(self._target, point) > 1.0:
            self._progress.clear()
        self._target, self._on_way = point, on_way

    def rest(self) -> None:
        """No waypoint is being flown any more."""
        self._target = None
        self._progress.clear()
        self._straying.forget()
        self._sinking.forget()

    # ---- checks

    def doubts(self, t: Telemetry, now: float) -> list[str]:
        """Why the position is not to be trusted now, or what it is measured from."""
        contradictions = reference_objection(t, self._flight), self.heights.contradiction(t)
        return [*self.trust.update(t, now), *(said for said in contradictions if said)]

    def leg(self, point: LatLon, t: Telemetry, *, on_way: bool = True) -> Leg:
        """How high to fly to a point, and whether to climb or sink first."""
        return self.heights.leg(point, t, on_way=on_way)

    def stop_place(self, t: Telemetry) -> LatLon:
        """Where the aircraft comes to a stand, or as near to that as the search may be."""
        stands = self.stands(t)
        for share in (1.0, 0.75, 0.5, 0.25):
            point = between(here(t), stands, share)
            if self.allows(point):
                return point
        return here(t)

    def stands(self, t: Telemetry) -> LatLon:
        """Where the aircraft comes to a stand if no other target is sent: at its present one, if that is nearer than
        where a stop that is ordered now would end: its autopilot brakes for that one already, as hard as it must."""
        stop = self.heights.stop_place(t)
        near = self._chart.distance(here(t), stop)
        if self._target is not None and self._chart.distance(here(t), self._target) < near:
            return self._target
        return stop

    def objection(self, waypoint: SendWaypoint, t: Telemetry, now: float) -> Objection | None:
        """Why a waypoint must not be sent now, or nothing. There is no other way for one to the aircraft."""
        point, on_way = waypoint.point, waypoint.on_way
        if doubts := self.doubts(t, now):
            return Objection("position", "; ".join(doubts))
        chart, where = self._chart, f"the waypoint {self._chart.written(point)}"
        if not chart.leg_allowed(here(t), point):
            return Objection("limits", f"{where} lies behind an excluded area")
        leg = chart.metres(here(t)), chart.metres(point)
        if outside := self._fence.leg_objection(*leg, on_way=on_way):
            return Objection("limits", f"{where} {outside}")
        stands = self.stands(t)
        if height := self.heights.objection(point, waypoint.altitude_m, t, on_way=on_way, stands=stands):
            return Objection("limits" if self.heights.relief is None else "ground", f"{where} {height}")
        limit = self._flight.max_launch_distance_m
        if chart.distance(chart.grid.launch, point) > limit:
            return Objection("limits", f"{where} is more than {limit:g} m from the launch point")
        return None

    def allows(self, point: LatLon) -> bool:
        """Whether the search may be over a point: inside the fence, and clear of exclusions."""
        outside = self._fence.outside_m(self._chart.metres(point), on_way=False)
        return outside == 0.0 and not self._chart.too_near(point)

    def trouble(self, t: Telemetry, now: float, *, moving: bool) -> Objection | None:
        """What stands against flying on while the autopilot follows our waypoints, or nothing."""
        doubts, aground = self.doubts(t, now), self._aground.after(not_airborne(t) if moving else "", now)
        if not t.guided:
            return None
        if doubts:
            return Objection("position", "; ".join(doubts))
        if aground:
            return Objection("air", aground)
        if moving and self._target is not None:
            stuck = self._progress.stuck(self._chart.distance(here(t), self._target), now)
            return Objection("progress", stuck) if stuck else None
        return None

    def too_windy(self, wind: Wind | None, now: float) -> str:
        """Why the wind is too much, once it has lasted, or nothing."""
        return self._windy.after(wind_objection(wind, self._flight), now)

    def strayed(self, t: Telemetry, now: float) -> str:
        """Why the aircraft is where it must not be, after it has been where it may, once that has lasted."""
        objection = self.heights.wrong(t, on_way=self._on_way)
        place = self._chart.metres(here(t))
        if away := self._fence.outside_m(place, on_way=self._on_way):
            objection = f"{away:.0f} m outside {self._fence.name(on_way=self._on_way)}"
        elif self._chart.excluded(here(t)):
            objection = "over an excluded area"
        strayed = self._straying.read(objection)
        return self._strayed.after(f"the aircraft is {strayed}" if strayed else "", now)

    def too_low(self, t: Telemetry, now: float) -> str:
        """Why it is too near to the ground, after it has been clear of it, once that has lasted; or nothing."""
        low = self._sinking.read(self.heights.low(t))
        return self._low.after(f"the aircraft is {low}" if low else "", now)

    def goes_on(self, t: Telemetry) -> bool:
        """It has a waypoint that it has not come to yet."""
        return (
            self._target is not None and self._chart.distance(here(t), self._target) > self._flight.corner_m
        )

    def under_way(self, t: Telemetry) -> bool:
        """It flies to a waypoint, and is too far from it to brake for it."""
        braking = self._flight.speed_mps**2 / (2.0 * self._flight.deceleration_mps2)
        return self._target is not None and self._chart.distance(here(t), self._target) > braking


def _metres(distance: float) -> str:
    return f"{distance / 1000:.0f} km" if distance >= 10_000.0 else f"{distance:.0f} m"
