"""PARAM_REQUEST_READ, PARAM_REQUEST_LIST and PARAM_SET. A missing parameter is met with silence."""

from __future__ import annotations

import math
from typing import Any

from sim.autopilot.dialect import M
from sim.autopilot.host import Host, Line
from sim.autopilot.parameters import REAL32, Parameter, bits_to_whole, whole_to_bits


class ParameterProtocol:
    """Serves the parameters of the firmware."""

    def __init__(self, autopilot: Host) -> None:
        self._autopilot = autopilot
        self.handlers = {
            M.MAVLINK_MSG_ID_PARAM_REQUEST_READ: self._on_read,
            M.MAVLINK_MSG_ID_PARAM_REQUEST_LIST: self._on_list,
            M.MAVLINK_MSG_ID_PARAM_SET: self._on_set,
        }

    def _send(self, link: Line, parameter: Parameter, index: int, kind: int | None = None) -> None:
        firmware = self._autopilot.firmware
        value = parameter.value
        if parameter.kind != REAL32 and firmware.flavor.parameters_as_bits:
            value = whole_to_bits(int(value))
        name = parameter.name.encode("ascii")
        count = len(firmware.parameters)
        link.send(
            M.MAVLink_param_value_message(name, value, parameter.kind if kind is None else kind, count, index)
        )

    def _on_read(self, link: Line, message: Any) -> None:
        firmware = self._autopilot.firmware
        store = firmware.parameters
        if message.param_index >= 0:
            if message.param_index < len(store):
                self._send(link, store.at(message.param_index), message.param_index)
            return
        index = store.index(_name(message.param_id))
        if index is not None:
            self._send(link, store.at(index), index if firmware.flavor.tells_index_by_name else 65535)

    def _on_list(self, link: Line, message: Any) -> None:
        store = self._autopilot.firmware.parameters
        for index in range(len(store)):
            self._send(link, store.at(index), index)

    def _on_set(self, link: Line, message: Any) -> None:
        firmware = self._autopilot.firmware
        store = firmware.parameters
        name = _name(message.param_id)
        index = store.index(name)
        if index is None:
            return
        kind = store.at(index).kind
        value = message.param_value
        as_bits = kind != REAL32 and firmware.flavor.parameters_as_bits
        if not math.isfinite(value) and not as_bits:
            return
        if kind != REAL32:
            value = bits_to_whole(value) if as_bits else round(value)
        changed = store.set(name, value)
        times = firmware.flavor.echoes_when_changed if changed else 1
        for _ in range(times):
            shown = index if firmware.flavor.tells_index_by_name else 65535
            self._send(link, store.at(index), shown, firmware.kind_after_set(kind))


def _name(raw: str | bytes) -> str:
    text = raw.decode("ascii", "replace") if isinstance(raw, bytes) else raw
    return text.rstrip("\0")
