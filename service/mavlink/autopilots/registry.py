"""Which autopilot a HEARTBEAT announces."""

from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.mavlink.autopilots.ardupilot import ArduCopter
from service.mavlink.autopilots.base import Autopilot
from service.mavlink.autopilots.px4 import PX4

_AUTOPILOTS: dict[int, type[Autopilot]] = {
    mavlink.MAV_AUTOPILOT_PX4: PX4,
    mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA: ArduCopter,
}
_MULTICOPTERS = frozenset(
    {
        mavlink.MAV_TYPE_QUADROTOR,
        mavlink.MAV_TYPE_COAXIAL,
        mavlink.MAV_TYPE_HELICOPTER,
        mavlink.MAV_TYPE_HEXAROTOR,
        mavlink.MAV_TYPE_OCTOROTOR,
        mavlink.MAV_TYPE_TRICOPTER,
        mavlink.MAV_TYPE_DODECAROTOR,
        mavlink.MAV_TYPE_DECAROTOR,
        43,  # MAV_TYPE_GENERIC_MULTIROTOR, which the dialect does not name yet
    }
)


def autopilot_for(autopilot: int, vehicle_type: int) -> Autopilot | str:
    """The autopilot to use for a HEARTBEAT of component 1, or why there is none, as a sentence's end."""
    kind = _AUTOPILOTS.get(autopilot)
    if kind is None:
        return f"runs {_entry('MAV_AUTOPILOT', autopilot)}, which is neither PX4 nor ArduPilot"
    if vehicle_type not in _MULTICOPTERS:
        return f"is a {_entry('MAV_TYPE', vehicle_type)}, which is not a multicopter"
    return kind()


def _entry(enum: str, value: int) -> str:
    entry = mavlink.enums[enum].get(value)
    return str(entry.name).removeprefix(f"{enum}_") if entry else f"{enum} {value}"
