"""What a flavour of autopilot is, as one frozen record: its numbers, its modes, and how it words its answers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from sim.autopilot.commands import FAILED, REJECTED, Result, Results
from sim.autopilot.dialect import M
from sim.autopilot.motion import Limits
from sim.autopilot.parameter_tables import ARDUCOPTER_PARAMETERS, PX4_PARAMETERS
from sim.autopilot.parameters import Parameter


@dataclass(frozen=True, slots=True)
class Flavor:
    """One flavour; what it does, its firmware class says. Times are seconds of vehicle time."""

    # ---- who it is
    autopilot: int  # MAV_AUTOPILOT
    version: int  # AUTOPILOT_VERSION.flight_sw_version
    capabilities: int  # MAV_PROTOCOL_CAPABILITY bits
    vtol_state: int
    # ---- how it flies
    limits: Limits
    cells: int  # of the battery
    position_error_m: float
    velocity_error_mps: float
    # ---- its modes
    modes: Mapping[str, tuple[int, int]]  # mode -> base_mode bits, custom_mode
    boot_mode: str
    guided_mode: str
    return_mode: str
    land_mode: str
    pilot_mode: str  # the mode a pilot takes over with
    hold_mode: str  # the mode a pilot lets it hold with
    failsafe_hold: tuple[str, str]  # the mode and the text of a failsafe that holds first
    setpoint_mode: str  # the mode in which it follows a stream of setpoints
    pauses_by: int  # MAV_CMD with which a ground station has it pause
    # ---- when it does what
    stamps_places: bool  # home and origin are told with the time at which they were set
    home_share: float  # of the time from boot to ready, until home is set
    landing_takes_s: float  # touch-down until ON_GROUND
    disarm_after_landing_s: float
    # ---- what it tells
    default_streams_hz: Mapping[int, float]
    heartbeat_on_mode_change: bool
    prearm_bit_everywhere: bool  # also in SYS_STATUS present and enabled
    estimator_message: int  # the one that tells the estimator's state
    foreign_messages: frozenset[int]  # those only the other flavour has
    not_ready_text: str  # why it does not arm while its estimator is not ready
    not_ready_warning: str  # what it says of it unasked
    sticks_at_rest: bool  # RC_CHANNELS also while nobody holds sticks
    target_fields: tuple[int, int, bool]  # POSITION_TARGET: frame, type mask, silent on the ground
    tells_local_target: bool  # POSITION_TARGET_LOCAL_NED in the guided mode
    # ---- how it answers
    unknown_request: Results  # REQUEST_MESSAGE for an id it does not know
    unknown_interval: Results  # SET_MESSAGE_INTERVAL for an id it does not know
    requests_interval_message: bool  # REQUEST_MESSAGE may ask for MESSAGE_INTERVAL
    serves_data_streams: bool  # REQUEST_DATA_STREAM
    reboot_refusal: Results  # while armed
    # ---- missions and fences
    fence_frame: int  # frame of downloaded fence items
    plan_is_asked_int: bool  # switches to MISSION_REQUEST_INT once it has seen an _INT item
    refuses_wrong_seq: bool  # MISSION_ACK INVALID_SEQUENCE for an item that was not asked for
    upload_retry_s: float
    upload_timeout_s: float
    # ---- parameters
    parameters: Sequence[Parameter]  # with their defaults
    parameters_as_bits: bool  # integers as raw bits in the float field
    tells_index_by_name: bool  # param_index of an answer to a read by name
    echoes_when_changed: int  # PARAM_VALUE messages after a PARAM_SET that changed the value
    critical_battery: tuple[str, Mapping[str, float]]  # the parameter, and its values by action
    idle_disarm_s: float = 10.0


PX4_MAIN = {"MANUAL": 1, "ALTCTL": 2, "POSCTL": 3, "AUTO": 4, "ACRO": 5, "OFFBOARD": 6, "STABILIZED": 7}
_SUB = {"READY": 1, "TAKEOFF": 2, "LOITER": 3, "MISSION": 4, "RTL": 5, "LAND": 6, "FOLLOW": 8, "PRECLAND": 9}


def px4_mode(main: int, sub: int = 0) -> int:
    """PX4's custom mode: a main mode, and below AUTO which of them."""
    return main << 16 | sub << 24


