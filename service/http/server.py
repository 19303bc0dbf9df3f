"""uvicorn on a socket of ours, with its patience limited."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import socket
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import ClassVar

import h11
import uvicorn
from fastapi import FastAPI
from uvicorn.protocols.http.h11_impl import H11Protocol

from service.config import HttpSettings, PageSettings
from service.http.access import Access, read_access
from service.http.address import bind, bound_address, split_address, url_of
from service.http.app import create_app
from service.http.crowd import Crowd
from service.http.run import PastRun, ShownRun
from service.view.underlay import NO_UNDERLAY, Underlay, open_underlay

_MOST_HEADER_BYTES = 16_384
_READ_BYTES = 16_384
_WISH_BYTES = 1_024
"""Read at a time of a watcher, which has nothing to say but a time."""
_ACCEPTED_AT_ONCE = 8
"""Connections, before whoever is connected already has a turn."""
_QUEUE_OF_NEWCOMERS = 256
_KEEP_ALIVE_S = 15
_SHUTDOWN_S = 2
_PING_S = 10.0
_LEAST_BYTES_PER_S = 8_192  # 64 kbit/s


@dataclass(frozen=True)
class Door:
    """An address that is ours, and who may enter there; nothing is served before `server`."""

    http: HttpSettings
    listener: socket.socket
    access: Access
    underlay: Underlay = NO_UNDERLAY

    @property
    def url(self) -> str:
        """A URL by which this machine itself reaches the door."""
        return url_of(self.listener)

    @property
    def address(self) -> str:
        """Where it listens, for a person to read; the URL comes first."""
        bound = bound_address(self.listener)
        everywhere = f" and at every other address of this machine ({bound})" if bound.is_unspecified else ""
        return f"{self.url}{everywhere}"

    def with_guest(self) -> tuple[Door, str]:
        """This door with one more report token, and that token (empty where none is needed)."""
        access, token = self.access.with_guest()
        return replace(self, access=access), token

    def server(self, run: ShownRun, past: PastRun | None = None) -> Server:
        """A server of a run at this door; for `past` see `create_app`."""
        return self.serving(lambda **known: create_app(run, http=self.http, past=past, **known))

    def serving(self, create: Callable[..., FastAPI]) -> Server:
        """A server of the application that `create` makes, of who may enter here and by which names it is called."""
        address = bound_address(self.listener)
        name = split_address(self.http.listen)[0]
        app = create(
            access=self.access,
            names=() if address.is_unspecified else (name if ":" not in name else f"[{name}]", f"{address}"),
            any_address=address.is_unspecified,
            underlay=self.underlay,
        )
        return Server(app, self.listener, self.http)

    def close(self) -> None:
        """Give the address up."""
        self.listener.close()


def open_door(http: HttpSettings, environment: Mapping[str, str], page: PageSettings | None = None) -> Door:
    """Take the address and read the tokens, before anything else starts.

    Raises:
        BadInput: the address is not one or is taken, a token is missing, unreadable or weak, or there are no
            such map tiles.
    """
    underlay = open_underlay(page or PageSettings())
    listener = bind(*split_address(http.listen))
    try:
        access = read_access(http, environment, loopback=bound_address(listener).is_loopback)
    except BaseException:
        listener.close()
        raise
    return Door(http, listener, access, underlay)


class Impatient(H11Protocol):
    """uvicorn's protocol that also hangs up on who does not come to the end of a request's headers or hardly reads an
    answer, keeps to a crowd, and reads little at a time, so that whoever sends much takes turns with the others."""

    patience_s = 5.0
    reading_s: ClassVar[float] = 5.0
    """Over so long it is looked at how fast an answer is read."""
    _reading: asyncio.TimerHandle | None = None
    crowd = Crowd()
    _address = ""
    _hang_up: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """A client has connected."""
        super().connection_made(transport)
        transport.max_size = _READ_BYTES  # type: ignore[attr-defined]  # of asyncio's transport
        self._address = str(self.client[0]) if self.client else ""
        self.crowd.enter(self, self._address)
        self._watch()

    def data_received(self, data: bytes) -> None:
        """Some bytes of a request."""
        self.crowd.heard(self, self._address)
        super().data_received(data)
        self._watch()

    def pause_writing(self) -> None:
        """Much of an answer waits to be read."""
        super().pause_writing()
        self._look_on(self.transport.get_write_buffer_size())

    def resume_writing(self) -> None:
        """It has been read."""
        super().resume_writing()
        self._look_away()

    def _look_on(self, waiting: int) -> None:
        self._reading = self.loop.call_later(self.reading_s, self._look_again, waiting)

    def _look_again(self, before: int) -> None:
        waiting = self.transport.get_write_buffer_size()
        if before - waiting < self.reading_s * _LEAST_BYTES_PER_S:
            self.transport.abort()  # which also forgets what waits
        else:
            self._look_on(waiting)

    def _look_away(self) -> None:
        if self._reading is not None:
            self._reading.cancel()
            self._reading = None

    def handle_websocket_upgrade(self, event: h11.Request) -> None:
        """The connection is a WebSocket's from now on."""
        self.transport.max_size = _WISH_BYTES  # type: ignore[attr-defined]
        self._look_away()
        self._leave()
        super().handle_websocket_upgrade(event)

    def connection_lost(self, exc: Exception | None) -> None:
        """The client is gone."""
        super().connection_lost(exc)
        self._look_away()
        self._leave()

    def idle(self) -> bool:
        """True while no request is being answered."""
        return self.cycle is None or self.cycle.response_complete

    def asked(self) -> bool:
        """True once the headers of a request were all there."""
        return self.cycle is not None

    def hang_up(self) -> None:
        """Make room for others."""
        self.transport.abort()

    def _leave(self) -> None:
        self.crowd.leave(self, self._address)
        if self._hang_up is not None:
            self._hang_up.cancel()
            self._hang_up = None

    def _watch(self) -> None:
        waiting = self.conn.their_state is h11.IDLE
        if waiting and self._hang_up is None:
            self._hang_up = self.loop.call_later(self.patience_s, self.transport.close)
        elif not waiting and self._hang_up is not None:
            self._hang_up.cancel()
            self._hang_up = None


