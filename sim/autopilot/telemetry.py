"""The messages an autopilot tells about itself with, one builder each. Units and sentinels as recorded."""

from __future__ import annotations

import math
import zlib
from collections.abc import Callable
from typing import Any

from sim.autopilot.dialect import NAN, M
from sim.autopilot.host import Host
from sim.autopilot.vehicle import Point

_STICKS_S = 1.0  # sticks that were heard longer ago are none
_GPS = M.MAV_SYS_STATUS_SENSOR_GPS
_AHRS = M.MAV_SYS_STATUS_AHRS
_BATTERY = M.MAV_SYS_STATUS_SENSOR_BATTERY
_PREARM = M.MAV_SYS_STATUS_PREARM_CHECK
_SENSORS = (
    M.MAV_SYS_STATUS_SENSOR_3D_GYRO
    | M.MAV_SYS_STATUS_SENSOR_3D_ACCEL
    | M.MAV_SYS_STATUS_SENSOR_3D_MAG
    | M.MAV_SYS_STATUS_SENSOR_ABSOLUTE_PRESSURE
    | _GPS
    | _AHRS
    | _BATTERY
)


def heartbeat(a: Host) -> Any:
    """HEARTBEAT."""
    base, custom = a.firmware.flavor.modes[a.firmware.mode]
    if a.vehicle.armed:
        base |= M.MAV_MODE_FLAG_SAFETY_ARMED
    return M.MAVLink_heartbeat_message(
        M.MAV_TYPE_QUADROTOR, a.firmware.flavor.autopilot, base, custom, a.firmware.system_status(), 3
    )


def global_position_int(a: Host) -> Any:
    """GLOBAL_POSITION_INT: what the vehicle believes."""
    body, error = a.vehicle.body, a.vehicle.estimator
    latitude, longitude = a.vehicle.frame.to_e7(body.north + error.north, body.east + error.east)
    up = body.up + error.up
    home = a.vehicle.home
    return M.MAVLink_global_position_int_message(
        a.time_ms,
        _i32(latitude),
        _i32(longitude),
        _mm(a.vehicle.ground_amsl + up),
        _mm(up - (0.0 if home is None else home.up)),
        _cm(body.velocity_north + error.velocity_north),
        _cm(body.velocity_east + error.velocity_east),
        _cm(-body.velocity_up - error.velocity_up),
        round(body.yaw * 100.0) % 36000,
    )


def _mm(metres: float) -> int:
    return _i32(round(metres * 1000.0))


def _cm(metres: float) -> int:
    return max(-32767, min(32767, round(metres * 100.0)))


def local_position_ned(a: Host) -> Any:
    """LOCAL_POSITION_NED: from the estimator's origin."""
    body, error, origin = a.vehicle.body, a.vehicle.estimator, a.vehicle.origin
    return M.MAVLink_local_position_ned_message(
        a.time_ms,
        body.north + error.north - origin.north,
        body.east + error.east - origin.east,
        origin.up - body.up - error.up,
        body.velocity_north + error.velocity_north,
        body.velocity_east + error.velocity_east,
        -body.velocity_up - error.velocity_up,
    )


def _angles(a: Host) -> tuple[float, float, float]:
    """Roll, pitch and yaw in radians, from the tilt that makes the acceleration."""
    yaw = math.radians(a.vehicle.body.yaw)
    north, east = a.vehicle.body.tilt
    forward = north * math.cos(yaw) + east * math.sin(yaw)
    right = -north * math.sin(yaw) + east * math.cos(yaw)
    return math.atan(right / 9.81), -math.atan(forward / 9.81), (yaw + math.pi) % (2 * math.pi) - math.pi


def attitude(a: Host) -> Any:
    """ATTITUDE."""
    roll, pitch, yaw = _angles(a)
    return M.MAVLink_attitude_message(
        a.time_ms, roll, pitch, yaw, 0.0, 0.0, math.radians(a.vehicle.body.yaw_rate)
    )


