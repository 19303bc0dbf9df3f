"""The stored mission and flying it."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from sim.autopilot.behaviours import GoTo, Land, TakeOff
from sim.autopilot.dialect import M
from sim.autopilot.motion import Demand
from sim.autopilot.vehicle import Behaviour, Point, Vehicle

_PASSED_M = 2.0


class Plan:
    """The three kinds of uploaded item lists, and which mission item is next."""

    def __init__(self) -> None:
        self.items: dict[int, list[Any]] = {0: [], 1: [], 2: []}
        self.current = 0
        self.reached = -1

    @property
    def mission(self) -> list[Any]:
        """The mission items."""
        return self.items[0]

    def select(self, seq: int) -> bool:
        """Make an item the next one; False if there is none with that number."""
        if not 0 <= seq < len(self.mission):
            return False
        self.current = seq
        return True


class FlyPlan(Behaviour):
    """Fly the mission from its current item on. What is no place is passed over."""

    lifts = True

    def __init__(
        self,
        plan: Plan,
        *,
        first: int,
        take_off: Callable[[float], TakeOff],
        land: Callable[[tuple[float, float] | None], Land],
        go_home: Callable[[], Behaviour],
    ) -> None:
        self._plan, self._first = plan, first
        self._take_off, self._land, self._go_home = take_off, land, go_home
        self._leg: Behaviour | None = None
        self._leg_seq, self._wait_until = -1, 0.0
        self._arrived = False
        self.over = False

    @property
    def target(self) -> Point | None:
        return None if self._leg is None else self._leg.target

    @property
    def holds(self) -> GoTo | None:
        """Where it stays, once the plan is flown and did not end in a landing."""
        return self._leg if self.over and isinstance(self._leg, GoTo) else None

    def steer(self, vehicle: Vehicle, demand: Demand) -> None:
        plan = self._plan
        plan.current = max(plan.current, self._first)
        if self._leg is None or (self._leg_seq != plan.current and not self.over):
            self._begin(vehicle)
        leg = self._leg
        if leg is None:
            leg = self._leg = GoTo(vehicle.seen)
        leg.steer(vehicle, demand)
        self.landed = leg.landed
        if not self.over and self._finished(vehicle, leg):
            plan.reached = plan.current
            if plan.current + 1 < len(plan.mission):
                plan.current += 1
                self._begin(vehicle)
            else:
                self.over = True
                seen = vehicle.seen
                self._leg = (
                    leg if isinstance(leg, GoTo | Land) else GoTo(Point(seen.north, seen.east, seen.up))
                )

    def _begin(self, vehicle: Vehicle) -> None:
        """Start on the current item, passing over the ones that are no flying."""
        plan = self._plan
        while plan.current < len(plan.mission):
            item = plan.mission[plan.current]
            self._leg_seq, self._arrived = plan.current, False
            up = height_of(item, vehicle)
            if item.command == M.MAV_CMD_NAV_TAKEOFF:
                self._leg = self._take_off(up)
                return
            if item.command == M.MAV_CMD_NAV_LAND:
                self._leg = self._land(place_of(item, vehicle))
                return
            if item.command == M.MAV_CMD_NAV_RETURN_TO_LAUNCH:
                self._leg = self._go_home()
                return
            if item.command in _PLACES:
                north, east = place_of(item, vehicle) or (vehicle.seen.north, vehicle.seen.east)
                if vehicle.body.on_ground:  # a waypoint first: up before across
                    self._leg = self._take_off(up)
                    self._leg_seq = -1 if isinstance(self._leg, GoTo) else plan.current
                    return
                yaw = None if not math.isfinite(item.param4) or item.param4 == 0.0 else float(item.param4)
                self._leg = GoTo(Point(north, east, up), yaw=yaw)
                return
            if item.command == M.MAV_CMD_DO_CHANGE_SPEED and item.param2 > 0:
                vehicle.speed_limit = float(item.param2)
            plan.reached = plan.current
            plan.current += 1
        plan.current = max(len(plan.mission) - 1, 0)
        self.over = True

    def _finished(self, vehicle: Vehicle, leg: Behaviour) -> bool:
        if isinstance(leg, TakeOff):
            item = self._plan.mission[self._plan.current]
            if leg.done and item.command in _PLACES:  # now across
                self._leg_seq = -1
                return False
            return leg.done
        if not isinstance(leg, GoTo):
            return False
        seen, target = vehicle.seen, leg.target
        if not self._arrived:
            gap = math.hypot(seen.north - target.north, seen.east - target.east)
            if gap < _PASSED_M and abs(seen.up - target.up) < _PASSED_M:
                self._arrived = True
                item = self._plan.mission[self._plan.current]
                stays = item.param1 if item.command in _WITH_STAY else 0.0
                self._wait_until = vehicle.time + (0.0 if math.isnan(stays) else stays)
        if self._arrived and self._plan.mission[self._plan.current].command == M.MAV_CMD_NAV_LOITER_UNLIM:
            return False
        return self._arrived and vehicle.time >= self._wait_until


_WITH_STAY = (M.MAV_CMD_NAV_WAYPOINT, M.MAV_CMD_NAV_LOITER_TIME)
_WAYPOINT, _LOITER_TIME = M.MAV_CMD_NAV_WAYPOINT, M.MAV_CMD_NAV_LOITER_TIME
_PLACES = (_WAYPOINT, _LOITER_TIME, M.MAV_CMD_NAV_LOITER_UNLIM, M.MAV_CMD_NAV_SPLINE_WAYPOINT)
_AMSL_FRAMES = (M.MAV_FRAME_GLOBAL, M.MAV_FRAME_GLOBAL_INT)


def height_of(item: Any, vehicle: Vehicle) -> float:
    """Height of a mission item in the home frame."""
    if not math.isfinite(item.z):
        return vehicle.seen.up
    home = 0.0 if vehicle.home is None else vehicle.home.up
    return float(item.z) - vehicle.ground_amsl if item.frame in _AMSL_FRAMES else float(item.z) + home


def place_of(item: Any, vehicle: Vehicle) -> tuple[float, float] | None:
    """Place of a mission item in the home frame; None where it is 0/0, which means here."""
    return None if item.x == 0 and item.y == 0 else vehicle.frame.from_e7(item.x, item.y)
