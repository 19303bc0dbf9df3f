"""PX4 multicopters (seen on 1.16).

`custom_mode` carries the main mode in bits 16 to 23 and the sub-mode in bits 24 to 31. The guided mode is
AUTO_LOITER, "Hold" on a ground station. Its acknowledgements are no judge: every DO_SET_MODE is acknowledged
twice, and a reposition without the change-mode flag gets UNSUPPORTED and is flown all the same.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import ClassVar

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.mavlink.autopilots.base import Autopilot
from service.mavlink.command import Command
from service.mavlink.modes import ModeKind

_AUTO = 4
_MAIN = {1: "MANUAL", 2: "ALTCTL", 3: "POSCTL", 5: "ACRO", 6: "OFFBOARD", 7: "STABILIZED", 8: "RATTITUDE"}
_SUB = {
    1: "AUTO_READY",
    2: "AUTO_TAKEOFF",
    3: "AUTO_LOITER",
    4: "AUTO_MISSION",
    5: "AUTO_RTL",
    6: "AUTO_LAND",
    8: "AUTO_FOLLOW",
    9: "AUTO_PRECLAND",
    10: "AUTO_VTOL_TAKEOFF",
}
_SUB_NUMBERS = {name: number for number, name in _SUB.items()}
_CUSTOM_MODE_ENABLED = 1.0


class PX4(Autopilot):
    """PX4 flying a multicopter."""

    name = "px4"
    title = "PX4"
    guided_mode = "AUTO_LOITER"
    guided_title = "Hold"
    take_over_advice = "To take over select Position, not Hold"
    takeoff_mode = "AUTO_TAKEOFF"
    return_mode = "AUTO_RTL"
    land_mode = "AUTO_LAND"
    kinds: ClassVar[dict[str, ModeKind]] = {
        "AUTO_LOITER": ModeKind.GUIDED,
        "AUTO_TAKEOFF": ModeKind.TAKEOFF,
        "AUTO_RTL": ModeKind.RETURN,
        "AUTO_LAND": ModeKind.LAND,
        "AUTO_PRECLAND": ModeKind.LAND,
        "MANUAL": ModeKind.PILOT,
        "ALTCTL": ModeKind.PILOT,
        "POSCTL": ModeKind.PILOT,
        "ACRO": ModeKind.PILOT,
        "STABILIZED": ModeKind.PILOT,
        "RATTITUDE": ModeKind.PILOT,
    }
    deceleration_mps2 = 1.2
    answers_reposition = False
    not_ready_texts = ("Preflight Fail", "Arming denied")

    def mode_name(self, base_mode: int, custom_mode: int) -> str:
        main, sub = custom_mode >> 16 & 0xFF, custom_mode >> 24 & 0xFF
        unknown = f"UNKNOWN({main}.{sub})"
        if not base_mode & mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED:
            return unknown
        if main == _AUTO:
            return _SUB.get(sub, unknown)
        return _MAIN.get(main, unknown)

    def set_mode(self, mode: str) -> Command:
        params = (_CUSTOM_MODE_ENABLED, float(_AUTO), float(_SUB_NUMBERS[mode]))
        number = mavlink.MAV_CMD_DO_SET_MODE
        return Command(number, params, motion=True, goal_mode=mode, acked_twice=True, label=mode)

    def take_off(self, height_m: float, home_alt_amsl_m: float) -> Command:
        """The altitude is AMSL: given 20 where the ground is at 489 m, PX4 accepts and stays down."""
        params = (math.nan, 0.0, 0.0, math.nan, math.nan, math.nan, home_alt_amsl_m + height_m)
        number = mavlink.MAV_CMD_NAV_TAKEOFF
        label = f"{height_m:g} m"
        goal = self.takeoff_mode
        return Command(number, params, motion=True, goal_mode=goal, label=label, height_m=height_m)

    def follows(self, previous: str, mode: str, *, armed: bool, climbed: bool) -> bool:
        """After a take-off it holds; after a landing it goes back to Hold once it has disarmed."""
        if mode != self.guided_mode:
            return False
        if previous == self.takeoff_mode:
            return climbed
        return self.mode_kind(previous) in (ModeKind.RETURN, ModeKind.LAND) and not armed

    def brake(self) -> Command:
        """DO_REPOSITION to nowhere: with no place, no altitude and no yaw PX4 pauses at its own stopping point
        (`Navigator::run`, 'All three set to NaN - pause vehicle'). Without the flag it cannot take a mode."""
        params = (-1.0, 0.0, 0.0, math.nan, math.nan, math.nan, math.nan)
        return Command(mavlink.MAV_CMD_DO_REPOSITION, params, motion=True, attempts=3, label="stop")

    def holds_by_failsafe(self, mode: str, system_status: int, texts: Iterable[str]) -> bool:
        """Its failsafe 'entering Hold for 5 seconds' is in the mode in which it follows us. Two signs are asked for: it
        calls its state critical, and has spoken of a failsafe just before."""
        critical = system_status in (mavlink.MAV_STATE_CRITICAL, mavlink.MAV_STATE_EMERGENCY)
        return critical and mode == self.guided_mode and any("failsafe" in text.lower() for text in texts)

    def refuses_reposition(self, result: int) -> bool:
        """Never: the answer to a reposition without the change-mode flag is UNSUPPORTED either way."""
        return False