def attitude_quaternion(a: Host) -> Any:
    """ATTITUDE_QUATERNION."""
    roll, pitch, yaw = _angles(a)
    cr, sr, cp, sp = math.cos(roll / 2), math.sin(roll / 2), math.cos(pitch / 2), math.sin(pitch / 2)
    cy, sy = math.cos(yaw / 2), math.sin(yaw / 2)
    return M.MAVLink_attitude_quaternion_message(
        a.time_ms,
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        0.0,
        0.0,
        math.radians(a.vehicle.body.yaw_rate),
    )


def sys_status(a: Host) -> Any:
    """SYS_STATUS; the pre-arm check is ready-to-arm, in health always, elsewhere as the flavour has it."""
    firmware, battery = a.firmware, a.vehicle.battery
    present = enabled = health = _SENSORS
    if firmware.flavor.prearm_bit_everywhere:
        present, enabled = present | _PREARM, enabled | _PREARM
    if a.vehicle.gps.lost:
        health &= ~_GPS
    if not firmware.position_known:
        health &= ~_AHRS
    if firmware.prearm_healthy:
        health |= _PREARM
    return M.MAVLink_sys_status_message(
        present,
        enabled,
        health,
        160,
        round(battery.voltage * 1000.0),
        round(battery.current_a * 100.0),
        battery.percent,
        *(0,) * 6,
    )


def battery_status(a: Host) -> Any:
    """BATTERY_STATUS: the whole pack in the first cell, the time remaining unknown (0)."""
    battery = a.vehicle.battery
    charge = battery.charge
    state = M.MAV_BATTERY_CHARGE_STATE_OK
    if charge < 0.07:
        state = M.MAV_BATTERY_CHARGE_STATE_CRITICAL
    elif charge < 0.15:
        state = M.MAV_BATTERY_CHARGE_STATE_LOW
    return M.MAVLink_battery_status_message(
        0,
        M.MAV_BATTERY_FUNCTION_ALL,
        M.MAV_BATTERY_TYPE_LIPO,
        32767,
        [round(battery.voltage * 1000.0)] + [65535] * 9,
        round(battery.current_a * 100.0),
        round(battery.used_mah),
        -1,
        battery.percent,
        0,
        state,
    )


def gps_raw_int(a: Host) -> Any:
    """GPS_RAW_INT: the receiver's own position and error."""
    body, gps = a.vehicle.body, a.vehicle.gps
    stamp = a.vehicle.steps * 20_000
    if gps.lost:
        return M.MAVLink_gps_raw_int_message(stamp, 1, 0, 0, 0, 65535, 65535, 65535, 65535, 0)
    latitude, longitude = a.vehicle.frame.to_e7(body.north + gps.north, body.east + gps.east)
    course = math.degrees(math.atan2(body.velocity_east, body.velocity_north)) % 360.0
    return M.MAVLink_gps_raw_int_message(
        stamp,
        3,
        latitude,
        longitude,
        round((a.vehicle.ground_amsl + body.up + gps.up) * 1000.0),
        90,
        130,
        round(body.speed * 100.0),
        round(course * 100.0) % 36000,
        gps.satellites,
        round((a.vehicle.ground_amsl + body.up + gps.up) * 1000.0),
        900,
        1780,
        400,
        0,
    )


def extended_sys_state(a: Host) -> Any:
    """EXTENDED_SYS_STATE."""
    return M.MAVLink_extended_sys_state_message(a.firmware.flavor.vtol_state, int(a.vehicle.landed))


