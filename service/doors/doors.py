"""The doors of a run: taken before anything starts, served while it goes on."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import socket
from collections.abc import Coroutine
from dataclasses import dataclass
from pathlib import Path

from service.config import DoorSettings
from service.doors.lines import SubmitAll, limited
from service.doors.mqtt import Broker, read_broker, serve_mqtt
from service.doors.udp import bind_udp, serve_udp
from service.doors.unix import bind_unix, serve_unix

log = logging.getLogger("roisearch")


@dataclass(frozen=True)
class Doors:
    """What is open; nothing is taken in before `serve`."""

    udp: socket.socket | None = None
    unix: socket.socket | None = None
    mqtt: Broker | None = None
    path: str = ""  # of the Unix socket
    detections_per_s: float = 200.0  # at each of them

    async def serve(self, submit: SubmitAll) -> None:
        """Take in reports at every door until cancelled; one that fails is told and does not close the others."""
        async with asyncio.TaskGroup() as group:
            if self.udp is not None:
                host, port = self.udp.getsockname()[:2]
                log.info("reports are taken at udp://%s:%d", f"[{host}]" if ":" in host else host, port)
                group.create_task(_kept("UDP", serve_udp(self.udp, limited(submit, self.detections_per_s))))
            if self.unix is not None:
                log.info("reports are taken at unix:%s", self.path)
                group.create_task(
                    _kept("Unix", serve_unix(self.unix, limited(submit, self.detections_per_s)))
                )
            if self.mqtt is not None:
                group.create_task(
                    _kept("MQTT", serve_mqtt(self.mqtt, limited(submit, self.detections_per_s)))
                )

    def close(self) -> None:
        """Give the addresses up."""
        if self.udp is not None:
            self.udp.close()
        if self.unix is not None:
            self.unix.close()
            Path(self.path).unlink(missing_ok=True)


def open_doors(settings: DoorSettings) -> Doors:
    """Take the addresses that the settings give. Raises BadInput when one cannot be had, or is no good."""
    mqtt = None
    if settings.mqtt:
        mqtt = read_broker(settings.mqtt, settings.mqtt_topic, settings.mqtt_credentials_file)
    with contextlib.ExitStack() as stack:
        udp = stack.enter_context(bind_udp(settings.udp)) if settings.udp else None
        unix = stack.enter_context(bind_unix(settings.unix)) if settings.unix else None
        stack.pop_all()  # all of them could be had: they stay
    return Doors(udp, unix, mqtt, settings.unix, settings.detections_per_s)


async def _kept(name: str, serving: Coroutine[None, None, None]) -> None:
    try:
        await serving
    except Exception:
        log.exception("the %s door has failed and is closed", name)
