"""The control socket: faults, state and speed of a running mock, as lines of JSON over TCP.

    {"fault": {"kind": "gps_lost", "seconds": 10}}    let a fault come
    {"clear": "gps_lost"} or {"clear": null}          end the faults of a kind, or all
    {"state": null}                                   the truth about the vehicle
    {"speedup": 20}                                   times faster than the wall clock
    {"waits": false}                                  in lockstep: wait for nobody any more, or again
    {"replace": {"flavor": "px4", "sysid": 7}}        another vehicle in its place, on the same lines

Each line is answered by one: {"ok": true, ...} or {"error": "what is wrong"}. It is for tests and
demonstrations on one machine, and listens on the loopback interface only.
"""

from __future__ import annotations

import asyncio
import json
import math
import socket
from collections.abc import Callable
from types import TracebackType
from typing import Any, Protocol

from sim.autopilot.core import Autopilot
from sim.autopilot.faults import Fault

WORDS = "fault, clear, state, speedup, waits, replace"


class Clock(Protocol):
    """What moves the mock's time on."""

    def set_speedup(self, speedup: float) -> None:
        """Run so many times faster than the wall clock."""

    def set_waits(self, waits: bool) -> None:
        """Wait for who flies in lockstep, or not."""


def state_of(autopilot: Autopilot) -> dict[str, Any]:
    """The truth: what the vehicle is and where it is, whatever its estimate or its link says."""
    vehicle, firmware = autopilot.vehicle, autopilot.firmware
    body = vehicle.body
    latitude, longitude = vehicle.frame.to_e7(body.north, body.east)
    return {
        "time": autopilot.clock,
        "boot_time": vehicle.time,
        "mode": firmware.mode,
        "armed": vehicle.armed,
        "ready": firmware.ready,
        "landed": vehicle.landed.name,
        "latitude": latitude * 1e-7,
        "longitude": longitude * 1e-7,
        "north": body.north,
        "east": body.east,
        "up": body.up,
        "heading": body.yaw % 360.0,
        "above_ground": body.up - vehicle.ground.height(body.north, body.east),
        "crashed": vehicle.crashed,
        "least_clearance": vehicle.least_clearance if math.isfinite(vehicle.least_clearance) else None,
        "speed": body.speed,
        "battery_percent": vehicle.battery.percent,
        "faults": autopilot.faults.active,
    }


def answer(autopilot: Autopilot, line: bytes, clock: Clock) -> dict[str, Any]:
    """Obey one line."""
    try:
        asked = json.loads(line)
        if not isinstance(asked, dict) or len(asked) != 1:
            raise ValueError(f"want one of: {WORDS}")
        (word, value), *_ = asked.items()
        if word == "fault":
            autopilot.faults.add(Fault.of(value if isinstance(value, dict) else {}))
        elif word == "clear":
            autopilot.faults.clear(value)
        elif word == "state":
            return {"ok": True, "state": state_of(autopilot)}
        elif word == "speedup":
            if not isinstance(value, int | float) or not 0.01 <= value <= 100:
                raise ValueError("speedup is from 0.01 to 100")
            clock.set_speedup(float(value))
        elif word == "waits":
            if not isinstance(value, bool):
                raise ValueError("waits is true or false")
            clock.set_waits(value)
        elif word == "replace":
            _replace(autopilot, value)
        else:
            raise ValueError(f"no '{word}'; there are: {WORDS}")
    except ValueError as error:
        return {"error": str(error)}
    return {"ok": True}


def _replace(autopilot: Autopilot, value: Any) -> None:
    match value:
        case {"flavor": str(flavor), "sysid": int(sysid), **rest} if not rest:
            autopilot.replace(flavor, sysid)
        case _:
            raise ValueError('replace wants a flavor and a sysid: {"flavor": "px4", "sysid": 7}')


async def serve(
    autopilot: Autopilot,
    host: str,
    port: int,
    clock: Clock,
    flush: Callable[[], None],
) -> asyncio.Server:
    """Open the control socket."""

    async def client(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        try:
            while line := await reader.readline():
                reply = answer(autopilot, line, clock)
                flush()
                writer.write(json.dumps(reply).encode() + b"\n")
                await writer.drain()
        except (ConnectionError, asyncio.CancelledError):
            return  # the client went away in the middle of a line, or the mock ends
        finally:
            writer.close()

    return await asyncio.start_server(client, host, port)


class Control:
    """A client of the control socket of a mock, as a context manager. Blocking."""

    def __init__(self, url: str) -> None:
        host, _, port = url.removeprefix("tcp://").rpartition(":")
        self._socket = socket.create_connection((host, int(port)), timeout=10)
        self._lines = self._socket.makefile("rb")

    def __enter__(self) -> Control:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Hang up."""
        self._lines.close()
        self._socket.close()

    def ask(self, **words: Any) -> dict[str, Any]:
        """One line and its answer; ValueError if the mock finds it wrong."""
        self._socket.sendall(json.dumps(words).encode() + b"\n")
        reply: dict[str, Any] = json.loads(self._lines.readline())
        if "error" in reply:
            raise ValueError(reply["error"])
        return reply

    def fault(self, kind: str, **options: Any) -> None:
        """Let a fault come, now or when its times say."""
        self.ask(fault={"kind": kind, **options})

    def clear(self, kind: str | None = None) -> None:
        """End the faults of a kind, or all."""
        self.ask(clear=kind)

    def state(self) -> dict[str, Any]:
        """The truth about the vehicle."""
        state: dict[str, Any] = self.ask(state=None)["state"]
        return state

    def replace(self, flavor: str, sysid: int) -> None:
        """Put another vehicle in its place, on the same lines."""
        self.ask(replace={"flavor": flavor, "sysid": sysid})

    def speedup(self, factor: float) -> None:
        """Run so many times faster than the wall clock."""
        self.ask(speedup=factor)

    def waits(self, waits: bool) -> None:
        """In lockstep: wait for who flies with it, or not any more."""
        self.ask(waits=waits)