def home_position(a: Host) -> Any | None:
    """HOME_POSITION, once there is a home."""
    home, origin = a.vehicle.home, a.vehicle.origin
    if home is None:
        return None
    latitude, longitude = a.vehicle.frame.to_e7(home.north, home.east)
    return M.MAVLink_home_position_message(
        _i32(latitude),
        _i32(longitude),
        _mm(a.vehicle.amsl(home.up)),
        home.north - origin.north,
        home.east - origin.east,
        origin.up - home.up,
        [1.0, 0.0, 0.0, 0.0],
        0.0,
        0.0,
        0.0,
        _set_at(a, home),
    )


def gps_global_origin(a: Host) -> Any:
    """GPS_GLOBAL_ORIGIN: the origin of the local frame."""
    origin = a.vehicle.origin
    latitude, longitude = a.vehicle.frame.to_e7(origin.north, origin.east)
    altitude = _mm(a.vehicle.amsl(origin.up))
    return M.MAVLink_gps_global_origin_message(latitude, longitude, altitude, _set_at(a, origin))


def _set_at(a: Host, place: Point) -> int:
    """The stamp of home or origin, for a flavour that gives one: another one for another place only."""
    return 1 + zlib.crc32(repr(place).encode()) if a.firmware.flavor.stamps_places else 0


def vfr_hud(a: Host) -> Any:
    """VFR_HUD."""
    body, error = a.vehicle.body, a.vehicle.estimator
    speed = math.hypot(body.velocity_north + error.velocity_north, body.velocity_east + error.velocity_east)
    return M.MAVLink_vfr_hud_message(
        0.0,
        speed,
        round(body.yaw) % 360,
        0 if not a.vehicle.armed else 10 if body.on_ground else 50,
        a.vehicle.amsl(body.up + error.up),
        body.velocity_up + error.velocity_up,
    )


def position_target_global_int(a: Host) -> Any | None:
    """POSITION_TARGET_GLOBAL_INT: the final target at once, altitude AMSL."""
    target = a.firmware.target_or_seen()
    frame, mask, stays_silent = a.firmware.flavor.target_fields
    if (stays_silent and not a.vehicle.flying) or a.firmware.steered is not None:
        return None
    latitude, longitude = a.vehicle.frame.to_e7(target.north, target.east)
    return M.MAVLink_position_target_global_int_message(
        a.time_ms, frame, mask, _i32(latitude), _i32(longitude), a.vehicle.amsl(target.up), *(0.0,) * 8
    )


def position_target_local_ned(a: Host) -> Any | None:
    """POSITION_TARGET_LOCAL_NED of ArduCopter in GUIDED: the place it flies to, or that it flies a velocity."""
    if not a.firmware.flavor.tells_local_target or a.firmware.mode != "GUIDED":
        return None
    position, rest = 0x0007, 0x0C00  # what is ignored: the yaw always
    frame = M.MAV_FRAME_LOCAL_NED
    if a.firmware.steered is not None:
        north, east, up = a.firmware.steered
        return M.MAVLink_position_target_local_ned_message(
            a.time_ms, frame, position | rest, 0.0, 0.0, 0.0, north, east, -up, *(0.0,) * 5
        )
    target, origin = a.firmware.target_or_seen(), a.vehicle.origin
    place = target.north - origin.north, target.east - origin.east, origin.up - target.up
    return M.MAVLink_position_target_local_ned_message(a.time_ms, frame, 0x01F8 | rest, *place, *(0.0,) * 8)


def _i32(value: int) -> int:
    return max(-(2**31), min(2**31 - 1, value))


def altitude(a: Host) -> Any:
    """ALTITUDE."""
    up = a.vehicle.seen.up
    home_up = 0.0 if a.vehicle.home is None else a.vehicle.home.up
    amsl = a.vehicle.amsl(up)
    return M.MAVLink_altitude_message(a.vehicle.steps * 20_000, amsl, amsl, up, up - home_up, NAN, NAN)


def system_time(a: Host) -> Any:
    """SYSTEM_TIME."""
    return M.MAVLink_system_time_message(round((a.settings.epoch_s + a.vehicle.time) * 1e6), a.time_ms)


