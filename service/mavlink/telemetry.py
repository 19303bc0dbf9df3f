"""What the vehicle has last said about itself, as one immutable value.

`READERS` maps a MAVLink message to the function that takes it over. A field that the vehicle has not sent, or
has sent as "unknown" (each message has its own way to say so), is None, or NaN where the type is a plain
float.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.mavlink.autopilots.base import Autopilot
from service.mavlink.events import Target
from service.mavlink.framing import Message

_NEVER = -math.inf
_METRES_PER_DEGREE = 111_194.93
_LANDED = {0: "undefined", 1: "on_ground", 2: "in_air", 3: "takeoff", 4: "landing"}
_UINT16, _UINT8 = 0xFFFF, 0xFF
_ESTIMATOR_NEEDS = (
    mavlink.ESTIMATOR_ATTITUDE | mavlink.ESTIMATOR_VELOCITY_HORIZ | mavlink.ESTIMATOR_POS_HORIZ_ABS
)
_IGNORES_POSITION = (
    mavlink.POSITION_TARGET_TYPEMASK_X_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_Y_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_Z_IGNORE
)
_OVER_HOME = (
    mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT,
    mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT,
)


@dataclass(frozen=True, slots=True)
class Home:
    """HOME_POSITION: where the vehicle returns to; metres above mean sea level."""

    lat: float
    lon: float
    alt_amsl_m: float


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
class Telemetry:
    """A snapshot; times are the service's clock at reception (-inf: never), angles degrees, metres, m/s."""

    heartbeat_time: float = _NEVER
    position_time: float = _NEVER
    status_time: float = _NEVER
    boot_time_s: float | None = None
    """The vehicle's own time since it booted."""

    system_id: int = 0
    autopilot: str = ""
    mode: str = ""
    guided: bool = False
    """The heartbeat shows the mode that flies repositions."""
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
    velocity_ned_mps: tuple[float, float, float] = (0.0, 0.0, 0.0)
    heading_deg: float = math.nan
    roll_deg: float = math.nan
    pitch_deg: float = math.nan
    yaw_deg: float = math.nan

    battery_percent: float | None = None
    battery_voltage_v: float | None = None
    battery_current_a: float | None = None
    battery_consumed_mah: float | None = None
    satellites: int | None = None
    fix: int = 0
    """GPS_FIX_TYPE; 3 is the first that has a position in space."""
    eph: float | None = None
    """Horizontal dilution of precision."""
    horizontal_accuracy_m: float | None = None
    estimator_ok: bool | None = None
    home: Home | None = None
    wind: Wind | None = None
    target: Target | None = None
    """What POSITION_TARGET_GLOBAL_INT names."""
    prearm_ok: bool = False
    """The pre-arm bit of the last SYS_STATUS; `ready_to_arm` is the one to believe."""

    @property
    def position_known(self) -> bool:
        """Whether latitude, longitude and altitude are there at all."""
        return self.position_time > _NEVER

    @property
    def ground_speed_mps(self) -> float:
        """Horizontal speed over ground."""
        return math.hypot(self.velocity_ned_mps[0], self.velocity_ned_mps[1])

    @property
    def home_alt_amsl_m(self) -> float:
        """Altitude of home: as told, else as the two altitudes of the position say."""
        return self.home.alt_amsl_m if self.home is not None else self.alt_amsl_m - self.alt_home_m


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
        armed=t.armed,
        system_status=t.system_status,
        link_lost=t.link_lost,
        in_control=t.in_control,
        control_reason=t.control_reason,
    )


def stopping_point(t: Telemetry, distance_m: float) -> Target:
    """The place that lies this far ahead on the present course, at the present altitude."""
    north, east, _ = t.velocity_ned_mps
    ahead_s = distance_m / t.ground_speed_mps if t.ground_speed_mps > 0.5 else 0.0
    narrowing = max(math.cos(math.radians(t.lat)), 1e-6)
    lat = t.lat + ahead_s * north / _METRES_PER_DEGREE
    lon = t.lon + ahead_s * east / (_METRES_PER_DEGREE * narrowing)
    return Target(lat, (lon + 180.0) % 360.0 - 180.0, t.alt_amsl_m)


def _global_position(t: Telemetry, m: Message, now: float) -> Telemetry:
    lat, lon = m.lat * 1e-7, m.lon * 1e-7
    if not valid_place(lat, lon):
        return t
    heading = m.hdg / 100.0 % 360.0 if m.hdg != _UINT16 else t.yaw_deg
    return replace(
        t,
        position_time=now,
        lat=lat,
        lon=lon,
        alt_amsl_m=m.alt / 1000.0,
        alt_home_m=m.relative_alt / 1000.0,
        velocity_ned_mps=(m.vx / 100.0, m.vy / 100.0, m.vz / 100.0),
        heading_deg=heading,
    )


