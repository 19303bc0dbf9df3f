"""What the vehicle has said about itself, as one immutable value.

A field that the vehicle has not sent, has sent as "unknown", or has not sent for too long (see `sources`) is None, or
NaN where the type is a plain float.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.geometry import moved
from service.mavlink.autopilots.base import Autopilot
from service.mavlink.events import Home, Target
from service.mavlink.framing import Message

_NEVER = -math.inf
_COURSE_IS_HEADING_MPS = 2.0  # slower, a multicopter may fly anywhere its nose does not point
_UNKNOWN_VELOCITY = (math.nan, math.nan, math.nan)


@dataclass(frozen=True, slots=True)
class Wind:
    """The air's own velocity over ground, towards north and east."""

    north_mps: float
    east_mps: float

    @property
    def speed_mps(self) -> float:
        """How fast the air moves."""
        return math.hypot(self.north_mps, self.east_mps)


@dataclass(frozen=True, slots=True)
class Gps:
    """One receiver as GPS_RAW_INT or GPS2_RAW has told it."""

    fix: int = 0
    satellites: int | None = None
    eph: float | None = None
    horizontal_accuracy_m: float | None = None


@dataclass(frozen=True, slots=True)
class Telemetry:
    """A snapshot; times are the service's clock at reception (-inf: never), angles degrees, metres, m/s."""

    heartbeat_time: float = _NEVER
    position_time: float = _NEVER
    status_time: float = _NEVER
    told: Mapping[str, float] = field(default_factory=dict)
    """When each message was last taken over."""
    old: frozenset[str] = frozenset()
    """The messages that were taken over, and have then stayed away for too long."""
    boot_time_s: float | None = None
    """The vehicle's own time since it booted."""

    system_id: int = 0
    autopilot: str = ""
    mode: str = ""
    guided: bool = False
    """The heartbeat shows the mode that flies repositions."""
    stopped: bool = False
    """It shows the mode that does nothing but stop, which is another one (ArduCopter's BRAKE)."""
    armed: bool = False
    system_status: int = 0
    landed_state: str = "undefined"
    ready_to_arm: bool = False
    link_lost: bool = False
    in_control: bool = False
    """The aircraft is ours to move: control was taken, and nobody took it back since."""
    control_reason: str = "control has not been taken"
    """Why it is not ours, when it is not."""

    lat: float = math.nan
    lon: float = math.nan
    alt_amsl_m: float = math.nan
    alt_home_m: float = math.nan
    """The last place known, however long ago: `position_known` tells. The height is over home as it was when the flight
    began (see `heights`)."""
    home_lifted_m: float = 0.0
    """How much higher home is now than it was then."""
    velocity_ned_mps: tuple[float, float, float] = _UNKNOWN_VELOCITY
    heading_deg: float = math.nan
    """Where the nose points: as the position says, else the attitude, else the course of an aircraft that is under way,
    else NaN."""
    roll_deg: float = math.nan
    pitch_deg: float = math.nan
    yaw_deg: float = math.nan

    battery_percent: float | None = None
    """Of the lowest of all batteries; None also when one of them does not tell its own any longer."""
    battery_voltage_v: float | None = None
    battery_current_a: float | None = None
    battery_consumed_mah: float | None = None
    battery_state: str = ""
    """The worst MAV_BATTERY_CHARGE_STATE, from "ok", "low" and "critical" to "failed"; nothing when none is told."""
    satellites: int | None = None
    fix: int = 0
    """GPS_FIX_TYPE; 3 is the first that has a position in space."""
    eph: float | None = None
    """Horizontal dilution of precision."""
    horizontal_accuracy_m: float | None = None
    estimator_ok: bool | None = None
    sensors_failed: tuple[str, ...] = ()
    """What SYS_STATUS calls enabled and not healthy, of all that a position is made from."""
    home: Home | None = None
    origin: Home | None = None
    """GPS_GLOBAL_ORIGIN: the origin of the estimator's local frame."""
    wind: Wind | None = None
    target: Target | None = None
    """What POSITION_TARGET_GLOBAL_INT names; its altitude is above home if `target_over_home`."""
    target_over_home: bool = False
    round_trip_s: float | None = None
    """What a question takes to the vehicle and its answer back (TIMESYNC); infinite right after a silence, until one is
    answered; None: it does not answer."""
    steered_mps: float | None = None
    """How fast the autopilot is to go where its guided mode follows a velocity or the like; None: it has a waypoint, or
    does not tell."""
    return_height_m: float | None = None
    """How high above home the autopilot flies home by itself, as its parameter says; None: not told."""
    most_speed_mps: float | None = None
    most_acceleration_mps2: float | None = None
    """How fast it flies and how hard it speeds up at most, over ground, as its parameters say; None: not told."""
    most_climb_mps: float | None = None
    most_descent_mps: float | None = None
    """How fast it climbs and sinks on its way to a target, as its parameters say; None: not told."""
    ground_distance_m: float | None = None
    """How far below the ground is, as a downward distance sensor measures it; None: it does not."""
    terrain_distance_m: float | None = None
    """How far below the ground is by the autopilot's own heights of it (TERRAIN_REPORT); None: it has none here."""
    sticks: float | None = None
    """How far the pilot's roll, pitch and yaw sticks are from the middle, 0 to 1; None when nobody tells."""
    prearm_ok: bool = False
    """The pre-arm bit of the last SYS_STATUS; `ready_to_arm` is the one to believe."""

    @property
    def position_known(self) -> bool:
        """Whether latitude, longitude and altitude are those of now."""
        return self.position_time > _NEVER and "GLOBAL_POSITION_INT" not in self.old

    @property
    def ground_speed_mps(self) -> float:
        """Horizontal speed over ground."""
        return math.hypot(self.velocity_ned_mps[0], self.velocity_ned_mps[1])

    @property
    def course_deg(self) -> float:
        """Where it flies, from true north; NaN when it is not under way, or that is not known."""
        north, east, _ = self.velocity_ned_mps
        moving = self.ground_speed_mps >= _COURSE_IS_HEADING_MPS
        return math.degrees(math.atan2(east, north)) % 360.0 if moving else math.nan

    @property
    def target_amsl(self) -> Target | None:
        """The target with its altitude above sea level; None while that is not known."""
        if self.target is None or not self.target_over_home:
            return self.target
        alt = self.target.alt_amsl_m + self.home_alt_amsl_m + self.home_lifted_m
        return replace(self.target, alt_amsl_m=alt) if math.isfinite(alt) else None

    @property
    def home_alt_amsl_m(self) -> float:
        """Altitude of what heights are over, home as it was when the flight began: as the two altitudes of the position
        say, which change together, else as home was told."""
        by_position = self.alt_amsl_m - self.alt_home_m
        if math.isfinite(by_position) or self.home is None:
            return by_position
        return self.home.alt_amsl_m - self.home_lifted_m