def mission_current(a: Host) -> Any:
    """MISSION_CURRENT."""
    plan = a.firmware.plan
    return M.MAVLink_mission_current_message(plan.current, len(plan.mission))


def estimator_status(a: Host) -> Any:
    """ESTIMATOR_STATUS: all well, or the horizontal position and velocity out of bounds."""
    known = a.firmware.position_known
    good = 1 | 2 | 4 | 8 | 16 | 32 | 512 | 256
    flags = good if known else 1 | 4 | 32 | 128 | 1024
    ratio = 0.05 if known else 2.0
    return M.MAVLink_estimator_status_message(
        a.vehicle.steps * 20_000, flags, ratio, ratio, 0.05, 0.05, 0.0, 0.0, 0.5 if known else 50.0, 0.8
    )


def ekf_status_report(a: Host) -> Any:
    """EKF_STATUS_REPORT, ArduPilot's own."""
    known = a.firmware.position_known
    flags = 1 | 2 | 4 | 8 | 16 | 32 | 256 | 512 if known else 1 | 4 | 32 | 128
    ratio = 0.05 if known else 2.0
    return M.MAVLink_ekf_status_report_message(flags, ratio, ratio, 0.05, 0.05, 0.0)


def gps2_raw(a: Host) -> Any:
    """GPS2_RAW: a second receiver, which says what the first one does."""
    first = gps_raw_int(a)
    place = (first.lat, first.lon, first.alt, first.eph, first.epv, first.vel, first.cog)
    return M.MAVLink_gps2_raw_message(
        first.time_usec, first.fix_type, *place, first.satellites_visible, 0, 0, yaw=0
    )


def wind(a: Host) -> Any | None:
    """WIND, ArduPilot's own: where it comes from. None where the estimator does not know the wind."""
    if not a.vehicle.tells_wind:
        return None
    north, east = a.vehicle.air
    return M.MAVLink_wind_message(math.degrees(math.atan2(-east, -north)), math.hypot(north, east), 0.0)


def wind_cov(a: Host) -> Any | None:
    """WIND_COV, PX4's: where it goes to. None where the estimator does not know the wind."""
    if not a.vehicle.tells_wind:
        return None
    north, east = a.vehicle.air
    return M.MAVLink_wind_cov_message(a.vehicle.steps * 20_000, north, east, 0.0, 0.5, 0.0, NAN, NAN, NAN)


def distance_sensor(a: Host) -> Any | None:
    """DISTANCE_SENSOR: a lidar that looks down, from 0.2 to 120 m; None where there is none."""
    rise = a.vehicle.rangefinder_rise
    if rise is None:
        return None
    body = a.vehicle.body
    seen = max(0.0, body.up - a.vehicle.ground.height(body.north, body.east) - rise)
    return M.MAVLink_distance_sensor_message(
        a.time_ms, 20, 12000, min(round(seen * 100.0), 12001), M.MAV_DISTANCE_SENSOR_LASER, 0,
        M.MAV_SENSOR_ROTATION_PITCH_270, 255,
    )  # fmt: skip


def terrain_report(a: Host) -> Any | None:
    """TERRAIN_REPORT, ArduPilot's: the height above its own heights of the ground; a spacing of 0 where it has none."""
    body, rise = a.vehicle.body, a.vehicle.terrain_rise
    lat, lon = a.vehicle.frame.to_e7(body.north, body.east)
    if rise is None:
        return M.MAVLink_terrain_report_message(lat, lon, 0, 0.0, 0.0, 0, 0)
    ground = a.vehicle.ground.height(body.north, body.east) + rise
    return M.MAVLink_terrain_report_message(
        lat, lon, 100, a.vehicle.amsl(ground), body.up - ground, 0, 504,
    )  # fmt: skip