_PX4_MODES: dict[str, tuple[int, int]] = {
    f"AUTO_{name}": (29, px4_mode(4, sub)) for name, sub in _SUB.items()
}
_PX4_MODES |= {
    name: (81, px4_mode(main)) for name, main in PX4_MAIN.items() if name not in ("AUTO", "OFFBOARD")
}
_PX4_MODES["OFFBOARD"] = (17, px4_mode(6))

PX4 = Flavor(
    autopilot=M.MAV_AUTOPILOT_PX4,
    version=1 << 24 | 16 << 16 | 255,
    capabilities=59647 & ~M.MAV_PROTOCOL_CAPABILITY_FTP,  # as recorded, without the file transfer
    vtol_state=0,
    limits=Limits(
        cruise=4.9,
        accelerate=2.2,
        brake=0.45,
        jerk=5.2,
        position_gain=2.2,
        velocity_gain=1.15,
        lag=0.45,
        climb=2.9,
        descend=1.5,
        vertical_accelerate=2.5,
        yaw_rate=60.0,
    ),
    cells=4,
    position_error_m=0.45,
    velocity_error_mps=0.06,
    modes=_PX4_MODES,
    boot_mode="AUTO_LOITER",
    guided_mode="AUTO_LOITER",
    return_mode="AUTO_RTL",
    land_mode="AUTO_LAND",
    pilot_mode="POSCTL",
    hold_mode="AUTO_LOITER",
    failsafe_hold=("AUTO_LOITER", "Failsafe activated: entering Hold for 5 seconds"),
    setpoint_mode="OFFBOARD",
    pauses_by=M.MAV_CMD_DO_REPOSITION,
    stamps_places=True,
    home_share=0.2,
    landing_takes_s=1.0,
    disarm_after_landing_s=2.0,
    default_streams_hz={
        M.MAVLINK_MSG_ID_SYS_STATUS: 1.0,
        M.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: 50.0,
        M.MAVLINK_MSG_ID_ATTITUDE: 50.0,
        M.MAVLINK_MSG_ID_ATTITUDE_QUATERNION: 10.0,
        M.MAVLINK_MSG_ID_LOCAL_POSITION_NED: 10.0,
        M.MAVLINK_MSG_ID_BATTERY_STATUS: 0.5,
        M.MAVLINK_MSG_ID_GPS_RAW_INT: 5.0,
        M.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: 1.0,
        M.MAVLINK_MSG_ID_HOME_POSITION: 0.5,
        M.MAVLINK_MSG_ID_VFR_HUD: 4.0,
        M.MAVLINK_MSG_ID_ALTITUDE: 1.0,
        M.MAVLINK_MSG_ID_ESTIMATOR_STATUS: 0.5,
        M.MAVLINK_MSG_ID_MISSION_CURRENT: 1.0,
        M.MAVLINK_MSG_ID_POSITION_TARGET_GLOBAL_INT: 5.0,
        M.MAVLINK_MSG_ID_RC_CHANNELS: 5.0,  # while there are sticks
        M.MAVLINK_MSG_ID_DISTANCE_SENSOR: 10.0,  # where there is one
    },
    heartbeat_on_mode_change=False,
    prearm_bit_everywhere=False,
    estimator_message=M.MAVLINK_MSG_ID_ESTIMATOR_STATUS,
    foreign_messages=frozenset(
        {
            M.MAVLINK_MSG_ID_EKF_STATUS_REPORT,
            M.MAVLINK_MSG_ID_WIND,
            M.MAVLINK_MSG_ID_TERRAIN_REPORT,
        }
    ),
    not_ready_text="Resolve system health failures first",
    not_ready_warning="Preflight Fail: ekf2 missing data",
    sticks_at_rest=False,
    target_fields=(M.MAV_FRAME_GLOBAL_INT, 0, True),
    tells_local_target=False,
    unknown_request=(Result.DENIED,),
    unknown_interval=(Result.FAILED,),
    requests_interval_message=False,
    serves_data_streams=False,
    reboot_refusal=REJECTED,
    fence_frame=M.MAV_FRAME_GLOBAL_INT,
    plan_is_asked_int=True,
    refuses_wrong_seq=False,
    upload_retry_s=0.25,
    upload_timeout_s=5.0,
    parameters=PX4_PARAMETERS,
    parameters_as_bits=True,
    tells_index_by_name=True,
    echoes_when_changed=2,
    critical_battery=("COM_LOW_BAT_ACT", {"warn": 0.0, "land": 2.0, "return": 3.0}),
)

