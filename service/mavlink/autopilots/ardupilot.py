"""ArduCopter (seen on 4.7.0-dev).

`custom_mode` is the mode's number. The guided mode is GUIDED; take-off happens in it and only in it, to a
height above home. It acknowledges once and truthfully.
"""

from __future__ import annotations

import math
from typing import ClassVar

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.mavlink.autopilots.base import Autopilot
from service.mavlink.command import Command
from service.mavlink.framing import Message
from service.mavlink.modes import ModeKind

_MODES = {
    0: "STABILIZE",
    1: "ACRO",
    2: "ALT_HOLD",
    3: "AUTO",
    4: "GUIDED",
    5: "LOITER",
    6: "RTL",
    7: "CIRCLE",
    9: "LAND",
    11: "DRIFT",
    13: "SPORT",
    14: "FLIP",
    15: "AUTOTUNE",
    16: "POSHOLD",
    17: "BRAKE",
    18: "THROW",
    19: "AVOID_ADSB",
    20: "GUIDED_NOGPS",
    21: "SMART_RTL",
    22: "FLOWHOLD",
    23: "FOLLOW",
    24: "ZIGZAG",
    25: "SYSTEMID",
    26: "AUTOROTATE",
    27: "AUTO_RTL",
    28: "TURTLE",
}
_NUMBERS = {name: number for number, name in _MODES.items()}
_PILOTED = (0, 1, 2, 5, 11, 13, 14, 15, 16, 22, 24, 28)
_CUSTOM_MODE_ENABLED = 1.0
_ONLY_VELOCITY = (
    mavlink.POSITION_TARGET_TYPEMASK_X_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_Y_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_Z_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_AX_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_AY_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_AZ_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_YAW_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_YAW_RATE_IGNORE
)


class ArduCopter(Autopilot):
    """ArduPilot flying a multicopter."""

    name = "ardupilot"
    title = "ArduCopter"
    guided_mode = "GUIDED"
    guided_title = "GUIDED"
    takeoff_mode = "GUIDED"
    return_mode = "RTL"
    land_mode = "LAND"
    stop_mode = "BRAKE"
    kinds: ClassVar[dict[str, ModeKind]] = {
        "GUIDED": ModeKind.GUIDED,
        "RTL": ModeKind.RETURN,
        "SMART_RTL": ModeKind.RETURN,
        "AUTO_RTL": ModeKind.RETURN,
        "LAND": ModeKind.LAND,
        **{_MODES[number]: ModeKind.PILOT for number in _PILOTED},
    }
    deceleration_mps2 = 2.1
    answers_reposition = True
    not_ready_texts = ("PreArm:", "Arm:")

    def mode_name(self, base_mode: int, custom_mode: int) -> str:
        unknown = f"UNKNOWN({custom_mode})"
        if not base_mode & mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED:
            return unknown
        return _MODES.get(custom_mode, unknown)

    def set_mode(self, mode: str) -> Command:
        params = (_CUSTOM_MODE_ENABLED, float(_NUMBERS[mode]))
        return Command(mavlink.MAV_CMD_DO_SET_MODE, params, motion=True, goal_mode=mode, label=mode)

    def take_off(self, height_m: float, home_alt_amsl_m: float) -> Command:
        """The altitude is above home: given an AMSL one, it climbs towards that."""
        params = (0.0, 0.0, 0.0, math.nan, 0.0, 0.0, height_m)
        number = mavlink.MAV_CMD_NAV_TAKEOFF
        return Command(number, params, motion=True, label=f"{height_m:g} m", height_m=height_m)

    def follows(self, previous: str, mode: str, *, armed: bool, climbed: bool) -> bool:
        """Nothing: it stays in GUIDED after a take-off and in RTL or LAND after a landing."""
        return False

    def brake(self) -> Command:
        """The mode BRAKE. It is left by entering GUIDED again."""
        return self.set_mode(self.stop_mode)

    def break_off_climb(self) -> Command:
        """Its take-off is flown in the guided mode, so it has to leave that."""
        return self.brake()

    def stand_still(self, system: int, component: int) -> list[Message]:
        """A velocity of zero, which GUIDED takes without asking for a position as BRAKE does."""
        return [
            mavlink.MAVLink_set_position_target_local_ned_message(
                0, system, component, mavlink.MAV_FRAME_LOCAL_NED, _ONLY_VELOCITY, *[0.0] * 11
            )
        ]

    def refuses_reposition(self, result: int) -> bool:
        """Its answer is true: DENIED outside GUIDED or for an absurd place, FAILED outside the fence."""
        return result not in (mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_IN_PROGRESS)
