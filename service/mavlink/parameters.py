"""The few parameters that are read: how high above home the autopilot flies home by itself, and how it may move.

PARAM_REQUEST_READ by name, asked for again while it is not answered, seldom after the first times; who does not know a
name does not answer. One that is changed in flight is told to all, and taken over.
ArduCopter 4.7 has other names than before, and metres where there were centimetres: RTL_ALT_M for RTL_ALT, WP_ACC for
WPNAV_ACCEL, and so on. ArduCopter has no parameter for the fastest that it can be told to fly: WP_SPD and WPNAV_SPEED
are what it flies at until it is told. PX4 climbs and sinks to a waypoint by MPC_Z_V_AUTO_UP and MPC_Z_V_AUTO_DN (from
1.13 on), and never faster than MPC_Z_VEL_MAX_UP and MPC_Z_VEL_MAX_DN.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

_AGAIN_S = 2.0
_MOST = 5
_LATER_S = 60.0


@dataclass(frozen=True, eq=False)
class Wanted:
    """One value: the field of `Telemetry` it is for, the names by autopilot with what one of the parameter is in the
    field's unit, and the range that it can have. A name stands for another; of several values for a field the lowest
    counts."""

    field: str
    names: Mapping[str, Mapping[str, float]]
    least: float
    most: float


RETURN_HEIGHT = Wanted(
    "return_height_m",
    {"px4": {"RTL_RETURN_ALT": 1.0}, "ardupilot": {"RTL_ALT": 0.01, "RTL_ALT_M": 1.0}},
    0.0,
    10_000.0,
)
MOTION = (
    Wanted("most_speed_mps", {"px4": {"MPC_XY_VEL_MAX": 1.0}}, 0.5, 50.0),
    Wanted(
        "most_acceleration_mps2",
        {"px4": {"MPC_ACC_HOR": 1.0}, "ardupilot": {"WPNAV_ACCEL": 0.01, "WP_ACC": 1.0}},
        0.2,
        20.0,
    ),
    Wanted(
        "most_climb_mps",
        {"px4": {"MPC_Z_VEL_MAX_UP": 1.0}, "ardupilot": {"WPNAV_SPEED_UP": 0.01, "WP_SPD_UP": 1.0}},
        0.1,
        20.0,
    ),
    Wanted(
        "most_descent_mps",
        {"px4": {"MPC_Z_VEL_MAX_DN": 1.0}, "ardupilot": {"WPNAV_SPEED_DN": 0.01, "WP_SPD_DN": 1.0}},
        0.1,
        20.0,
    ),
    Wanted("most_climb_mps", {"px4": {"MPC_Z_V_AUTO_UP": 1.0}}, 0.1, 20.0),
    Wanted("most_descent_mps", {"px4": {"MPC_Z_V_AUTO_DN": 1.0}}, 0.1, 20.0),
)


class Parameters:
    """Asks for each value that is wanted until it is told, and hears when it changes."""

    def __init__(self, autopilot: str, wanted: Iterable[Wanted]) -> None:
        self._wanted = [each for each in wanted if autopilot in each.names]
        self._autopilot = autopilot
        self._told: dict[Wanted, float] = {}
        self._asked, self._at = 0, -math.inf

    def due(self, now: float) -> list[str]:
        """The names to ask for now."""
        open_ = [each for each in self._wanted if each not in self._told]
        if not open_ or now - self._at < (_AGAIN_S if self._asked < _MOST else _LATER_S):
            return []
        self._asked, self._at = self._asked + 1, now
        return [name for each in open_ for name in each.names[self._autopilot]]

    def read(self, name: str, value: float) -> tuple[str, float] | None:
        """A PARAM_VALUE as the field it is for and the lowest told for that; None: nobody asked, or it cannot be so."""
        for each in self._wanted:
            unit = each.names[self._autopilot].get(name)
            if unit is not None and each.least <= value * unit <= each.most:
                self._told[each] = value * unit
                return each.field, min(
                    told for other, told in self._told.items() if other.field == each.field
                )
        return None
