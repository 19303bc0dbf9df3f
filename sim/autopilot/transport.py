"""Carries the bytes of mock autopilots over UDP and TCP and keeps their clocks running, with asyncio.

All the mocks of a process share one `Driver`, so that sixty of them are one timer and not sixty.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable, Sequence
from typing import Any, cast

from sim.autopilot.address import Address
from sim.autopilot.core import Autopilot
from sim.autopilot.firmware import link_floor_s
from sim.autopilot.lockstep import Lockstep
from sim.autopilot.settings import STEP_S

_BEHIND_S = 0.25  # wall time a stalled machine may be behind before the vehicle's clock waits for it
_FORGET_S = 60.0  # wall time after which a UDP peer that says nothing is forgotten
_BACKLOG = 1 << 20  # bytes a TCP peer may leave unread before frames are dropped


class Carrier:
    """One link and the way its frames leave."""

    def __init__(self, autopilot: Autopilot, send: Callable[[list[bytes]], None]) -> None:
        self.autopilot, self.link, self._send = autopilot, autopilot.add_link(), send
        self.heard_at = time.monotonic()

    def flush(self) -> None:
        """Send what waits."""
        outbox = self.link.outbox
        if outbox:
            self.link.outbox = []
            self._send(outbox)

    def receive(self, data: bytes) -> None:
        """Take bytes and send the answers at once."""
        self.heard_at = time.monotonic()
        self.autopilot.receive(self.link, data)
        for carrier in self.autopilot.carriers:
            carrier.flush()


def _carry(autopilots: Sequence[Autopilot], send: Callable[[list[bytes]], None]) -> list[Carrier]:
    """A link to each of the autopilots, all through one socket: what comes in reaches every one."""
    carriers = [Carrier(autopilot, send) for autopilot in autopilots]
    for carrier in carriers:
        carrier.autopilot.carriers.append(carrier)
    return carriers


def _drop(carriers: Sequence[Carrier]) -> None:
    for carrier in carriers:
        carrier.autopilot.carriers.remove(carrier)
        carrier.autopilot.remove_link(carrier.link)


class _Udp(asyncio.DatagramProtocol):
    """A UDP socket; every peer that speaks to it is a link of its own."""

    def __init__(self, autopilots: Sequence[Autopilot], peer: tuple[str, int] | None) -> None:
        self._autopilots, self._fixed = autopilots, peer
        self._peers: dict[Any, list[Carrier]] = {}
        self._transport: asyncio.DatagramTransport | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport = cast(asyncio.DatagramTransport, transport)
        if self._fixed is not None:
            self._carriers(self._fixed)

    def _carriers(self, peer: Any) -> list[Carrier]:
        if peer not in self._peers:
            self._peers[peer] = _carry(self._autopilots, lambda frames: self._send(frames, peer))
        return self._peers[peer]

    def _send(self, frames: list[bytes], peer: Any) -> None:
        if self._transport is not None:
            for frame in frames:
                self._transport.sendto(frame, peer)

    def datagram_received(self, data: bytes, addr: Any) -> None:
        for carrier in self._carriers(addr):
            carrier.receive(data)

    def error_received(self, exc: Exception) -> None:
        """Nobody listens there (yet): what a radio would not even notice."""

    def forget(self) -> None:
        """Drop the peers that have gone silent."""
        long_ago = time.monotonic() - _FORGET_S
        for peer, carriers in tuple(self._peers.items()):
            if carriers[0].heard_at < long_ago and peer != self._fixed:
                del self._peers[peer]
                _drop(carriers)


class _Tcp(asyncio.Protocol):
    """One client of a TCP server."""

    def __init__(self, autopilots: Sequence[Autopilot]) -> None:
        self._autopilots = autopilots
        self._carriers: list[Carrier] = []
        self._transport: asyncio.Transport | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport = cast(asyncio.Transport, transport)
        self._carriers = _carry(self._autopilots, self._send)

    def _send(self, frames: list[bytes]) -> None:
        if self._transport is not None and self._transport.get_write_buffer_size() < _BACKLOG:
            self._transport.write(b"".join(frames))

    def data_received(self, data: bytes) -> None:
        for carrier in self._carriers:
            carrier.receive(data)

    def connection_lost(self, exc: Exception | None) -> None:
        _drop(self._carriers)
        self._carriers, self._transport = [], None


class Mock:
    """An autopilot, or several that share a radio, with its sockets. `addresses` are the bound ones, ports resolved."""

    def __init__(self, autopilot: Autopilot, *others: Autopilot) -> None:
        self.autopilot, self.autopilots = autopilot, (autopilot, *others)
        self.addresses: list[Address] = []
        self._udp: list[_Udp] = []
        self._closers: list[Callable[[], None]] = []

    async def listen(self, address: Address) -> Address:
        """Open one address and return it with its port resolved; OSError if it cannot be had."""
        loop = asyncio.get_running_loop()
        if address.kind == "tcpin":
            server = await loop.create_server(lambda: _Tcp(self.autopilots), address.host, address.port)
            self._closers.append(server.close)
            host, port = server.sockets[0].getsockname()[:2]
        else:
            out = address.kind == "udpout"
            transport, protocol = await loop.create_datagram_endpoint(
                lambda: _Udp(self.autopilots, (address.host, address.port) if out else None),
                local_addr=("0.0.0.0" if not _is_loopback(address.host) else "127.0.0.1", 0)
                if out
                else (address.host, address.port),
            )
            self._udp.append(protocol)
            self._closers.append(transport.close)
            host, port = (address.host, address.port) if out else transport.get_extra_info("sockname")[:2]
        bound = Address(address.kind, host, port)
        self.addresses.append(bound)
        return bound

    def flush(self) -> None:
        """Send what the vehicle has said since."""
        for autopilot in self.autopilots:
            for carrier in tuple(autopilot.carriers):
                carrier.flush()

    def forget(self) -> None:
        """Drop silent UDP peers."""
        for each in self._udp:
            each.forget()

    def close(self) -> None:
        """Close every socket."""
        for close in self._closers:
            close()
        self._closers = []


def _is_loopback(host: str) -> bool:
    return host == "localhost" or host.startswith("127.")


class Driver:
    """Runs the clocks of all mocks of a process, `speedup` times as fast as the wall.

    The vehicles move in steps of the same length whatever the speed-up is. When the machine cannot keep up,
    vehicle time runs slower; it never jumps. In `lockstep` it also waits for who flies with them.
    """

    def __init__(self, mocks: list[Mock], speedup: float, lockstep: Lockstep | None = None) -> None:
        self._mocks, self._lockstep = mocks, lockstep
        self.set_speedup(speedup)

    def set_speedup(self, speedup: float) -> None:
        """Run so many times faster than the wall clock from now on."""
        self._speedup = speedup
        for mock in self._mocks:
            for autopilot in mock.autopilots:
                autopilot.firmware.link_floor_s = link_floor_s(speedup)

    def set_waits(self, waits: bool) -> None:
        """Wait for who flies in lockstep from now on, or not any more; without lockstep it changes nothing."""
        if self._lockstep is not None:
            self._lockstep.waits = waits

    async def run(self) -> None:
        """Run until cancelled."""
        last, owed, swept = time.monotonic(), 0.0, time.monotonic()
        while True:
            period = min(STEP_S, max(0.002, STEP_S / self._speedup))
            await asyncio.sleep(period)
            now = time.monotonic()
            owed = min(owed + (now - last) * self._speedup, _BEHIND_S * self._speedup)
            last = now
            steps = int(owed / STEP_S)
            if self._lockstep is not None:
                steps = self._lockstep.steps(steps, self._speedup)
            if steps == 0:
                continue
            owed = max(0.0, owed - steps * STEP_S)
            for mock in self._mocks:
                for autopilot in mock.autopilots:
                    autopilot.advance(steps)
                mock.flush()
            if now - swept > 10.0:
                swept = now
                for mock in self._mocks:
                    mock.forget()