def _attitude(t: Telemetry, m: Message, now: float) -> Telemetry:
    if not (math.isfinite(m.roll) and math.isfinite(m.pitch) and math.isfinite(m.yaw)):
        return t
    return replace(
        t,
        roll_deg=math.degrees(m.roll),
        pitch_deg=math.degrees(m.pitch),
        yaw_deg=math.degrees(m.yaw) % 360.0,
    )


def _sys_status(t: Telemetry, m: Message, now: float) -> Telemetry:
    return replace(
        t,
        status_time=now,
        battery_percent=float(m.battery_remaining) if 0 <= m.battery_remaining <= 100 else None,
        battery_voltage_v=m.voltage_battery / 1000.0 if 0 < m.voltage_battery < _UINT16 else None,
        battery_current_a=m.current_battery / 100.0 if m.current_battery >= 0 else None,
        prearm_ok=bool(m.onboard_control_sensors_health & mavlink.MAV_SYS_STATUS_PREARM_CHECK),
    )


def _battery_status(t: Telemetry, m: Message, now: float) -> Telemetry:
    if m.id != 0:
        return t
    return replace(t, battery_consumed_mah=float(m.current_consumed) if m.current_consumed >= 0 else None)


def _gps_raw(t: Telemetry, m: Message, now: float) -> Telemetry:
    return replace(
        t,
        fix=m.fix_type,
        satellites=m.satellites_visible if m.satellites_visible != _UINT8 else None,
        eph=m.eph / 100.0 if m.eph != _UINT16 else None,
        horizontal_accuracy_m=m.h_acc / 1000.0 if m.h_acc else None,
    )


def _extended_state(t: Telemetry, m: Message, now: float) -> Telemetry:
    return replace(t, landed_state=_LANDED.get(m.landed_state, "undefined"))


def _home(t: Telemetry, m: Message, now: float) -> Telemetry:
    lat, lon = m.latitude * 1e-7, m.longitude * 1e-7
    return replace(t, home=Home(lat, lon, m.altitude / 1000.0)) if valid_place(lat, lon) else t


def _wind_cov(t: Telemetry, m: Message, now: float) -> Telemetry:
    known = math.isfinite(m.wind_x) and math.isfinite(m.wind_y)
    return replace(t, wind=Wind(m.wind_x, m.wind_y) if known else None)


def _wind(t: Telemetry, m: Message, now: float) -> Telemetry:
    """ArduPilot's WIND says where the wind comes from."""
    if not (math.isfinite(m.direction) and math.isfinite(m.speed)):
        return replace(t, wind=None)
    towards = math.radians(m.direction + 180.0)
    return replace(t, wind=Wind(m.speed * math.cos(towards), m.speed * math.sin(towards)))


def _estimator(t: Telemetry, m: Message, now: float) -> Telemetry:
    glitch = m.get_type() == "ESTIMATOR_STATUS" and m.flags & mavlink.ESTIMATOR_GPS_GLITCH
    return replace(t, estimator_ok=m.flags & _ESTIMATOR_NEEDS == _ESTIMATOR_NEEDS and not glitch)


def _position_target(t: Telemetry, m: Message, now: float) -> Telemetry:
    lat, lon, alt = m.lat_int * 1e-7, m.lon_int * 1e-7, m.alt
    if m.type_mask & _IGNORES_POSITION or not valid_place(lat, lon) or not math.isfinite(alt):
        return replace(t, target=None)
    if m.coordinate_frame in _OVER_HOME:
        alt += t.home_alt_amsl_m
    return replace(t, target=Target(lat, lon, alt))


READERS: dict[str, Callable[[Telemetry, Any, float], Telemetry]] = {
    "GLOBAL_POSITION_INT": _global_position,
    "ATTITUDE": _attitude,
    "SYS_STATUS": _sys_status,
    "BATTERY_STATUS": _battery_status,
    "GPS_RAW_INT": _gps_raw,
    "EXTENDED_SYS_STATE": _extended_state,
    "HOME_POSITION": _home,
    "WIND_COV": _wind_cov,
    "WIND": _wind,
    "ESTIMATOR_STATUS": _estimator,
    "EKF_STATUS_REPORT": _estimator,
    "POSITION_TARGET_GLOBAL_INT": _position_target,
}
