"""The way to a TAK server (TCP, TLS) or to whoever listens on the network (UDP, multicast)."""

from __future__ import annotations

import asyncio
import logging
import socket
import time
from collections.abc import Callable, Sequence
from ipaddress import ip_address

from service.errors import BadInput
from service.telling.cot import Events
from service.telling.searched import Outline
from service.telling.settings import Tak, tls_context
from service.view.state import RunState

log = logging.getLogger("roisearch")
AIRCRAFT_EVERY_S, PLACES_EVERY_S = 2.0, 30.0
RETRY_S = 5.0
_SEND_S = 10.0
_CONNECT_S = 10.0
_TTL = 1
MOST_WAITING = 500


class TakTeller:
    """Sends events of the newest state: the aircraft often, places when they change and again from time to time."""

    def __init__(self, tak: Tak, run: str, clock: Callable[[], float] = time.time) -> None:
        self._tak, self._clock = tak, clock
        self._events = Events(run, tak.callsign)
        self._waiting: asyncio.Queue[bytes] = asyncio.Queue(MOST_WAITING)
        self._aircraft_at = self._places_at = -1e18
        self._places: object = None

    def tell(self, state: RunState) -> None:
        """Take a state in; what nobody takes is replaced by what is newer."""
        now = self._clock()
        if now - self._aircraft_at >= AIRCRAFT_EVERY_S and self._waiting.empty():
            for event in self._events.aircraft(state, now):
                self._aircraft_at = now
                self._waiting.put_nowait(event)
        places = ([(each["lat"], each["lon"]) for each in state["suspects"]], state["found"])
        if places == self._places and now - self._places_at < PLACES_EVERY_S:
            return
        while not self._waiting.empty():  # nobody took these: what is newer says more
            self._waiting.get_nowait()
            self._waiting.task_done()
        self._places, self._places_at = places, now
        for each in self._events.places(state, now):
            if not self._waiting.full():
                self._waiting.put_nowait(each)

    def show(self, ground: Sequence[Outline]) -> None:
        """Take in the ground that was searched; whatever does not fit is told the next time."""
        for each in self._events.searched(ground, self._clock()):
            if not self._waiting.full():
                self._waiting.put_nowait(each)

    async def told(self) -> None:
        """Wait until all is out."""
        await self._waiting.join()

    async def run(self) -> None:
        """Send until cancelled; a server that is away is called again and again."""
        said = ""
        while True:
            try:
                if self._tak.scheme == "udp":
                    await self._datagrams()
                else:
                    await self._stream()
            except (OSError, TimeoutError, BadInput) as error:
                why = str(error) or type(error).__name__
                if why != said:
                    log.warning("the TAK team at %s cannot be told (%s): trying again", self._tak.shown, why)
                said = why
            await asyncio.sleep(RETRY_S)

    async def _datagrams(self) -> None:
        loop = asyncio.get_running_loop()
        (family, _, _, _, address), *_ = await loop.getaddrinfo(
            self._tak.host, self._tak.port, type=socket.SOCK_DGRAM
        )
        with socket.socket(family, socket.SOCK_DGRAM) as out:
            out.setblocking(False)
            if family == socket.AF_INET and ip_address(address[0]).is_multicast:
                out.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, _TTL)
            while True:
                await self._next(lambda event: loop.sock_sendto(out, event, address))

    async def _stream(self) -> None:
        tak = self._tak
        context = tls_context(tak) if tak.scheme == "tls" else None
        async with asyncio.timeout(_CONNECT_S):
            reader, writer = await asyncio.open_connection(tak.host, tak.port, ssl=context)
        log.info("a TAK team is told at %s", tak.shown)
        drain = asyncio.create_task(_read_away(reader))
        try:

            async def send(event: bytes) -> None:
                writer.write(event)
                await writer.drain()

            while not drain.done():
                await self._next(send)
            raise ConnectionError("it has closed the connection")
        finally:
            drain.cancel()
            writer.close()

    async def _next(self, send: Callable[[bytes], object]) -> None:
        """Send the next event; one that cannot be sent is dropped, since a newer one follows."""
        event = await self._waiting.get()
        try:
            async with asyncio.timeout(_SEND_S):
                await send(event)  # type: ignore[misc]
        finally:
            self._waiting.task_done()


async def _read_away(reader: asyncio.StreamReader) -> None:
    """A server sends what others told; unread, it would fill its side and stop taking ours."""
    while await reader.read(1 << 16):
        pass