def rc_channels(a: Host) -> Any | None:
    """RC_CHANNELS: the sticks in microseconds. Without a pilot PX4 tells none, ArduPilot's simulator neutral ones."""
    sticks, flavor = a.vehicle.sticks, a.firmware.flavor
    heard = a.vehicle.time - sticks.heard_at < _STICKS_S
    if not heard and not flavor.sticks_at_rest:
        return None
    moved = (sticks.roll, -sticks.pitch, sticks.throttle, sticks.yaw) if heard else (0.0, 0.0, -1.0, 0.0)
    first = [round(1500.0 + 500.0 * each) for each in moved]
    return M.MAVLink_rc_channels_message(a.time_ms, 8, *first, *(1500,) * 4, *(65535,) * 10, 255)


def manual_control(a: Host) -> Any | None:
    """MANUAL_CONTROL, as PX4 tells what it takes from the sticks; None without a pilot."""
    sticks = a.vehicle.sticks
    if a.vehicle.time - sticks.heard_at >= _STICKS_S:
        return None
    pitch, roll, yaw = (round(1000.0 * each) for each in (sticks.pitch, sticks.roll, sticks.yaw))
    return M.MAVLink_manual_control_message(
        a.settings.sysid, pitch, roll, round(500.0 + 500.0 * sticks.throttle), yaw, 0
    )


def autopilot_version(a: Host) -> Any:
    """AUTOPILOT_VERSION."""
    firmware = a.firmware
    return M.MAVLink_autopilot_version_message(
        firmware.flavor.capabilities,
        firmware.flavor.version,
        firmware.flavor.version,
        0,
        0,
        [0] * 8,
        [0] * 8,
        [0] * 8,
        0,
        0,
        a.settings.sysid + 0x526F6900,
    )


Builder = Callable[[Host], Any]

BUILDERS: dict[int, Builder] = {
    M.MAVLINK_MSG_ID_HEARTBEAT: heartbeat,
    M.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: global_position_int,
    M.MAVLINK_MSG_ID_LOCAL_POSITION_NED: local_position_ned,
    M.MAVLINK_MSG_ID_ATTITUDE: attitude,
    M.MAVLINK_MSG_ID_ATTITUDE_QUATERNION: attitude_quaternion,
    M.MAVLINK_MSG_ID_SYS_STATUS: sys_status,
    M.MAVLINK_MSG_ID_BATTERY_STATUS: battery_status,
    M.MAVLINK_MSG_ID_GPS_RAW_INT: gps_raw_int,
    M.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: extended_sys_state,
    M.MAVLINK_MSG_ID_HOME_POSITION: home_position,
    M.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN: gps_global_origin,
    M.MAVLINK_MSG_ID_VFR_HUD: vfr_hud,
    M.MAVLINK_MSG_ID_POSITION_TARGET_GLOBAL_INT: position_target_global_int,
    M.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED: position_target_local_ned,
    M.MAVLINK_MSG_ID_ALTITUDE: altitude,
    M.MAVLINK_MSG_ID_SYSTEM_TIME: system_time,
    M.MAVLINK_MSG_ID_MISSION_CURRENT: mission_current,
    M.MAVLINK_MSG_ID_ESTIMATOR_STATUS: estimator_status,
    M.MAVLINK_MSG_ID_EKF_STATUS_REPORT: ekf_status_report,
    M.MAVLINK_MSG_ID_AUTOPILOT_VERSION: autopilot_version,
    M.MAVLINK_MSG_ID_GPS2_RAW: gps2_raw,
    M.MAVLINK_MSG_ID_WIND: wind,
    M.MAVLINK_MSG_ID_WIND_COV: wind_cov,
    M.MAVLINK_MSG_ID_DISTANCE_SENSOR: distance_sensor,
    M.MAVLINK_MSG_ID_TERRAIN_REPORT: terrain_report,
    M.MAVLINK_MSG_ID_RC_CHANNELS: rc_channels,
    M.MAVLINK_MSG_ID_MANUAL_CONTROL: manual_control,
}
