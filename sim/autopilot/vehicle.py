"""The vehicle apart from any protocol: body, battery, sensors, what it is doing and what it believes."""

from __future__ import annotations

import math
import random
from collections import deque
from enum import IntEnum
from typing import NamedTuple

from sim.autopilot.battery import Battery
from sim.autopilot.geo import LocalFrame
from sim.autopilot.motion import Body, Demand, Limits
from sim.autopilot.sensors import PERIOD_S, Estimator, GpsReceiver, Wind
from sim.autopilot.settings import STEP_S, Settings

_BESIDE_HOME_M = 15.0  # nearer to where it started it takes off and lands
_HARD_MPS = 3.0  # meeting the ground faster than this, along or down, is a crash
_PERIOD_STEPS = round(PERIOD_S / STEP_S)


class Landed(IntEnum):
    """MAV_LANDED_STATE."""

    ON_GROUND = 1
    IN_AIR = 2
    TAKEOFF = 3
    LANDING = 4


class Point(NamedTuple):
    """A place in the home frame: metres north, east, up."""

    north: float
    east: float
    up: float


class Sticks:
    """The pilot's sticks: each from -1 to 1, throttle 0 in the middle; when they were last heard."""

    __slots__ = ("heard_at", "pitch", "roll", "throttle", "yaw")

    def __init__(self) -> None:
        self.heard_at = -1e9
        self.pitch = self.roll = self.throttle = self.yaw = 0.0


class Vehicle:
    """State of one multicopter. `step` moves it by STEP_S; the firmware class decides what it does."""

    def __init__(
        self, settings: Settings, limits: Limits, *, error_m: float, error_mps: float, cells: int
    ) -> None:
        self.settings, self.limits = settings, limits
        source = random.Random(settings.seed)
        self.frame = LocalFrame(settings.home[0], settings.home[1])
        self.ground_amsl = settings.home[2]
        self.body = Body(limits, settings.heading_deg)
        self.battery = Battery(settings.endurance_s, cells)
        self.estimator = Estimator(error_m, error_mps, source)
        self.gps = GpsReceiver(source)
        self.wind = Wind(settings.wind_mps, settings.gust_mps, source)
        self.air = settings.wind_mps
        self.sticks = Sticks()
        self.random = source
        self.steps = 0
        self.home: Point | None = None
        self.origin = Point(0.0, 0.0, 0.0)  # of the estimator, in the home frame
        self.ground, self.crashed = settings.ground, False  # crashed: it has met the ground too fast
        self.least_clearance = math.inf  # nearest to the ground while it flew, away from where it started
        # metres by which a distance sensor sees the ground below higher than it is; None: there is no sensor
        self.rangefinder_rise = 0.0 if settings.rangefinder else None
        # the same for what it has of the ground in its own database; None: it has nothing
        self.terrain_rise = 0.0 if settings.rangefinder else None
        self.tells_wind = False  # a stock multicopter does not know the wind
        self.armed, self.armed_at, self.touched_at = False, 0.0, 0.0
        self.flew = False  # has left the ground since it was armed
        self.landed = Landed.ON_GROUND
        self.speed_limit: float | None = None  # DO_CHANGE_SPEED, lasts
        self.stuck = False  # a fault: commands are accepted and not flown
        self.behaviour: Behaviour
        self.texts: deque[tuple[int, str]] = deque()
        self._demand = Demand(limits)

    @property
    def time(self) -> float:
        """Seconds of vehicle time since boot."""
        return self.steps * STEP_S

    @property
    def seen(self) -> Point:
        """Where the vehicle believes to be."""
        body, error = self.body, self.estimator
        return Point(body.north + error.north, body.east + error.east, body.up + error.up)

    @property
    def cruise(self) -> float:
        """Speed to the next target, m/s."""
        return self.limits.cruise if self.speed_limit is None else self.speed_limit

    @property
    def flying(self) -> bool:
        """Armed and off the ground."""
        return self.armed and not self.body.on_ground

    def say(self, severity: int, text: str) -> None:
        """Queue a STATUSTEXT."""
        self.texts.append((severity, text))

    def amsl(self, up: float) -> float:
        """Metres above mean sea level of a height in the home frame."""
        return self.ground_amsl + up

    def step(self) -> None:
        """Move on by one step."""
        self.steps += 1
        if self.steps % _PERIOD_STEPS == 0:
            self._slow()
        body = self.body
        if not self.armed and body.on_ground:
            return
        demand = self._demand
        body.floor = self.ground.height(body.north, body.east)
        speed, sink = body.speed, -body.velocity_up
        was_on_ground = body.on_ground
        if not was_on_ground and math.hypot(body.north, body.east) > _BESIDE_HOME_M:
            self.least_clearance = min(self.least_clearance, body.up - body.floor)
        if self.armed:
            self.behaviour.steer(self, demand)
            error = self.estimator
            seen = (body.north + error.north, body.east + error.east, body.up + error.up)
            body.step(demand, seen, self.air, self.behaviour.lifts)
        else:  # motors stopped in the air: it falls
            demand.north, demand.velocity_north, demand.velocity_east = None, 0.0, 0.0
            demand.up, demand.velocity_up, demand.descend, demand.yaw = None, -9.0, 9.0, None
            body.step(demand, (body.north, body.east, body.up), self.air, False)
        if was_on_ground and not body.on_ground:
            self.flew = True
        elif body.on_ground and not was_on_ground:
            self.touched_at = self.time
            self.crashed = self.crashed or speed > _HARD_MPS or sink > _HARD_MPS

    def _slow(self) -> None:
        """What changes slowly enough for ten times a second."""
        self.estimator.draw()
        self.gps.draw()
        self.air = self.wind.draw()
        body = self.body
        self.battery.draw(PERIOD_S, flying=self.flying, speed=body.speed, climb=body.velocity_up)


class Behaviour:
    """One thing a vehicle does."""

    lifts = False  # may leave the ground
    landed: Landed = Landed.IN_AIR  # the landed state reported while it is in the air doing this
    done = False

    def steer(self, vehicle: Vehicle, demand: Demand) -> None:
        """Write what the body should do in this step."""
        raise NotImplementedError

    @property
    def target(self) -> Point | None:
        """Where it is going, if that can be said."""
        return None
