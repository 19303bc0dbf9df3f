"""UDP: each datagram holds one or more lines; the receipts come back to where it came from.

A datagram has no token and its sender's address can be made up, so this door is on loopback only: from another machine
report over HTTP, which has tokens, or over MQTT.
"""

from __future__ import annotations

import asyncio
import logging
import socket

from service.doors.lines import SubmitAll, answer
from service.errors import BadInput
from service.http.address import bound_address, split_address

log = logging.getLogger("roisearch")
_BUFFER_BYTES = 4 << 20  # a burst waits in the kernel's memory rather than being lost
_MOST_REPLY_BYTES = 60_000
_MOST_WAITING = 256  # datagrams; more are dropped: who gets no receipt sends again


def bind_udp(address: str) -> socket.socket:
    """A bound socket. Raises BadInput when the address is not one, is taken, or is not on loopback."""
    host, port = split_address(address)
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    listener = socket.socket(family, socket.SOCK_DGRAM)
    try:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _BUFFER_BYTES)
        listener.setblocking(False)
        listener.bind((host, port))
        if not bound_address(listener).is_loopback:
            raise BadInput(
                f"doors.udp = '{address}' is not on loopback, and a datagram has no token; report over HTTP or MQTT "
                "from another machine"
            )
    except BaseException as error:
        listener.close()
        if isinstance(error, (OSError, ValueError)) and not isinstance(error, BadInput):
            reason = getattr(error, "strerror", None) or error
            raise BadInput(f"doors.udp = '{address}' cannot be listened on ({reason})") from error
        raise
    return listener


class _Protocol(asyncio.DatagramProtocol):
    """Hands each datagram to a task of its own."""

    def __init__(self, submit: SubmitAll, group: asyncio.TaskGroup) -> None:
        self._submit, self._group = submit, group
        self._transport: asyncio.DatagramTransport | None = None
        self._waiting = 0
        self._dropped = False

    def connection_made(self, transport: asyncio.DatagramTransport) -> None:  # type: ignore[override]
        self._transport = transport

    def datagram_received(self, data: bytes, addr: tuple[str, int]) -> None:
        if self._waiting >= _MOST_WAITING:
            if not self._dropped:
                log.warning("more datagrams come than can be taken in: some are dropped, and get no receipt")
            self._dropped = True
            return
        self._waiting += 1
        self._group.create_task(self._answer(data, addr))

    def error_received(self, exc: Exception) -> None:
        log.debug("UDP: %s", exc)  # a sender that has closed its socket does not hear its receipts

    async def _answer(self, data: bytes, addr: tuple[str, int]) -> None:
        try:
            receipts = await answer(data, self._submit)
        finally:
            self._waiting -= 1
        assert self._transport is not None
        while receipts:
            end = len(receipts)
            if end > _MOST_REPLY_BYTES:
                end = receipts.rindex(b"\n", 0, _MOST_REPLY_BYTES) + 1
            self._transport.sendto(receipts[:end], addr)
            receipts = receipts[end:]


async def serve_udp(listener: socket.socket, submit: SubmitAll) -> None:
    """Answer datagrams until cancelled."""
    async with asyncio.TaskGroup() as group:
        transport, _ = await asyncio.get_running_loop().create_datagram_endpoint(
            lambda: _Protocol(submit, group), sock=listener
        )
        try:
            await asyncio.get_running_loop().create_future()
        finally:
            transport.close()
