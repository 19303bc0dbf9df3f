"""The mission protocol (missions, fences, rally points): uploads, downloads, clearing.

A flavour shows here in the order and the name of its requests, and in what it says to an item with the
wrong number; both are told by the firmware's class attributes and hooks.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from sim.autopilot.dialect import M
from sim.autopilot.host import Host, Line

_ACCEPTED = M.MAV_MISSION_ACCEPTED


@dataclass
class _Upload:
    """An upload under way."""

    link: Line
    system: int
    component: int
    kind: int
    count: int
    asked_at: float
    heard_at: float
    items: list[Any] = field(default_factory=list)


class Missions:
    """The vehicle's side of the mission protocol on all links."""

    def __init__(self, autopilot: Host) -> None:
        self._autopilot = autopilot
        self._upload: _Upload | None = None
        self._asks_int = False
        self.handlers = {
            M.MAVLINK_MSG_ID_MISSION_COUNT: self._on_count,
            M.MAVLINK_MSG_ID_MISSION_ITEM_INT: self._on_item,
            M.MAVLINK_MSG_ID_MISSION_ITEM: self._on_item,
            M.MAVLINK_MSG_ID_MISSION_REQUEST_LIST: self._on_request_list,
            M.MAVLINK_MSG_ID_MISSION_REQUEST_INT: self._on_request,
            M.MAVLINK_MSG_ID_MISSION_REQUEST: self._on_request,
            M.MAVLINK_MSG_ID_MISSION_CLEAR_ALL: self._on_clear,
            M.MAVLINK_MSG_ID_MISSION_SET_CURRENT: self._on_set_current,
            M.MAVLINK_MSG_ID_MISSION_ACK: self._on_ack,
        }

    def _ack(self, link: Line, to: Any, result: int, kind: int) -> None:
        system, component = to
        link.send(M.MAVLink_mission_ack_message(system, component, result, kind))

    def _ask(self, upload: _Upload) -> None:
        make = M.MAVLink_mission_request_int_message if self._asks_int else M.MAVLink_mission_request_message
        upload.asked_at = self._autopilot.vehicle.time
        upload.link.send(make(upload.system, upload.component, len(upload.items), upload.kind))

    def _on_count(self, link: Line, message: Any) -> None:
        to, now = (message.get_srcSystem(), message.get_srcComponent()), self._autopilot.vehicle.time
        if message.mission_type not in self._autopilot.firmware.plan.items:
            self._ack(link, to, M.MAV_MISSION_UNSUPPORTED, message.mission_type)
            return
        if message.count == 0:
            self._store(message.mission_type, [])
            self._ack(link, to, _ACCEPTED, message.mission_type)
            return
        self._upload = _Upload(link, *to, message.mission_type, message.count, now, now)
        self._ask(self._upload)

    def _on_item(self, link: Line, message: Any) -> None:
        upload, firmware = self._upload, self._autopilot.firmware
        if upload is None or upload.link is not link or message.mission_type != upload.kind:
            return
        upload.heard_at = self._autopilot.vehicle.time
        if message.get_msgId() == M.MAVLINK_MSG_ID_MISSION_ITEM:
            message = _as_int(message)
        elif firmware.flavor.plan_is_asked_int:
            self._asks_int = True
        if message.seq != len(upload.items):
            if firmware.flavor.refuses_wrong_seq:
                to = (upload.system, upload.component)
                self._ack(link, to, M.MAV_MISSION_INVALID_SEQUENCE, upload.kind)
                self._ask(upload)
            return
        upload.items.append(message)
        if len(upload.items) < upload.count:
            self._ask(upload)
            return
        self._upload = None
        self._store(upload.kind, upload.items)
        firmware.plan_received(upload.kind)
        self._ack(link, (upload.system, upload.component), _ACCEPTED, upload.kind)

    def _store(self, kind: int, items: list[Any]) -> None:
        firmware = self._autopilot.firmware
        if kind == M.MAV_MISSION_TYPE_MISSION:
            items = firmware.stored_items(items)
            firmware.plan.current, firmware.plan.reached = 0, -1
        firmware.plan.items[kind] = items
        if kind == M.MAV_MISSION_TYPE_FENCE:
            firmware.fence.load(items)

    def _on_request_list(self, link: Line, message: Any) -> None:
        items = self._autopilot.firmware.plan.items.get(message.mission_type, [])
        link.send(
            M.MAVLink_mission_count_message(
                message.get_srcSystem(), message.get_srcComponent(), len(items), message.mission_type
            )
        )

    def _on_request(self, link: Line, message: Any) -> None:
        firmware, kind = self._autopilot.firmware, message.mission_type
        items = firmware.plan.items.get(kind, [])
        to = (message.get_srcSystem(), message.get_srcComponent())
        if not 0 <= message.seq < len(items):
            self._ack(link, to, M.MAV_MISSION_INVALID_SEQUENCE, kind)
            return
        each = items[message.seq]
        is_fence = kind == M.MAV_MISSION_TYPE_FENCE
        frame = firmware.flavor.fence_frame if is_fence else each.frame
        place: tuple[float, float] = (each.x, each.y)
        make = M.MAVLink_mission_item_int_message
        if message.get_msgId() == M.MAVLINK_MSG_ID_MISSION_REQUEST:
            make, place = M.MAVLink_mission_item_message, (each.x * 1e-7, each.y * 1e-7)
        current = int(kind == M.MAV_MISSION_TYPE_MISSION and message.seq == firmware.plan.current)
        link.send(
            make(
                *to,
                each.seq,
                frame,
                each.command,
                current,
                each.autocontinue,
                each.param1,
                each.param2,
                each.param3,
                each.param4,
                *place,
                each.z,
                kind,
            )
        )

    def _on_clear(self, link: Line, message: Any) -> None:
        kinds = (0, 1, 2) if message.mission_type == M.MAV_MISSION_TYPE_ALL else (message.mission_type,)
        self._upload = None
        for kind in kinds:
            self._store(kind, [])
        self._ack(
            link, (message.get_srcSystem(), message.get_srcComponent()), _ACCEPTED, message.mission_type
        )

    def _on_set_current(self, link: Line, message: Any) -> None:
        self._autopilot.firmware.plan.select(message.seq)
        self._autopilot.announce_current()

    def _on_ack(self, link: Line, message: Any) -> None:
        """The other side ends its download, calls off an upload, or wants to be asked in the other form."""
        upload = self._upload
        if upload is None or upload.link is not link or message.mission_type != upload.kind:
            return
        if message.type == M.MAV_MISSION_OPERATION_CANCELLED:
            self._upload = None
        elif message.type == M.MAV_MISSION_UNSUPPORTED and self._autopilot.firmware.flavor.plan_is_asked_int:
            self._asks_int = not self._asks_int
            self._ask(upload)

    def tick(self) -> None:
        """Ask again for what did not come, give up in the end."""
        upload, firmware = self._upload, self._autopilot.firmware
        if upload is None:
            return
        now = self._autopilot.vehicle.time
        if now - upload.heard_at > max(firmware.flavor.upload_timeout_s, firmware.link_floor_s):
            self._upload = None
            firmware.upload_timed_out()
        elif now - upload.asked_at > max(firmware.flavor.upload_retry_s, firmware.link_floor_s):
            self._ask(upload)


def _as_int(item: Any) -> Any:
    """A MISSION_ITEM, with degrees, as a MISSION_ITEM_INT."""
    return M.MAVLink_mission_item_int_message(
        item.target_system,
        item.target_component,
        item.seq,
        item.frame,
        item.command,
        item.current,
        item.autocontinue,
        item.param1,
        item.param2,
        item.param3,
        item.param4,
        round(item.x * 1e7),
        round(item.y * 1e7),
        item.z,
        item.mission_type,
    )
