"""What of a message is known: the values by which each field says 'I do not know' become None at the door.

`FIELDS` names every field that the link reads, with the values that mean nothing and the range that means
something. It is made from the `invalid` attributes and the descriptions of MAVLink's message definitions
(`standard.xml`, `common.xml`, `ardupilotmega.xml` as pymavlink 2.4.50 carries them); a test compares the two. To that
come the largest number of a field's type, which stands for 'unknown' in the wild where the definitions name nothing,
and NaN and infinity, which no field may have. A message may not be read past this table.

Fields after MAVLink 1's end ('extensions') are zero where the sender has none: those that are read here name 0.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from service.mavlink.framing import Message

INT16_MAX, INT32_MAX = 2**15 - 1, 2**31 - 1
UINT8_MAX, UINT16_MAX, UINT32_MAX = 2**8 - 1, 2**16 - 1, 2**32 - 1


@dataclass(frozen=True, slots=True)
class FieldRule:
    """When a field is known: it is none of `unknown`, and between `low` and `high`."""

    unknown: tuple[float, ...] = ()
    low: float = -math.inf
    high: float = math.inf

    def known(self, value: float) -> bool:
        """Whether this value means something."""
        return math.isfinite(value) and value not in self.unknown and self.low <= value <= self.high


_FLAGS = FieldRule()
_LATITUDE, _LONGITUDE = FieldRule((INT32_MAX,), -90e7, 90e7), FieldRule((INT32_MAX,), -180e7, 180e7)
_ALTITUDE_MM = FieldRule((INT32_MAX,), -12e6, 100e6)  # the lowest ground and the highest air
_SPEED_CMPS = FieldRule((INT16_MAX,), -INT16_MAX, INT16_MAX)
_ANGLE = FieldRule((), -7.0, 7.0)
_PERCENT = FieldRule((-1,), 0, 100)
_CURRENT = FieldRule((-1, INT16_MAX), 0)  # PX4 says -100 for 'not measured'
_GPS = {
    "fix_type": FieldRule((), 0, 8),
    "eph": FieldRule((UINT16_MAX,)),
    "satellites_visible": FieldRule((UINT8_MAX,)),
    "h_acc": FieldRule((0, UINT32_MAX)),
}
_PLACE = {"latitude": _LATITUDE, "longitude": _LONGITUDE, "altitude": _ALTITUDE_MM}
_STICK = FieldRule((INT16_MAX,), -1000, 1000)
_RANGE_CM = FieldRule((UINT16_MAX,), 0)
_CHANNEL = FieldRule((0, UINT16_MAX), 500, 2500)

FIELDS: Mapping[str, Mapping[str, FieldRule]] = {
    "GLOBAL_POSITION_INT": {
        "lat": _LATITUDE,
        "lon": _LONGITUDE,
        "alt": _ALTITUDE_MM,
        "relative_alt": _ALTITUDE_MM,
        "vx": _SPEED_CMPS,
        "vy": _SPEED_CMPS,
        "vz": _SPEED_CMPS,
        "hdg": FieldRule((UINT16_MAX,), 0, 36_000),
    },
    "ATTITUDE": {"roll": _ANGLE, "pitch": _ANGLE, "yaw": _ANGLE},
    "SYS_STATUS": {
        "onboard_control_sensors_enabled": _FLAGS,
        "onboard_control_sensors_health": _FLAGS,
        "voltage_battery": FieldRule((0, UINT16_MAX)),
        "current_battery": _CURRENT,
        "battery_remaining": _PERCENT,
    },
    "BATTERY_STATUS": {
        "id": _FLAGS,
        "voltages": FieldRule((0, UINT16_MAX)),
        "voltages_ext": FieldRule((0, UINT16_MAX)),
        "current_battery": _CURRENT,
        "current_consumed": FieldRule((-1, INT32_MAX), 0),
        "battery_remaining": _PERCENT,
        "charge_state": FieldRule((0,), 1, 7),
    },
    "GPS_RAW_INT": _GPS,
    "GPS2_RAW": _GPS,
    "EXTENDED_SYS_STATE": {"landed_state": FieldRule((0,), 1, 4)},
    "HOME_POSITION": _PLACE,
    "GPS_GLOBAL_ORIGIN": _PLACE,
    "WIND_COV": {"wind_x": FieldRule(), "wind_y": FieldRule()},
    "WIND": {
        "direction": FieldRule(),
        "speed": FieldRule((0,), 0),
    },  # an estimator without a wind says exactly 0
    "ESTIMATOR_STATUS": {"flags": _FLAGS},
    "EKF_STATUS_REPORT": {"flags": _FLAGS},
    "POSITION_TARGET_LOCAL_NED": {
        "type_mask": _FLAGS,
        "vx": FieldRule(),
        "vy": FieldRule(),
        "vz": FieldRule(),
    },
    "POSITION_TARGET_GLOBAL_INT": {
        "coordinate_frame": _FLAGS,
        "type_mask": _FLAGS,
        "lat_int": _LATITUDE,
        "lon_int": _LONGITUDE,
        "alt": FieldRule(),
    },
    "DISTANCE_SENSOR": {
        "min_distance": _RANGE_CM,
        "max_distance": _RANGE_CM,
        "current_distance": _RANGE_CM,
        "orientation": _FLAGS,
        "signal_quality": FieldRule((0,), 0, 100),
    },
    "TERRAIN_REPORT": {
        "spacing": FieldRule((0, UINT16_MAX), 0),
        "current_height": FieldRule((), -12e3, 100e3),
    },
    "MANUAL_CONTROL": {"x": _STICK, "y": _STICK, "r": _STICK},
    "RC_CHANNELS": {"chancount": _FLAGS, **{f"chan{i}_raw": _CHANNEL for i in (1, 2, 4)}},
}


class KnownFields:
    """A message of which only the fields of the table can be read, and what is unknown is None.

    An array gives the list of its known elements.
    """

    def __init__(self, message: Message) -> None:
        self._message, self._rules = message, FIELDS[message.get_type()]

    def read(self, name: str, per: float = 1.0) -> float | None:
        """A number in the unit of which the field counts `per` to one, or None."""
        rule, value = self._rules[name], getattr(self._message, name)
        return value / per if rule.known(value) else None

    def flags(self, name: str) -> int:
        """A bit field or an id: every value of it means something."""
        assert self._rules[name] == _FLAGS
        return int(getattr(self._message, name))

    def each(self, name: str, per: float = 1.0) -> list[float]:
        """The known elements of an array."""
        rule = self._rules[name]
        return [value / per for value in getattr(self._message, name) if rule.known(value)]
