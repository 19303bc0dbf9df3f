"""What a vehicle can be doing: stand, hold, go somewhere, take off, land, return, follow sticks or setpoints.

A behaviour looks at the vehicle and writes a Demand for the body, once a step. It knows no MAVLink and no
flavour: firmwares choose behaviours and give them their parameters.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from sim.autopilot.motion import Demand
from sim.autopilot.vehicle import Behaviour, Landed, Point, Vehicle

_ARRIVED_M = 1.0


def bearing(north: float, east: float) -> float:
    """Compass direction of a displacement, degrees."""
    return math.degrees(math.atan2(east, north)) % 360.0


class Stand(Behaviour):
    """Stay on the ground; in the air, sink gently."""

    def steer(self, vehicle: Vehicle, demand: Demand) -> None:
        demand.north, demand.velocity_north, demand.velocity_east = None, 0.0, 0.0
        demand.up, demand.velocity_up, demand.yaw = None, -1.0, None


class GoTo(Behaviour):
    """Fly to a point and hold it there, the nose towards it unless a yaw is given.

    `straight`: keep to the straight line in space, so that a long way down makes the way across slow.
    """

    def __init__(
        self, target: Point, *, yaw: float | None = None, speed: float | None = None, straight: bool = False
    ) -> None:
        self._target, self._yaw, self._speed, self._straight = target, yaw, speed, straight
        self._facing: float | None = None

    @property
    def target(self) -> Point:
        return self._target

    def steer(self, vehicle: Vehicle, demand: Demand) -> None:
        target, body = self._target, vehicle.body
        demand.north, demand.east, demand.up = target.north, target.east, target.up
        demand.speed = vehicle.cruise if self._speed is None else self._speed
        demand.climb, demand.descend = vehicle.limits.climb, vehicle.limits.descend
        gap_north, gap_east = target.north - body.north, target.east - body.east
        if self._straight:
            rise = target.up - body.up
            seconds = abs(rise) / (demand.climb if rise > 0 else demand.descend)
            if seconds > 1.0:
                demand.speed = min(demand.speed, max(math.hypot(gap_north, gap_east) / seconds, 0.05))
        if self._yaw is not None:
            demand.yaw = self._yaw
            return
        gap = math.hypot(gap_north, gap_east)
        if gap > 6.0 or (self._facing is None and gap > 1.0):
            self._facing = bearing(gap_north, gap_east)
        demand.yaw = self._facing


class Hold(Behaviour):
    """Brake, then hold the place where it came to rest, at the height it had."""

    def __init__(self, up: float | None = None) -> None:
        self._place: tuple[float, float] | None = None
        self._up = up

    @property
    def target(self) -> Point | None:
        if self._place is None or self._up is None:
            return None
        return Point(self._place[0], self._place[1], self._up)

    def steer(self, vehicle: Vehicle, demand: Demand) -> None:
        body = vehicle.body
        if self._up is None:
            seen = vehicle.seen
            if abs(body.velocity_up) < 0.2:
                self._up = seen.up
        if self._place is None and body.speed < 0.3:
            self._place = (vehicle.seen.north, vehicle.seen.east)
        if self._place is None:
            demand.north, demand.velocity_north, demand.velocity_east = None, 0.0, 0.0
        else:
            demand.north, demand.east = self._place
        demand.up, demand.velocity_up = self._up, 0.0
        demand.speed = vehicle.limits.cruise
        demand.climb, demand.descend, demand.yaw = vehicle.limits.climb, vehicle.limits.descend, None


class Paused(Hold):
    """Brake and hold while a leg waits to be flown on; the target that is named is the leg's."""

    def __init__(self, leg: Behaviour) -> None:
        super().__init__()
        self.leg = leg

    @property
    def target(self) -> Point | None:
        return self.leg.target


class TakeOff(Behaviour):
    """Spool the motors up, climb straight to a height, slower below `slow_below`."""

    landed = Landed.TAKEOFF
    lifts = True

    def __init__(self, up: float, *, spool_s: float, slow_below: float, slow_climb: float) -> None:
        self.up = up
        self._spool_s, self._slow_below, self._slow_climb = spool_s, slow_below, slow_climb
        self._began: float | None = None
        self._place = (0.0, 0.0)

    @property
    def target(self) -> Point:
        return Point(self._place[0], self._place[1], self.up)

    def steer(self, vehicle: Vehicle, demand: Demand) -> None:
        if self._began is None:
            self._began = vehicle.time
            self._place = (vehicle.seen.north, vehicle.seen.east)
        demand.north, demand.east = self._place
        demand.speed, demand.descend, demand.yaw = 2.0, vehicle.limits.descend, None
        demand.up = self.up
        if vehicle.time - self._began < self._spool_s:
            demand.up, demand.velocity_up = None, 0.0
        up = vehicle.seen.up
        demand.climb = self._slow_climb if up < self._slow_below else vehicle.limits.climb
        if up > self.up - 0.3 and abs(vehicle.body.velocity_up) < 0.3:
            self.done = True


