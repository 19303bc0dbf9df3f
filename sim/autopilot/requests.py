"""What is asked of the link and not of the vehicle: messages, their rates, versions, time, pings."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from sim.autopilot.commands import ACCEPTED, ReceivedCommand, Results, whole
from sim.autopilot.dialect import INT32_MAX, M
from sim.autopilot.host import Host, Line
from sim.autopilot.telemetry import BUILDERS

_REBOOT_S = 0.5  # the acknowledgement of a reboot gets out first
# REQUEST_DATA_STREAM, from the days before SET_MESSAGE_INTERVAL: ground stations still send it to ArduPilot
_GROUPS: dict[int, tuple[int, ...]] = {
    M.MAV_DATA_STREAM_EXTENDED_STATUS: (
        M.MAVLINK_MSG_ID_SYS_STATUS,
        M.MAVLINK_MSG_ID_GPS_RAW_INT,
        M.MAVLINK_MSG_ID_MISSION_CURRENT,
        M.MAVLINK_MSG_ID_POSITION_TARGET_GLOBAL_INT,
    ),
    M.MAV_DATA_STREAM_POSITION: (M.MAVLINK_MSG_ID_GLOBAL_POSITION_INT, M.MAVLINK_MSG_ID_LOCAL_POSITION_NED),
    M.MAV_DATA_STREAM_EXTRA1: (M.MAVLINK_MSG_ID_ATTITUDE,),
    M.MAV_DATA_STREAM_EXTRA2: (M.MAVLINK_MSG_ID_VFR_HUD,),
    M.MAV_DATA_STREAM_EXTRA3: (
        M.MAVLINK_MSG_ID_SYSTEM_TIME,
        M.MAVLINK_MSG_ID_BATTERY_STATUS,
        M.MAVLINK_MSG_ID_EKF_STATUS_REPORT,
    ),
}


class Requests:
    """Serves requests for messages on one link."""

    def __init__(self, autopilot: Host) -> None:
        self._autopilot = autopilot
        self.handlers: dict[int, Callable[[Line, ReceivedCommand], Results]] = {
            M.MAV_CMD_REQUEST_MESSAGE: self._request_message,
            M.MAV_CMD_SET_MESSAGE_INTERVAL: self._set_interval,
            M.MAV_CMD_GET_MESSAGE_INTERVAL: self._get_interval,
            M.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES: lambda link, _: self._send(
                link, M.MAVLINK_MSG_ID_AUTOPILOT_VERSION
            ),
            M.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN: self._reboot,
            M.MAV_CMD_GET_HOME_POSITION: lambda link, _: self._send(link, M.MAVLINK_MSG_ID_HOME_POSITION),
        }
        self.message_handlers: dict[int, Callable[[Line, Any], None]] = {
            M.MAVLINK_MSG_ID_TIMESYNC: self._on_timesync,
            M.MAVLINK_MSG_ID_PING: self._on_ping,
        }
        if autopilot.firmware.flavor.serves_data_streams:
            self.message_handlers[M.MAVLINK_MSG_ID_REQUEST_DATA_STREAM] = self._on_data_stream

    def _knows(self, number: int) -> bool:
        host = self._autopilot
        foreign = number in host.firmware.flavor.foreign_messages
        return number in BUILDERS and not foreign and number not in host.unknown_messages

    def _send(self, link: Line, number: int) -> Results:
        message = BUILDERS[number](self._autopilot)
        if message is None:
            return self._autopilot.firmware.flavor.unknown_request
        link.send(message)
        return ACCEPTED

    def _request_message(self, link: Line, command: ReceivedCommand) -> Results:
        firmware, number = self._autopilot.firmware, whole(command.param1)
        if number == M.MAVLINK_MSG_ID_MESSAGE_INTERVAL and firmware.flavor.requests_interval_message:
            return self._tell_interval(link, whole(command.param2))
        if not self._knows(number):
            return firmware.flavor.unknown_request
        return self._send(link, number)

    def _set_interval(self, link: Line, command: ReceivedCommand) -> Results:
        firmware, number = self._autopilot.firmware, whole(command.param1)
        if not self._knows(number):
            if firmware.flavor.requests_interval_message:
                self._autopilot.vehicle.say(6, f"No ap_message for mavlink id ({number})")
            return firmware.flavor.unknown_interval
        link.set_interval(number, whole(command.param2))
        return ACCEPTED

    def _get_interval(self, link: Line, command: ReceivedCommand) -> Results:
        return self._tell_interval(link, whole(command.param1))

    def _tell_interval(self, link: Line, number: int) -> Results:
        link.send(
            M.MAVLink_message_interval_message(number & 0xFFFF, min(link.interval_us(number), INT32_MAX))
        )
        return ACCEPTED

    def _reboot(self, link: Line, command: ReceivedCommand) -> Results:
        result = self._autopilot.firmware.on_reboot(command)
        if result == ACCEPTED:
            self._autopilot.later(_REBOOT_S, self._autopilot.reboot)
        return result

    def _on_timesync(self, link: Line, message: Any) -> None:
        if message.tc1 == 0:
            link.send(M.MAVLink_timesync_message(self._autopilot.vehicle.steps * 20_000_000, message.ts1))

    def _on_ping(self, link: Line, message: Any) -> None:
        if message.target_system == 0:
            to = message.get_srcSystem(), message.get_srcComponent()
            link.send(M.MAVLink_ping_message(message.time_usec, message.seq, *to))

    def _on_data_stream(self, link: Line, message: Any) -> None:
        groups = _GROUPS if message.req_stream_id == M.MAV_DATA_STREAM_ALL else {message.req_stream_id: ()}
        on = message.start_stop == 1 and message.req_message_rate > 0
        interval = round(1e6 / message.req_message_rate) if on else -1
        for group in groups:
            for number in _GROUPS.get(group, ()):
                link.set_interval(number, interval)