def valid_place(lat: float, lon: float) -> bool:
    """Whether this is a place on earth, and not the 0/0 that autopilots send before they know better."""
    return abs(lat) <= 90.0 and abs(lon) <= 180.0 and not (lat == 0.0 and lon == 0.0)


def heartbeat(t: Telemetry, m: Message, autopilot: Autopilot, now: float) -> Telemetry:
    """Take over the vehicle's HEARTBEAT: the one judge of its mode and of whether it is armed."""
    mode = autopilot.mode_name(m.base_mode, m.custom_mode)
    return replace(
        t,
        heartbeat_time=now,
        mode=mode,
        guided=mode == autopilot.guided_mode,
        stopped=mode == autopilot.stop_mode,
        armed=bool(m.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED),
        system_status=m.system_status,
        link_lost=False,
    )


def after_reboot(t: Telemetry) -> Telemetry:
    """What is still known of a vehicle that has rebooted: what its heartbeats say, and whose it is."""
    return Telemetry(
        heartbeat_time=t.heartbeat_time,
        system_id=t.system_id,
        autopilot=t.autopilot,
        mode=t.mode,
        guided=t.guided,
        stopped=t.stopped,
        armed=t.armed,
        system_status=t.system_status,
        link_lost=t.link_lost,
        in_control=t.in_control,
        control_reason=t.control_reason,
    )


def stopping_point(t: Telemetry, distance_m: float) -> Target:
    """The place that lies this far ahead on the present course, at the present altitude; here, where that is not known
    or it stands."""
    if not t.ground_speed_mps > 0.5:
        return Target(t.lat, t.lon, t.alt_amsl_m)
    north, east, _ = t.velocity_ned_mps
    ahead_s = distance_m / t.ground_speed_mps
    return Target(*moved((t.lat, t.lon), ahead_s * east, ahead_s * north), t.alt_amsl_m)
