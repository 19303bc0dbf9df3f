"""How the multicopter moves: a point mass with limited acceleration, jerk, tilt and climb, in moving air.

One step is a cascade, as in the real ones. The distance left gives the wanted speed (a parabola that a
constant deceleration can follow, straight near the target); the speed error gives the wanted acceleration,
cut at the acceleration and jerk limits; the airframe tilts towards it with a lag, which is what makes a real
multicopter overshoot a little; drag pulls it along with the air, and is leaned against as far as the tilt
allows. Plain floats only: sixty vehicles share one process.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from sim.autopilot.settings import STEP_S

_DRAG_PER_M = 0.03  # acceleration per squared airspeed: 15 m/s of air cost all the tilt there is
_INTO_M = 0.05  # so deep in a slope it has met the ground, even while it climbs
_TILT_MPS2 = 6.9  # horizontal acceleration at 35 degrees of tilt


@dataclass(frozen=True, slots=True)
class Limits:
    """What a flavour's default parameters allow. Metres and seconds."""

    cruise: float  # speed towards a target
    accelerate: float
    brake: float  # deceleration the approach to a target is planned with
    jerk: float
    position_gain: float  # 1/s, speed per metre close to the target
    velocity_gain: float  # 1/s
    lag: float  # s, time constant of the tilt
    climb: float
    descend: float
    vertical_accelerate: float
    yaw_rate: float  # degrees per second


class Demand:
    """What a mode wants of the body in this step: a position or a velocity for each of the two axes.

    `north` is None: fly the velocity (`velocity_north`, `velocity_east`); `up` is None: climb at
    `velocity_up`; `yaw` is None: keep the heading (degrees).
    """

    __slots__ = (
        "climb",
        "descend",
        "east",
        "north",
        "speed",
        "up",
        "velocity_east",
        "velocity_north",
        "velocity_up",
        "yaw",
    )

    def __init__(self, limits: Limits) -> None:
        self.north: float | None = None
        self.east = self.velocity_north = self.velocity_east = self.velocity_up = 0.0
        self.up: float | None = None
        self.yaw: float | None = None
        self.speed, self.climb, self.descend = limits.cruise, limits.climb, limits.descend


def approach_speed(distance: float, gain: float, deceleration: float) -> float:
    """Speed at which to come in when `distance` is left: gain * distance near, a square root far."""
    near = deceleration / (gain * gain)
    if distance <= near:
        return gain * distance
    return math.sqrt(2.0 * deceleration * (distance - 0.5 * near))


