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
_ANSWERED_AT_ONCE = 2  # datagrams; the flight has taken one in while the next is read


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
    """Lets datagrams wait for those who answer them."""

    def __init__(self) -> None:
        self.waiting: asyncio.Queue[tuple[bytes, tuple[str, int]]] = asyncio.Queue(_MOST_WAITING)
        self._dropped = False

    def datagram_received(self, data: bytes, addr: tuple[str, int]) -> None:
        try:
            self.waiting.put_nowait((data, addr))
        except asyncio.QueueFull:
            if not self._dropped:
                log.warning("more datagrams come than can be taken in: some are dropped, and get no receipt")
            self._dropped = True

    def error_received(self, exc: Exception) -> None:
        log.debug("UDP: %s", exc)  # a sender that has closed its socket does not hear its receipts


async def _answer(protocol: _Protocol, transport: asyncio.DatagramTransport, submit: SubmitAll) -> None:
    """Answer one datagram after the other. With a task for each, all of them have a turn before an order has its
    next."""
    while True:
        data, sender = await protocol.waiting.get()
        receipts = await answer(data, submit)
        while receipts:
            end = len(receipts)
            if end > _MOST_REPLY_BYTES:
                end = receipts.rindex(b"\n", 0, _MOST_REPLY_BYTES) + 1
            transport.sendto(receipts[:end], sender)
            receipts = receipts[end:]


async def serve_udp(listener: socket.socket, submit: SubmitAll) -> None:
    """Answer datagrams until cancelled."""
    transport, protocol = await asyncio.get_running_loop().create_datagram_endpoint(_Protocol, sock=listener)
    try:
        async with asyncio.TaskGroup() as group:
            for _ in range(_ANSWERED_AT_ONCE):
                group.create_task(_answer(protocol, transport, submit))
    finally:
        transport.close()
