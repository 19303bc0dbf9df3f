"""What every request passes before the application sees it; the package says in which order.

Plain ASGI rather than a framework's middleware, because it must see a body as it arrives: a chunked body has
no Content-Length to check.
"""

from __future__ import annotations

import asyncio
import base64
import contextlib
import ipaddress
import json
import math
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar
from urllib.parse import urlsplit

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import JSONResponse
from starlette.types import ASGIApp, Message, Receive, Send
from starlette.types import Scope as Request

from service.config import HttpSettings
from service.http.access import Access, Scope
from service.http.address import LOOPBACK_NAMES, host_name
from service.http.rate import Buckets

READS = frozenset({"GET", "HEAD", "OPTIONS"})
OPEN_PATHS = frozenset({"/", "/docs", "/healthz"})
"""Readable without a token: the page, which asks for one and holds nothing itself, what the API is like, and the
sign of life."""
ASSETS = "/page/"
"""What the page is made of; as open as the page."""
SUBPROTOCOL = "roisearch"
TOKEN_PROTOCOL = "bearer."
"""A browser cannot set the headers of a WebSocket, and a URL ends up in logs and histories: the token comes as one
more subprotocol, base64url after this word. It is never chosen, so it is not sent back."""
ORDERS = "/api/commands"
STOPS = ("hold", "return", "finish", "abort")
"""Orders that stop the aircraft or bring it home."""
MAPS = frozenset({"/api/map", "/api/map.png"})
JSON_KINDS = ("application/json",)
GEOJSON_KINDS = {"/api/news": (*JSON_KINDS, "application/geo+json")}
"""What else a body may be called, by its path: no script of another site can send this unasked either."""
MAY = "roisearch.scope"
"""Under this name the ASGI scope says what the token of a request opens."""

_LINGER_S = 1.0
_PIECE_BYTES = 65_536
_HEADERS = {
    "x-content-type-options": "nosniff",
    "x-frame-options": "DENY",  # nobody lays our buttons under theirs
    "referrer-policy": "no-referrer",
    "cache-control": "no-store",
}


@dataclass(eq=False)
class Refusal(Exception):
    """Why a request goes no further."""

    status: int
    detail: str
    retry_after_s: float = 0.0

    def response(self, request: Request) -> JSONResponse:
        """What to answer; the connection ends where a body may still be coming, which nobody will read."""
        headers = dict(_HEADERS)
        if request.get("method", "GET") not in READS:
            headers["connection"] = "close"
        if self.status == 401:
            headers["www-authenticate"] = "Bearer"
        if self.retry_after_s:
            headers["retry-after"] = str(max(1, math.ceil(self.retry_after_s)))
        return JSONResponse({"detail": self.detail}, self.status, headers)