class Body:
    """Position (metres north, east, up of the home ground), velocity, acceleration and heading."""

    __slots__ = (
        "_climb_pull",
        "_east_pull",
        "_lean_east",
        "_lean_north",
        "_north_pull",
        "accel_up",
        "east",
        "floor",
        "limits",
        "north",
        "on_ground",
        "up",
        "velocity_east",
        "velocity_north",
        "velocity_up",
        "yaw",
        "yaw_rate",
    )

    def __init__(self, limits: Limits, yaw: float) -> None:
        self.limits = limits
        self.north = self.east = self.up = self.floor = 0.0  # floor: height of the ground below
        self.velocity_north = self.velocity_east = self.velocity_up = 0.0
        self.accel_up = self.yaw_rate = 0.0
        self.yaw, self.on_ground = yaw % 360.0, True
        self._north_pull = self._east_pull = self._climb_pull = (
            0.0  # wanted acceleration after the jerk limit
        )
        self._lean_north = self._lean_east = 0.0  # acceleration the tilt gives

    @property
    def speed(self) -> float:
        """Ground speed, m/s."""
        return math.hypot(self.velocity_north, self.velocity_east)

    @property
    def tilt(self) -> tuple[float, float]:
        """Acceleration the tilt gives to north and east, m/s^2."""
        return self._lean_north, self._lean_east

    def rest(self) -> None:
        """Stand still on the ground, as when the motors are off."""
        self.velocity_north = self.velocity_east = self.velocity_up = self.accel_up = 0.0
        self._north_pull = self._east_pull = self._climb_pull = 0.0
        self._lean_north = self._lean_east = self.yaw_rate = 0.0

    def step(
        self, demand: Demand, seen: tuple[float, float, float], wind: tuple[float, float], lift: bool
    ) -> None:
        """Move for one step of STEP_S.

        `seen` is where the estimator believes the body to be (north, east, up), which is what is steered by;
        `wind` the velocity of the air; `lift` False keeps a body that stands on the ground there.
        """
        if self.on_ground and not lift:
            self.rest()
            return
        self._vertical(demand, seen[2])
        if self.on_ground:
            self.velocity_north = self.velocity_east = 0.0
        else:
            self._horizontal(demand, seen[0], seen[1], wind[0], wind[1])
        self._turn(demand.yaw)

    def _horizontal(
        self, demand: Demand, north: float, east: float, air_north: float, air_east: float
    ) -> None:
        limits = self.limits
        along_north, along_east = 1.0, 0.0  # direction to the target
        if demand.north is None:
            want_north, want_east = demand.velocity_north, demand.velocity_east
        else:
            gap_north, gap_east = demand.north - north, demand.east - east
            distance = math.hypot(gap_north, gap_east)
            if distance > 1e-6:
                speed = approach_speed(distance, limits.position_gain, limits.brake)
                ratio = min(speed, demand.speed) / distance
                want_north, want_east = gap_north * ratio, gap_east * ratio
                along_north, along_east = gap_north / distance, gap_east / distance
            else:
                want_north = want_east = 0.0
        pull_north = (want_north - self.velocity_north) * limits.velocity_gain
        pull_east = (want_east - self.velocity_east) * limits.velocity_gain
        most = limits.accelerate  # for each component, so that a turn first loses the speed across
        along = min(max(pull_north * along_north + pull_east * along_east, -most), most)
        across = min(max(pull_east * along_north - pull_north * along_east, -most), most)
        pull_north = along * along_north - across * along_east
        pull_east = along * along_east + across * along_north
        change_north, change_east = pull_north - self._north_pull, pull_east - self._east_pull
        size = math.hypot(change_north, change_east)
        most = limits.jerk * STEP_S
        if size > most:
            change_north *= most / size
            change_east *= most / size
        self._north_pull += change_north
        self._east_pull += change_east
        rush_north, rush_east = air_north - self.velocity_north, air_east - self.velocity_east
        rush = _DRAG_PER_M * math.hypot(rush_north, rush_east)
        drag_north, drag_east = rush * rush_north, rush * rush_east
        share = STEP_S / limits.lag
        lean_north = self._lean_north + (self._north_pull - drag_north - self._lean_north) * share
        lean_east = self._lean_east + (self._east_pull - drag_east - self._lean_east) * share
        size = math.hypot(lean_north, lean_east)
        if size > _TILT_MPS2:
            lean_north *= _TILT_MPS2 / size
            lean_east *= _TILT_MPS2 / size
        self._lean_north, self._lean_east = lean_north, lean_east
        self.velocity_north += (lean_north + drag_north) * STEP_S
        self.velocity_east += (lean_east + drag_east) * STEP_S
        self.north += self.velocity_north * STEP_S
        self.east += self.velocity_east * STEP_S

    def _vertical(self, demand: Demand, up: float) -> None:
        limits = self.limits
        if demand.up is None:
            want = demand.velocity_up
        else:
            gap = demand.up - up
            want = math.copysign(approach_speed(abs(gap), limits.position_gain, 0.7), gap)
        want = min(max(want, -demand.descend), demand.climb)
        most = limits.vertical_accelerate
        pull = min(max((want - self.velocity_up) * 2.5, -most), most)
        jerk = limits.jerk * STEP_S
        self._climb_pull += min(max(pull - self._climb_pull, -jerk), jerk)
        self.accel_up = self._climb_pull
        self.velocity_up += self.accel_up * STEP_S
        self.up += self.velocity_up * STEP_S
        if self.up <= self.floor and (self.velocity_up <= 0.0 or self.up < self.floor - _INTO_M):
            self.up = self.floor
            self.on_ground = True
            self.velocity_up = self._climb_pull = 0.0
            self._north_pull = self._east_pull = self._lean_north = self._lean_east = 0.0
        elif self.up > self.floor:
            self.on_ground = False

    def _turn(self, yaw: float | None) -> None:
        if yaw is None:
            self.yaw_rate = 0.0
            return
        gap = (yaw - self.yaw + 180.0) % 360.0 - 180.0
        rate = min(max(gap * 2.0, -self.limits.yaw_rate), self.limits.yaw_rate)
        self.yaw_rate = rate
        self.yaw = (self.yaw + rate * STEP_S) % 360.0
