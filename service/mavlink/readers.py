"""From a message to the fields of `Telemetry` that it tells: one small function each.

A reader is given what is known of the message (see `sentinels`); it returns the fields, or None when the message
tells nothing that could be used. A field that the vehicle says it does not know is None, or NaN where the type is a
plain float.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.mavlink.batteries import Battery
from service.mavlink.events import Home, Target
from service.mavlink.sentinels import KnownFields
from service.mavlink.telemetry import Gps, Wind, valid_place

Fields = Mapping[str, object]
Reader = Callable[[KnownFields], Fields | None]

_LANDED = {1: "on_ground", 2: "in_air", 3: "takeoff", 4: "landing"}
_DEGREES_E7 = 1e7
_ESTIMATOR_NEEDS = (
    mavlink.ESTIMATOR_ATTITUDE | mavlink.ESTIMATOR_VELOCITY_HORIZ | mavlink.ESTIMATOR_POS_HORIZ_ABS
)
_EKF_FAULTS = mavlink.EKF_CONST_POS_MODE | mavlink.EKF_UNINITIALIZED | mavlink.EKF_GPS_GLITCHING
_IGNORES_POSITION = (
    mavlink.POSITION_TARGET_TYPEMASK_X_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_Y_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_Z_IGNORE
)
_IGNORES_VELOCITY = (
    mavlink.POSITION_TARGET_TYPEMASK_VX_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_VY_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_VZ_IGNORE
)
_OVER_HOME = (
    mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT,
    mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT,
)
_SENSORS = {
    mavlink.MAV_SYS_STATUS_SENSOR_3D_GYRO: "gyro",
    mavlink.MAV_SYS_STATUS_SENSOR_3D_ACCEL: "accelerometer",
    mavlink.MAV_SYS_STATUS_SENSOR_3D_MAG: "compass",
    mavlink.MAV_SYS_STATUS_SENSOR_ABSOLUTE_PRESSURE: "barometer",
    mavlink.MAV_SYS_STATUS_SENSOR_GPS: "GPS",
    mavlink.MAV_SYS_STATUS_AHRS: "attitude and position estimate",
}
_STICK_CHANNELS = ("chan1_raw", "chan2_raw", "chan4_raw")  # roll, pitch, yaw as both autopilots ship
_MID_US, _HALF_TRAVEL_US = 1500.0, 500.0


def _global_position(m: KnownFields) -> Fields | None:
    lat, lon = m.read("lat", _DEGREES_E7), m.read("lon", _DEGREES_E7)
    alt, above_home = m.read("alt", 1e3), m.read("relative_alt", 1e3)
    if lat is None or lon is None or alt is None or above_home is None or not valid_place(lat, lon):
        return None
    north, east, down = (_or_nan(m.read(name, 100.0)) for name in ("vx", "vy", "vz"))
    heading = m.read("hdg", 100.0)
    return {
        "lat": lat,
        "lon": lon,
        "alt_amsl_m": alt,
        "alt_home_m": above_home,
        "velocity_ned_mps": (north, east, down),
        "heading_deg": math.nan if heading is None else heading % 360.0,
    }


def _attitude(m: KnownFields) -> Fields | None:
    roll, pitch, yaw = m.read("roll"), m.read("pitch"), m.read("yaw")
    if roll is None or pitch is None or yaw is None:
        return None
    return {
        "roll_deg": math.degrees(roll),
        "pitch_deg": math.degrees(pitch),
        "yaw_deg": math.degrees(yaw) % 360.0,
    }


def _sys_status(m: KnownFields) -> Fields:
    health = m.flags("onboard_control_sensors_health")
    failed = m.flags("onboard_control_sensors_enabled") & ~health
    percent = m.read("battery_remaining")
    return {
        "prearm_ok": bool(health & mavlink.MAV_SYS_STATUS_PREARM_CHECK),
        "sensors_failed": tuple(name for bit, name in _SENSORS.items() if failed & bit),
        "battery": Battery(
            percent=percent,
            voltage_v=m.read("voltage_battery", 1e3),
            current_a=m.read("current_battery", 100.0),
        ),
    }


def _battery_status(m: KnownFields) -> Fields:
    cells = [*m.each("voltages", 1e3), *m.each("voltages_ext", 1e3)]
    return {
        "battery": Battery(
            number=m.flags("id"),
            percent=m.read("battery_remaining"),
            voltage_v=sum(cells) if cells else None,
            current_a=m.read("current_battery", 100.0),
            consumed_mah=m.read("current_consumed"),
            charge_state=int(m.read("charge_state") or 0),
        )
    }


def _gps(m: KnownFields) -> Fields:
    satellites = m.read("satellites_visible")
    return {
        "gps": Gps(
            fix=int(m.read("fix_type") or 0),
            satellites=None if satellites is None else int(satellites),
            eph=m.read("eph", 100.0),
            horizontal_accuracy_m=m.read("h_acc", 1e3),
        )
    }


def _extended_state(m: KnownFields) -> Fields:
    return {"landed_state": _LANDED.get(int(m.read("landed_state") or 0), "undefined")}


def _place(m: KnownFields) -> Home | None:
    lat, lon = m.read("latitude", _DEGREES_E7), m.read("longitude", _DEGREES_E7)
    alt = m.read("altitude", 1e3)
    if lat is None or lon is None or alt is None or not valid_place(lat, lon):
        return None
    return Home(lat, lon, alt)


def _home(m: KnownFields) -> Fields | None:
    home = _place(m)
    return None if home is None else {"home": home}


def _origin(m: KnownFields) -> Fields | None:
    origin = _place(m)
    return None if origin is None else {"origin": origin}


def _wind_cov(m: KnownFields) -> Fields:
    north, east = m.read("wind_x"), m.read("wind_y")
    return {"wind": None if north is None or east is None else Wind(north, east)}


def _wind(m: KnownFields) -> Fields:
    """ArduPilot's WIND says where the wind comes from."""
    direction, speed = m.read("direction"), m.read("speed")
    if direction is None or speed is None:
        return {"wind": None}
    towards = math.radians(direction + 180.0)
    return {"wind": Wind(speed * math.cos(towards), speed * math.sin(towards))}