class Land(Behaviour):
    """Come down where it is (after braking) or at a place; slower below `slow_below` metres."""

    landed = Landed.LANDING

    def __init__(
        self, *, fast: float, slow: float, slow_below: float, place: tuple[float, float] | None = None
    ) -> None:
        self._fast, self._slow, self._slow_below, self._place = fast, slow, slow_below, place

    @property
    def target(self) -> Point | None:
        return None if self._place is None else Point(self._place[0], self._place[1], 0.0)

    def steer(self, vehicle: Vehicle, demand: Demand) -> None:
        if self._place is None and vehicle.body.speed < 0.3:
            self._place = (vehicle.seen.north, vehicle.seen.east)
        if self._place is None:
            demand.north, demand.velocity_north, demand.velocity_east = None, 0.0, 0.0
        else:
            demand.north, demand.east = self._place
            demand.speed = vehicle.limits.cruise
        rate = self._fast if vehicle.seen.up > self._slow_below else self._slow
        demand.up, demand.velocity_up, demand.descend, demand.yaw = None, -rate, self._fast, None


class Return(Behaviour):
    """Climb to a height if there is a way to go, fly home, wait there, land."""

    def __init__(
        self, home: Point, up: float, *, wait_s: float, land: Land, say: Callable[[str], None]
    ) -> None:
        self._home, self._up, self._wait_s, self._land, self._say = home, up, wait_s, land, say
        self._phase, self._over_home_at = "climb", 0.0
        self._leg: GoTo | None = None

    @property
    def target(self) -> Point:
        return Point(self._home.north, self._home.east, 0.0 if self._phase == "land" else self._up)

    def steer(self, vehicle: Vehicle, demand: Demand) -> None:
        seen = vehicle.seen
        if self._phase == "climb":
            if self._leg is None:
                self._leg = GoTo(Point(seen.north, seen.east, max(self._up, seen.up)))
            if seen.up > self._up - 0.3:
                self._phase = "fly"
                self._leg = GoTo(Point(self._home.north, self._home.east, max(self._up, seen.up)))
        if self._phase == "fly":
            gap = math.hypot(seen.north - self._home.north, seen.east - self._home.east)
            if gap < _ARRIVED_M and vehicle.body.speed < 1.0:
                self._phase, self._over_home_at = "wait", vehicle.time
        if self._phase == "wait" and vehicle.time - self._over_home_at >= self._wait_s:
            self._phase, self.landed = "land", Landed.LANDING
            self._say("RTL: land at destination")
        if self._phase == "land":
            self._land.steer(vehicle, demand)
        elif self._leg is not None:
            self._leg.steer(vehicle, demand)


class FollowSticks(Behaviour):
    """Fly as the pilot's sticks say; neutral sticks hold the place, and keep it on the ground."""

    def __init__(self) -> None:
        self._hold = Hold()

    def steer(self, vehicle: Vehicle, demand: Demand) -> None:
        sticks = vehicle.sticks
        fresh = vehicle.time - sticks.heard_at < 1.0
        self.lifts = fresh and sticks.throttle > 0.1
        if not fresh or max(abs(sticks.pitch), abs(sticks.roll), abs(sticks.throttle), abs(sticks.yaw)) < 0.1:
            self._hold.steer(vehicle, demand)
            return
        self._hold = Hold()
        yaw = math.radians(vehicle.body.yaw)
        fast = vehicle.limits.cruise
        demand.north = None
        demand.velocity_north = fast * (sticks.pitch * math.cos(yaw) - sticks.roll * math.sin(yaw))
        demand.velocity_east = fast * (sticks.pitch * math.sin(yaw) + sticks.roll * math.cos(yaw))
        demand.up = None
        demand.climb, demand.descend = vehicle.limits.climb, vehicle.limits.descend
        demand.velocity_up = sticks.throttle * (demand.climb if sticks.throttle > 0 else demand.descend)
        demand.yaw = (vehicle.body.yaw + 45.0 * sticks.yaw) % 360.0 if abs(sticks.yaw) > 0.1 else None


class FollowSetpoints(Behaviour):
    """Fly the last position or velocity setpoint."""

    lifts = True

    def __init__(self) -> None:
        self.position: Point | None = None
        self.velocity = (0.0, 0.0, 0.0)  # north, east, up
        self.yaw: float | None = None

    @property
    def target(self) -> Point | None:
        return self.position

    def steer(self, vehicle: Vehicle, demand: Demand) -> None:
        demand.speed, demand.yaw = vehicle.cruise, self.yaw
        demand.climb, demand.descend = vehicle.limits.climb, vehicle.limits.descend
        if self.position is not None:
            demand.north, demand.east, demand.up = self.position
            return
        demand.north, demand.up = None, None
        demand.velocity_north, demand.velocity_east, demand.velocity_up = self.velocity