class Server(uvicorn.Server):
    """uvicorn on our socket, leaving signals and words to the service."""

    def __init__(self, app: FastAPI, listener: socket.socket, http: HttpSettings | None = None) -> None:
        patience_s = (http or HttpSettings()).body_timeout_s
        # what uvicorn says is about strangers' mistakes; what goes wrong in the application, that says itself
        logging.getLogger("uvicorn").setLevel(logging.CRITICAL + 1)
        config = uvicorn.Config(
            app,
            http=type("Impatient", (Impatient,), {"patience_s": patience_s, "crowd": Crowd()}),
            ws="websockets-sansio",
            ws_max_size=_MOST_HEADER_BYTES,  # all that a watcher ever says is a time to look at
            ws_ping_interval=_PING_S,
            ws_ping_timeout=_PING_S,
            backlog=_ACCEPTED_AT_ONCE,  # so many are accepted before anything else has its turn
            lifespan="off",
            log_config=None,
            access_log=False,  # a path may hold anything that somebody pasted into it
            proxy_headers=False,  # who asks is who is connected, not who a header says
            server_header=False,
            timeout_keep_alive=_KEEP_ALIVE_S,
            timeout_graceful_shutdown=_SHUTDOWN_S,
            h11_max_incomplete_event_size=_MOST_HEADER_BYTES,
        )
        super().__init__(config)
        self._listener = listener

    @contextlib.contextmanager
    def capture_signals(self):  # type: ignore[no-untyped-def]
        """No signal handlers of its own."""
        yield

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Begin to serve; the kernel may keep more newcomers than are accepted at once."""
        await super().startup(sockets)
        self._listener.listen(_QUEUE_OF_NEWCOMERS)

    async def run_until_told(self) -> None:
        """Serve until `should_exit` is set."""
        await self.serve(sockets=[self._listener])