def _estimator_status(m: KnownFields) -> Fields:
    flags = m.flags("flags")
    return {"estimator_ok": _estimates_position(flags) and not flags & mavlink.ESTIMATOR_GPS_GLITCH}


def _ekf_status(m: KnownFields) -> Fields:
    """The lower bits are those of ESTIMATOR_STATUS, the faults are not."""
    flags = m.flags("flags")
    return {"estimator_ok": _estimates_position(flags) and not flags & _EKF_FAULTS}


def _estimates_position(flags: int) -> bool:
    return bool(flags & _ESTIMATOR_NEEDS == _ESTIMATOR_NEEDS)


def _position_target(m: KnownFields) -> Fields:
    lat, lon, alt = m.read("lat_int", _DEGREES_E7), m.read("lon_int", _DEGREES_E7), m.read("alt")
    if lat is None or lon is None or alt is None or not valid_place(lat, lon):
        return {"target": None}
    if m.flags("type_mask") & _IGNORES_POSITION:
        return {"target": None}
    return {"target": Target(lat, lon, alt), "target_over_home": m.flags("coordinate_frame") in _OVER_HOME}


def _local_target(m: KnownFields) -> Fields:
    """ArduCopter tells by the mask what its guided mode follows: a place alone is a waypoint; and how fast it is to go
    otherwise."""
    mask = m.flags("type_mask")
    waypoint = not mask & _IGNORES_POSITION and mask & _IGNORES_VELOCITY == _IGNORES_VELOCITY
    speed = math.hypot(*(m.read(name) or 0.0 for name in ("vx", "vy", "vz")))
    return {"steered_mps": None if waypoint else speed}


def _rc_channels(m: KnownFields) -> Fields:
    """How far the roll, pitch and yaw sticks are from the middle; the throttle has none on many transmitters."""
    channels = [m.read(name) for name in _STICK_CHANNELS] if m.flags("chancount") else []
    far = [abs(us - _MID_US) / _HALF_TRAVEL_US for us in channels if us is not None]
    return {"sticks": max(far, default=None)}


def _distance_sensor(m: KnownFields) -> Fields | None:
    """One that looks down; in range, and with a signal (a quality of 1 is none)."""
    if m.flags("orientation") != mavlink.MAV_SENSOR_ROTATION_PITCH_270:
        return None
    nearest, farthest, there = (m.read(f"{name}_distance", 100.0) for name in ("min", "max", "current"))
    if nearest is None or farthest is None or there is None or m.read("signal_quality") == 1:
        return {"ground_distance_m": None}
    return {"ground_distance_m": there if nearest <= there <= farthest else None}


def _terrain_report(m: KnownFields) -> Fields:
    """A spacing of 0 says that the autopilot has no heights of the ground here."""
    return {"terrain_distance_m": None if m.read("spacing") is None else m.read("current_height")}


def _manual_control(m: KnownFields) -> Fields:
    sticks = [m.read(name, 1e3) for name in ("x", "y", "r")]
    return {"sticks": max((abs(stick) for stick in sticks if stick is not None), default=None)}


def _or_nan(value: float | None) -> float:
    return math.nan if value is None else value


READERS: dict[str, Reader] = {
    "GLOBAL_POSITION_INT": _global_position,
    "ATTITUDE": _attitude,
    "SYS_STATUS": _sys_status,
    "BATTERY_STATUS": _battery_status,
    "GPS_RAW_INT": _gps,
    "GPS2_RAW": _gps,
    "EXTENDED_SYS_STATE": _extended_state,
    "HOME_POSITION": _home,
    "GPS_GLOBAL_ORIGIN": _origin,
    "WIND_COV": _wind_cov,
    "WIND": _wind,
    "ESTIMATOR_STATUS": _estimator_status,
    "EKF_STATUS_REPORT": _ekf_status,
    "POSITION_TARGET_GLOBAL_INT": _position_target,
    "POSITION_TARGET_LOCAL_NED": _local_target,
    "DISTANCE_SENSOR": _distance_sensor,
    "TERRAIN_REPORT": _terrain_report,
    "RC_CHANNELS": _rc_channels,
    "MANUAL_CONTROL": _manual_control,
}
