"""Which message tells what, how often it should come, and after how long what it told is old.

One table for all streams. A field that is old reads as unknown, as if it had never been told (see `heard`), so nobody
who reads telemetry has to know an age. Three kinds of values do not grow old: what HEARTBEAT says (when that stays away
the link is lost, which is an event of its own), the place where the aircraft was last (`position_known` says that it
may be elsewhere by now), and home and origin, which are told when they change.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from pymavlink.dialects.v20 import ardupilotmega as mavlink

_ARDUPILOT, _PX4 = "ardupilot", "px4"


@dataclass(frozen=True, slots=True)
class Source:
    """One message, and the fields of `Telemetry` that it tells.

    `hz` is how often it is asked for (0: taken as it comes); `old_after_s` how long it is believed; an `optional` one
    is not asked for again once it was refused; `only` names the autopilot that has it.
    """

    fields: tuple[str, ...]
    hz: float
    old_after_s: float
    optional: bool = False
    only: str = ""

    def told_by(self, autopilot: str) -> bool:
        """Whether this autopilot is asked for it."""
        return self.hz > 0.0 and self.only in ("", autopilot)


_BATTERY = (
    "battery_percent",
    "battery_voltage_v",
    "battery_current_a",
    "battery_consumed_mah",
    "battery_state",
)
_GPS = ("fix", "satellites", "eph", "horizontal_accuracy_m")
_POSITION = ("velocity_ned_mps", "heading_deg")

SOURCES: Mapping[str, Source] = {
    "GLOBAL_POSITION_INT": Source(_POSITION, 10.0, 2.0),
    "EXTENDED_SYS_STATE": Source(("landed_state",), 2.0, 5.0),
    "POSITION_TARGET_GLOBAL_INT": Source(("target", "target_over_home"), 2.0, 5.0),
    "POSITION_TARGET_LOCAL_NED": Source(("steered_mps",), 2.0, 5.0, optional=True, only=_ARDUPILOT),
    "ATTITUDE": Source(("yaw_deg", "heading_deg", "roll_deg", "pitch_deg"), 10.0, 1.0),
    "SYS_STATUS": Source((*_BATTERY, "prearm_ok", "sensors_failed"), 1.0, 5.0),
    "BATTERY_STATUS": Source(_BATTERY, 1.0, 10.0),
    "GPS_RAW_INT": Source(_GPS, 1.0, 5.0),
    "GPS2_RAW": Source(_GPS, 1.0, 5.0, optional=True),
    "HOME_POSITION": Source(("home",), 0.5, math.inf),
    "GPS_GLOBAL_ORIGIN": Source(("origin",), 0.2, math.inf, optional=True),
    "VFR_HUD": Source((), 2.0, 5.0),
    "WIND_COV": Source(("wind",), 1.0, 10.0, optional=True, only=_PX4),
    "WIND": Source(("wind",), 1.0, 10.0, optional=True, only=_ARDUPILOT),
    "ESTIMATOR_STATUS": Source(("estimator_ok",), 1.0, 5.0, optional=True, only=_PX4),
    "EKF_STATUS_REPORT": Source(("estimator_ok",), 1.0, 5.0, optional=True, only=_ARDUPILOT),
    "DISTANCE_SENSOR": Source(("ground_distance_m",), 5.0, 2.0, optional=True),
    "TERRAIN_REPORT": Source(("terrain_distance_m",), 1.0, 5.0, optional=True, only=_ARDUPILOT),
    "RC_CHANNELS": Source(("sticks",), 2.0, 2.0, optional=True),
    "MANUAL_CONTROL": Source(("sticks",), 2.0, 2.0, optional=True, only=_PX4),
}
"""In the order in which they are asked for: the most needed first."""


def number_of(name: str) -> int:
    """The number of a message of the dialect."""
    return int(getattr(mavlink, f"MAVLINK_MSG_ID_{name}"))