class Guard:
    """The application behind its checks.

    Args:
        names: the Host names of the address we listen on, beside those of loopback and of the settings.
        any_address: we listen on every address of this machine, so the one a request came to is ours too.
        buckets: the rate limits, shared with the application, which counts the reports in a batch.
    """

    def __init__(
        self,
        app: ASGIApp,
        *,
        http: HttpSettings,
        access: Access,
        names: Sequence[str] = (),
        any_address: bool = False,
        buckets: Buckets,
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        self._app = app
        self._http = http
        self._access = access
        given = [*names, *http.allowed_hosts]
        self._names = LOOPBACK_NAMES | {name for name in map(host_name, given) if name}
        self._any_address = any_address
        self._origins = frozenset(http.allowed_origins)
        self._buckets = buckets
        self._now = now
        self._slots = Slots()

    async def __call__(self, scope: Request, receive: Receive, send: Send) -> None:
        if scope["type"] == "websocket":
            await self._websocket(scope, receive, send)
            return
        if scope["type"] != "http":
            raise RuntimeError(f"the door speaks HTTP and WebSocket, not {scope['type']}")
        headers, incoming = Headers(scope=scope), _Incoming(receive)
        try:
            self._check_host(scope, headers)
            self._check_origin(scope, headers)
            self._check_token(scope, headers)
            self._check_rate(scope)
            kind = _kind(scope["path"])
            with self._slots.taken(kind, scope):
                kinds = GEOJSON_KINDS.get(scope["path"], JSON_KINDS)
                body = await self._body(headers, incoming, kinds)
                if kind != "bodies":
                    await self._pass_on(scope, receive if body is None else _replay(body, receive), send)
            if kind == "bodies":  # whoever gives an order has told it by now
                with self._slots.taken("stops" if _stops(body) else "orders", scope):
                    await self._pass_on(scope, receive if body is None else _replay(body, receive), send)
        except Refusal as refusal:
            if _announces_body(headers):
                await self._discard(incoming)
            await refusal.response(scope)(scope, receive, send)

    async def _pass_on(self, scope: Request, receive: Receive, send: Send) -> None:
        """Let the application answer."""

        async def send_safely(message: Message) -> None:
            if message["type"] == "http.response.start":
                fields = MutableHeaders(scope=message)
                for name, value in _HEADERS.items():
                    fields.setdefault(name, value)
            for piece in _pieces(message):  # what is read slowly waits here, in its slot, and not in buffers
                await send(piece)

        await self._app(scope, receive, send_safely)

    async def _websocket(self, scope: Request, receive: Receive, send: Send) -> None:
        """A WebSocket passes the same checks before it is accepted (RFC 6455, 10.2: it has no same-origin policy)."""
        headers = Headers(scope=scope)
        try:
            self._check_host(scope, headers)
            self._check_origin(scope, headers)
            self._check_token(scope, headers)
            self._check_rate(scope)
        except Refusal as refusal:
            await receive()
            await refusal.response(scope)(scope, receive, send)
            return
        await self._app(scope, receive, send)

    def _check_host(self, request: Request, headers: Headers) -> None:
        given = headers.getlist("host")
        name = host_name(given[0]) if len(given) == 1 else None
        if name is not None and name in self._names:
            return
        if name is not None and self._any_address and name == local_address(request):
            return
        raise Refusal(421, "this is not a name of this service; http.allowed_hosts lists more of them")

    def _check_origin(self, request: Request, headers: Headers) -> None:
        """A page of another site may neither command nor report (RFC 6454; the Fetch standard's metadata)."""
        reads = (
            request.get("method", "") in READS
        )  # a WebSocket is opened from anywhere: as strict as a write
        origins = headers.getlist("origin")
        if len(origins) == 1 and origins[0].lower() in self._origins:
            return
        opened = (
            reads
            and headers.get("sec-fetch-mode") == "navigate"
            and headers.get("sec-fetch-dest") == "document"
        )
        if headers.get("sec-fetch-site", "none") not in ("same-origin", "none") and not opened:
            raise Refusal(403, "a page of another site may not ask this service for anything")
        if origins and not reads and not (len(origins) == 1 and _same(origins[0], headers["host"])):
            raise Refusal(
                403, "a page of another site may not do this; http.allowed_origins lists those that may"
            )

    def _check_token(self, request: Request, headers: Headers) -> None:
        route = (request.get("method", "GET"), request["path"])
        is_open = route[1] in OPEN_PATHS or route[1].startswith(ASSETS)
        request[MAY] = Scope.COMMAND
        if not self._access.needed or (route[0] in READS and is_open):
            return
        given = headers.getlist("authorization")
        if request["type"] == "websocket":
            given += _offered_tokens(headers)
        scope = self._access.scope_of(given[0]) if len(given) == 1 else None
        if scope is None:
            wrong = "this is none of this service's tokens; look for a missing or an additional character"
            raise Refusal(401, wrong if len(given) == 1 else "a bearer token is needed")
        reports = scope is Scope.REPORT and route == ("POST", "/api/reports")
        if scope is not Scope.COMMAND and route[0] not in READS and not reports:
            raise Refusal(403, f"a {scope.value} token does not open this; a command token does")
        request[MAY] = scope

    def _check_rate(self, request: Request) -> None:
        """Reports, reading the state, the page's parts and tiles, commands and other reading each have a bucket."""
        reads, path = request.get("method", "GET") in READS, request["path"]
        past = request["query_string"] != b""  # a moment of history costs more than the present
        frequent = path == "/api/reports" or (path == "/api/state" and not past)
        small = path.startswith((ASSETS, "/tiles/", "/api/pictures/")) or path == "/api/written"
        per_s = self._http.reports_per_s if frequent or small else self._http.commands_per_s
        orders = path == ORDERS  # have a bucket of their own: what else is posted does not empty it
        wait = self._buckets.take((client_of(request), reads, orders, frequent, small), per_s, self._now())
        if wait:
            raise too_many(per_s, wait)

    async def _body(self, headers: Headers, incoming: _Incoming, kinds: Sequence[str]) -> bytes | None:
        """The whole body, within its limits; None when there is none."""
        if not _announces_body(headers):
            return None
        length = headers.get("content-length", "")
        most = self._http.max_body_bytes
        too_large = Refusal(413, f"a request has at most {most} bytes")
        if length and not (length.isascii() and length.isdigit() and len(length) < 16):
            raise Refusal(400, "Content-Length is not a number of bytes")
        if length and int(length) > most:
            raise too_large
        kind = headers.get("content-type", "").partition(";")[0].strip().lower()
        if kind not in kinds:
            raise Refusal(415, f"a body is JSON: send Content-Type: {' or '.join(kinds)}")
        body = bytearray()
        try:
            async with asyncio.timeout(self._http.body_timeout_s):
                while not incoming.ended:
                    message = await incoming.receive()
                    if message["type"] != "http.request":
                        raise Refusal(400, "the connection was closed before the whole body had come")
                    body += message.get("body", b"")
                    if len(body) > most:
                        raise too_large
        except TimeoutError:
            seconds = self._http.body_timeout_s
            raise Refusal(408, f"the body did not come within {seconds:g} s") from None
        return bytes(body)

    async def _discard(self, incoming: _Incoming) -> None:
        """Read on for a moment: a connection closed on what is still coming is reset before its answer is read."""
        left = self._http.max_body_bytes
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(_LINGER_S):
                while left > 0 and not incoming.ended:
                    left -= len((await incoming.receive()).get("body", b""))


class Slots:
    """How many requests of a kind may be under way at a time, and how many of them of one address. Orders have slots of
    their own: however many reports are on their way in and maps on their way out, an order is not refused for them.
    So have the bodies of orders that are still coming, and orders that stop the aircraft, which no other keeps waiting.
    """

    MOST_OF_ONE: ClassVar[Mapping[str, int]] = {"maps": 4, "bodies": 16}
    MOST: ClassVar[Mapping[str, int]] = {
        "bodies": 64, "orders": 32, "stops": 32, "reports": 64, "maps": 8, "others": 64,
    }  # fmt: skip

    def __init__(self) -> None:
        self._taken: Counter[str | tuple[str, str]] = Counter()

    @contextlib.contextmanager
    def taken(self, kind: str, request: Request) -> Iterator[None]:
        """Hold a slot of a kind while a request is answered; raises Refusal when there is none left."""
        of_one, most_of_one = (kind, client_of(request)), self.MOST_OF_ONE.get(kind, self.MOST[kind])
        if self._taken[kind] >= self.MOST[kind]:
            raise Refusal(503, f"{self.MOST[kind]} such requests are under way already; try again", 1.0)
        if self._taken[of_one] >= most_of_one:
            raise Refusal(503, f"{most_of_one} such requests of yours are under way already; try again", 1.0)
        self._taken += Counter((kind, of_one))
        try:
            yield
        finally:
            self._taken -= Counter((kind, of_one))


def _kind(path: str) -> str:
    """Of which slots the first is that a request takes."""
    if path in MAPS:
        return "maps"
    return {ORDERS: "bodies", "/api/reports": "reports"}.get(path, "others")


def _stops(body: bytes | None) -> bool:
    """Whether an order stops the aircraft or brings it home."""
    try:
        order = json.loads(body or b"")
    except (ValueError, RecursionError):
        return False
    return isinstance(order, dict) and order.get("command") in STOPS


class _Incoming:
    """The messages of a request, and whether its last one has come."""

    def __init__(self, receive: Receive) -> None:
        self._receive = receive
        self.ended = False

    async def receive(self) -> Message:
        message = await self._receive()
        self.ended = not message.get("more_body", False)
        return message


def _pieces(message: Message) -> Iterator[Message]:
    """A message with a long body as several with short ones."""
    body, start = message.get("body", b""), 0
    while len(body) - start > _PIECE_BYTES:
        yield {**message, "body": body[start : start + _PIECE_BYTES], "more_body": True}
        start += _PIECE_BYTES
    yield {**message, "body": body[start:]} if start else message


def _announces_body(headers: Headers) -> bool:
    return headers.get("content-length", "0") not in ("", "0") or "transfer-encoding" in headers


def _offered_tokens(headers: Headers) -> list[str]:
    """The tokens among the subprotocols that a WebSocket offers, as Authorization headers have them."""
    offered = [name.strip() for line in headers.getlist("sec-websocket-protocol") for name in line.split(",")]
    tokens = []
    for name in offered:
        if name.startswith(TOKEN_PROTOCOL):
            coded = name[len(TOKEN_PROTOCOL) :]
            try:
                token = base64.urlsafe_b64decode(coded + "=" * (-len(coded) % 4)).decode("ascii")
            except (ValueError, UnicodeDecodeError):
                token = ""
            tokens.append(f"Bearer {token}")
    return tokens


def client_of(request: Request) -> str:
    """The address that a request came from; never what a header says it is."""
    client = request.get("client")
    return str(client[0]) if client else ""


def too_many(per_s: float, wait_s: float) -> Refusal:
    """The refusal of a request over the rate limit."""
    return Refusal(429, f"more than {per_s:g} a second; try again in {wait_s:.1f} s", wait_s)


def local_address(request: Request) -> str | None:
    """The address that a request came to; IPv4's own also where it came to a socket of both."""
    server = request.get("server")
    if not server:
        return None
    text = str(server[0]).lower().partition("%")[0]
    with contextlib.suppress(ValueError):
        mapped = ipaddress.IPv6Address(text).ipv4_mapped
        return text if mapped is None else str(mapped)
    return text


def _same(origin: str, host: str) -> bool:
    """Whether an Origin is that of a page which this service itself has sent to whom it is called `host`."""
    try:
        parts = urlsplit(origin)
        port = parts.port
    except ValueError:
        return False
    if parts.scheme not in ("http", "https") or not parts.netloc:
        return False
    usual = 443 if parts.scheme == "https" else 80
    _, _, given = host.rpartition("]")[2].rpartition(":")
    own_port = int(given) if given.isascii() and given.isdigit() else usual
    return host_name(parts.netloc) == host_name(host) and (port or usual) == own_port


def _replay(body: bytes, receive: Receive) -> Receive:
    """A `receive` that first gives the body as one message."""
    given = False

    async def again() -> Message:
        nonlocal given
        if given:
            return await receive()
        given = True
        return {"type": "http.request", "body": body, "more_body": False}

    return again