_ARDUCOPTER_NUMBERS = {
    "STABILIZE": 0,
    "ACRO": 1,
    "ALT_HOLD": 2,
    "AUTO": 3,
    "GUIDED": 4,
    "LOITER": 5,
    "RTL": 6,
    "CIRCLE": 7,
    "LAND": 9,
    "POSHOLD": 16,
    "BRAKE": 17,
    "SMART_RTL": 21,
}
_ARDUCOPTER_MODES: dict[str, tuple[int, int]] = {
    name: (81 if name in ("STABILIZE", "ACRO", "ALT_HOLD") else 89, number)
    for name, number in _ARDUCOPTER_NUMBERS.items()
}

ARDUCOPTER = Flavor(
    autopilot=M.MAV_AUTOPILOT_ARDUPILOTMEGA,
    version=4 << 24 | 7 << 16,
    capabilities=64495 & ~M.MAV_PROTOCOL_CAPABILITY_FTP,  # as recorded, without the file transfer
    vtol_state=M.MAV_VTOL_STATE_MC,
    limits=Limits(
        cruise=10.0,
        accelerate=2.9,
        brake=1.17,
        jerk=6.2,
        position_gain=0.94,
        velocity_gain=1.32,
        lag=0.28,
        climb=2.5,
        descend=1.5,
        vertical_accelerate=2.5,
        yaw_rate=90.0,
    ),
    cells=3,
    position_error_m=0.05,
    velocity_error_mps=0.02,
    modes=_ARDUCOPTER_MODES,
    boot_mode="STABILIZE",
    guided_mode="GUIDED",
    return_mode="RTL",
    land_mode="LAND",
    pilot_mode="LOITER",
    hold_mode="LOITER",
    failsafe_hold=("BRAKE", "Radio Failsafe"),
    setpoint_mode="GUIDED",
    pauses_by=M.MAV_CMD_DO_PAUSE_CONTINUE,
    stamps_places=False,
    home_share=0.8,
    landing_takes_s=1.6,
    disarm_after_landing_s=0.5,
    default_streams_hz={},
    heartbeat_on_mode_change=True,
    prearm_bit_everywhere=True,
    estimator_message=M.MAVLINK_MSG_ID_EKF_STATUS_REPORT,
    foreign_messages=frozenset(
        {
            M.MAVLINK_MSG_ID_ESTIMATOR_STATUS,
            M.MAVLINK_MSG_ID_WIND_COV,
            M.MAVLINK_MSG_ID_MANUAL_CONTROL,
            M.MAVLINK_MSG_ID_ALTITUDE,
        }
    ),
    not_ready_text="Need Position Estimate",
    not_ready_warning="PreArm: Need Position Estimate",
    sticks_at_rest=True,
    target_fields=(M.MAV_FRAME_GLOBAL, 65016, False),
    tells_local_target=True,
    unknown_request=(Result.FAILED,),
    unknown_interval=(Result.DENIED,),
    requests_interval_message=True,
    serves_data_streams=True,
    reboot_refusal=FAILED,
    fence_frame=M.MAV_FRAME_GLOBAL,
    plan_is_asked_int=False,
    refuses_wrong_seq=True,
    upload_retry_s=1.0,
    upload_timeout_s=8.0,
    parameters=ARDUCOPTER_PARAMETERS,
    parameters_as_bits=False,
    tells_index_by_name=False,
    echoes_when_changed=1,
    critical_battery=("BATT_FS_CRT_ACT", {"warn": 0.0, "land": 1.0, "return": 2.0}),
)
