"""The door: detector reports in, state and map out, operator commands. One HTTP port.

It listens on loopback unless told otherwise; on any other address every request needs a bearer token.
"""

from __future__ import annotations

import asyncio
import hmac
import socket
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Annotated, Any, Protocol

import uvicorn
from fastapi import Body, FastAPI, Request, Response
from fastapi.responses import HTMLResponse, JSONResponse, PlainTextResponse
from prometheus_client import CONTENT_TYPE_LATEST, CollectorRegistry, generate_latest

from service.errors import BadInput
from service.intake import JournalLost
from service.reports import Command, Receipt, Report

LOOPBACK = ("127.0.0.1", "::1", "localhost")
MAX_BODY = 1 << 20


class Run(Protocol):
    """What the door shows of a run."""

    registry: CollectorRegistry

    def state(self) -> dict[str, Any]: ...
    def map(self) -> dict[str, Any]: ...
    def picture(self) -> bytes: ...
    def ready(self) -> bool: ...
    async def submit(self, report: Report) -> Receipt: ...
    async def order(self, command: str) -> str: ...


def split_address(text: str) -> tuple[str, int]:
    """'HOST:PORT' as a pair; raises BadInput."""
    host, colon, port = text.rpartition(":")
    if not colon or not port.isdigit() or int(port) > 65535:
        raise BadInput(f"'{text}' is not an address to listen on; give HOST:PORT, such as 127.0.0.1:8080")
    return host.strip("[]") or "127.0.0.1", int(port)


def read_token(host: str, token_file: str) -> str:
    """The bearer token that an address needs: empty on loopback, else the content of the file."""
    if token_file:
        try:
            token = Path(token_file).read_text(encoding="utf-8").strip()
        except OSError as error:
            raise BadInput(f"{token_file}: the token cannot be read ({error.strerror})") from error
        if len(token) < 16:
            raise BadInput(f"{token_file}: a token has at least 16 characters")
        return token
    if host not in LOOPBACK:
        raise BadInput(f"listening on {host} needs a token: name a file with one as http.token_file")
    return ""


def bind(host: str, port: int) -> socket.socket:
    """A listening socket, so that a busy port is known before anything else starts; raises BadInput."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    listener = socket.socket(family, socket.SOCK_STREAM)
    try:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind((host, port))
    except OSError as error:
        listener.close()
        raise BadInput(
            f"cannot listen on {host}:{port} ({error.strerror}); choose another with --http"
        ) from error
    return listener


def create_app(run: Run, token: str = "") -> FastAPI:
    """The application for one run; with a token, every request must carry it."""
    app = FastAPI(
        title="roisearch",
        summary="A search in progress: report frames, read the state, give orders.",
        version="1",
    )

    @app.middleware("http")
    async def guard(request: Request, go_on: Callable[[Request], Awaitable[Response]]) -> Response:
        if token:
            given = request.headers.get("authorization", "")
            if not hmac.compare_digest(given.encode(), f"Bearer {token}".encode()):
                return JSONResponse({"detail": "a bearer token is needed"}, status_code=401)
        length = request.headers.get("content-length", "0")
        if not length.isdigit() or int(length) > MAX_BODY:
            return JSONResponse({"detail": f"a request has at most {MAX_BODY} bytes"}, status_code=413)
        return await go_on(request)

    @app.exception_handler(JournalLost)
    async def journal_lost(_: Request, error: Exception) -> Response:
        return JSONResponse({"detail": str(error)}, status_code=503)

    @app.post("/api/reports", summary="Report what a detector saw in one frame, or in several")
    async def reports(body: Annotated[Report | list[Report], Body()]) -> list[Receipt]:
        batch = body if isinstance(body, list) else [body]
        return list(await asyncio.gather(*(run.submit(report) for report in batch)))

    @app.post("/api/commands", summary="Give an order: hold, resume, return or abort")
    async def commands(command: Command) -> dict[str, str]:
        return {"state": await run.order(command.command)}

    @app.get("/api/state", summary="Where the search stands, and the footprint of a frame taken now")
    async def state() -> Response:
        return JSONResponse(run.state())

    @app.get("/api/map", summary="The belief and the probability of detection, cell by cell")
    async def grid_map() -> Response:
        return JSONResponse(run.map())

    @app.get("/api/map.png", summary="The same as a picture")
    async def picture() -> Response:
        return Response(await asyncio.to_thread(run.picture), media_type="image/png")

    @app.get("/healthz", include_in_schema=False)
    async def healthy() -> Response:
        return PlainTextResponse("ok\n")

    @app.get("/readyz", include_in_schema=False)
    async def ready() -> Response:
        return PlainTextResponse(
            "ready\n" if run.ready() else "waiting\n", status_code=200 if run.ready() else 503
        )

    @app.get("/metrics", include_in_schema=False)
    async def metrics() -> Response:
        return Response(generate_latest(run.registry), media_type=CONTENT_TYPE_LATEST)

    @app.get("/", include_in_schema=False)
    async def page() -> Response:
        return HTMLResponse((Path(__file__).parent / "page.html").read_text(encoding="utf-8"))

    return app


class Server(uvicorn.Server):
    """uvicorn on our socket, leaving signals to the service."""

    def __init__(self, app: FastAPI, listener: socket.socket) -> None:
        config = uvicorn.Config(app, log_level="warning", access_log=False, lifespan="off")
        super().__init__(config)
        self._listener = listener

    def capture_signals(self):  # type: ignore[no-untyped-def]
        """No signal handlers of its own."""
        import contextlib

        return contextlib.nullcontext()

    async def run_until_told(self) -> None:
        """Serve until `should_exit` is set."""
        await self.serve(sockets=[self._listener])
