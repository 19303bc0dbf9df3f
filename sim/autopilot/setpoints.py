"""SET_POSITION_TARGET_GLOBAL_INT and _LOCAL_NED as positions and velocities in the home frame."""

from __future__ import annotations

import math
from typing import Any

from sim.autopilot.dialect import M
from sim.autopilot.host import Host, Line
from sim.autopilot.vehicle import Point

_NO_POSITION, _NO_VELOCITY, _NO_YAW = 0x0007, 0x0038, 0x0400
_ABSOLUTE = (M.MAV_FRAME_GLOBAL, M.MAV_FRAME_GLOBAL_INT)
_BODY = (M.MAV_FRAME_BODY_NED, M.MAV_FRAME_BODY_OFFSET_NED)


class Setpoints:
    """Hands setpoints to the firmware, which decides whether it follows."""

    def __init__(self, autopilot: Host) -> None:
        self._autopilot = autopilot
        self.handlers = {
            M.MAVLINK_MSG_ID_SET_POSITION_TARGET_GLOBAL_INT: self._on_global,
            M.MAVLINK_MSG_ID_SET_POSITION_TARGET_LOCAL_NED: self._on_local,
        }

    def _on_global(self, link: Line, message: Any) -> None:
        firmware = self._autopilot.firmware
        position = None
        if not message.type_mask & _NO_POSITION:
            north, east = firmware.vehicle.frame.from_e7(message.lat_int, message.lon_int)
            if message.coordinate_frame in _ABSOLUTE:
                up = message.alt - firmware.vehicle.ground_amsl
            else:
                up = message.alt + firmware.home_or_here().up
            position = Point(north, east, up)
        self._hand_on(message, position)

    def _on_local(self, link: Line, message: Any) -> None:
        position = None
        if not message.type_mask & _NO_POSITION:
            origin = self._autopilot.vehicle.origin
            position = Point(message.x + origin.north, message.y + origin.east, -message.z + origin.up)
        self._hand_on(message, position)

    def _hand_on(self, message: Any, position: Point | None) -> None:
        if position is not None and not all(map(math.isfinite, position)):
            return
        velocity = None
        if not message.type_mask & _NO_VELOCITY:
            north, east = message.vx, message.vy
            if message.coordinate_frame in _BODY:
                yaw = math.radians(self._autopilot.vehicle.body.yaw)
                north, east = (
                    north * math.cos(yaw) - east * math.sin(yaw),
                    north * math.sin(yaw) + east * math.cos(yaw),
                )
            velocity = (north, east, -message.vz)
            if not all(map(math.isfinite, velocity)):
                return
        yaw_deg = (
            None
            if message.type_mask & _NO_YAW or not math.isfinite(message.yaw)
            else math.degrees(message.yaw) % 360.0
        )
        self._autopilot.firmware.on_setpoint(position, velocity, yaw_deg)
