"""One message of each kind that the link reads, with everything in it known."""

from __future__ import annotations

from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

_GOOD = mavlink.ESTIMATOR_ATTITUDE | mavlink.ESTIMATOR_VELOCITY_HORIZ | mavlink.ESTIMATOR_POS_HORIZ_ABS
_Q = [1.0, 0.0, 0.0, 0.0]
_SENSORS = mavlink.MAV_SYS_STATUS_SENSOR_GPS | mavlink.MAV_SYS_STATUS_SENSOR_3D_MAG
_PREARM = mavlink.MAV_SYS_STATUS_PREARM_CHECK

SAMPLES: dict[str, Any] = {
    message.get_type(): message
    for message in (
        mavlink.MAVLink_global_position_int_message(
            1000, 470000000, 80000000, 509000, 20000, 300, 400, -100, 9000
        ),
        mavlink.MAVLink_attitude_message(1000, 0.1, -0.05, 1.5, 0.0, 0.0, 0.0),
        mavlink.MAVLink_sys_status_message(
            0, _SENSORS, _PREARM | mavlink.MAV_SYS_STATUS_SENSOR_GPS, 100, 15400, 1200, 80, 0, 0, 0, 0, 0, 0
        ),
        mavlink.MAVLink_battery_status_message(
            0, 1, 1, 3000, [15400, *[65535] * 9], 1200, 500, 100, 70, 0, 2, [0] * 4
        ),
        mavlink.MAVLink_gps_raw_int_message(
            0, 3, 470000000, 80000000, 489000, 70, 110, 0, 0, 12, 489000, 900
        ),
        mavlink.MAVLink_gps2_raw_message(
            0, 4, 470000000, 80000000, 489000, 60, 110, 0, 0, 14, 0, 0, 0, 489000, 800
        ),
        mavlink.MAVLink_extended_sys_state_message(0, 2),
        mavlink.MAVLink_home_position_message(470000000, 80000000, 489000, 0.0, 0.0, 0.0, _Q, 0.0, 0.0, 0.0),
        mavlink.MAVLink_gps_global_origin_message(470000000, 80000000, 489000),
        mavlink.MAVLink_wind_cov_message(0, 3.0, -4.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        mavlink.MAVLink_wind_message(270.0, 5.0, 0.0),
        mavlink.MAVLink_estimator_status_message(0, _GOOD, *[0.0] * 8),
        mavlink.MAVLink_ekf_status_report_message(_GOOD, *[0.0] * 5),
        mavlink.MAVLink_position_target_global_int_message(
            1000, 5, 0, 470000000, 80000000, 509.0, *[0.0] * 8
        ),
        mavlink.MAVLink_position_target_local_ned_message(1000, 1, 0x0DC7, *[0.0] * 11),
        mavlink.MAVLink_rc_channels_message(1000, 8, 1500, 1900, 1500, 1500, *[0] * 14, 200),
        mavlink.MAVLink_manual_control_message(1, 800, 0, 500, 0, 0),
        mavlink.MAVLink_distance_sensor_message(
            1000, 20, 12_000, 1730, 0, 0, mavlink.MAV_SENSOR_ROTATION_PITCH_270, 255, signal_quality=90
        ),
        mavlink.MAVLink_terrain_report_message(470000000, 80000000, 100, 480.0, 29.0, 0, 504),
    )
}
