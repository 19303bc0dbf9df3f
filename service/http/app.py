"""What can be asked at the door, for one run. Who may ask, and how often, is `guard`'s concern."""

from __future__ import annotations

import asyncio
import base64
import hashlib
import json
import re
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Protocol

from fastapi import Body, FastAPI, Request, Response
from fastapi.exceptions import RequestValidationError
from fastapi.openapi.models import Example
from fastapi.responses import HTMLResponse, JSONResponse, PlainTextResponse
from prometheus_client import CONTENT_TYPE_LATEST, CollectorRegistry, generate_latest
from starlette.middleware.cors import CORSMiddleware

from service.config import HttpSettings
from service.http.access import Access
from service.http.guard import Guard, Refusal, client_of, too_many
from service.http.rate import Buckets
from service.intake import JournalLost
from service.reports import EXAMPLES, Command, Receipt, Report

PAGE = Path(__file__).parents[1] / "page.html"
_MOST_COMPLAINTS = 8
_MOST_CHARACTERS = 200


class Run(Protocol):
    """What the door shows of a run."""

    registry: CollectorRegistry

    def state(self) -> dict[str, Any]: ...
    def map(self) -> dict[str, Any]: ...
    def picture(self) -> bytes: ...
    def ready(self) -> bool: ...
    async def submit_all(self, reports: Sequence[Report]) -> list[Receipt]: ...
    async def order(self, command: str, place: tuple[float, float] | None = None) -> str: ...


def create_app(
    run: Run,
    *,
    http: HttpSettings | None = None,
    access: Access | None = None,
    names: Sequence[str] = (),
    any_address: bool = False,
) -> FastAPI:
    """The application for one run, behind its guard; for the arguments see `Guard`."""
    http, access = http or HttpSettings(), access or Access()
    buckets = Buckets()
    app = FastAPI(
        title="roisearch",
        summary="A search in progress: report frames, read the state, give orders.",
        version="1",
    )
    app.add_middleware(Guard, http=http, access=access, names=names, any_address=any_address, buckets=buckets)
    if http.allowed_origins:
        app.add_middleware(
            CORSMiddleware,
            allow_origins=http.allowed_origins,
            allow_methods=["GET", "POST"],
            allow_headers=["authorization", "content-type"],
        )

    @app.exception_handler(JournalLost)
    async def journal_lost(_: Request, error: Exception) -> Response:
        return JSONResponse({"detail": str(error)}, status_code=503)

    @app.exception_handler(RequestValidationError)
    async def not_valid(_: Request, error: Exception) -> Response:
        assert isinstance(error, RequestValidationError)
        return JSONResponse({"detail": complaints(error)}, status_code=422)

    @app.exception_handler(Refusal)
    async def refused(request: Request, error: Exception) -> Response:
        assert isinstance(error, Refusal)
        return error.response(request.scope)

    @app.post("/api/reports", summary="Report what a detector saw in one frame, or in several")
    async def reports(
        request: Request,
        body: Annotated[Report | list[Report], Body(openapi_examples=openapi_examples(EXAMPLES))],
    ) -> list[Receipt]:
        batch = body if isinstance(body, list) else [body]
        if len(batch) > http.max_batch:
            raise Refusal(413, f"a batch has at most {http.max_batch} reports")
        who = (client_of(request.scope), "reports")
        wait = buckets.take(who, http.reports_per_s, time.monotonic(), len(batch))
        if wait:
            raise too_many(http.reports_per_s, wait)
        return await run.submit_all(batch)

    @app.post(
        "/api/commands", summary="Give an order: hold, resume, return or abort; confirm or reject a place"
    )
    async def commands(command: Command) -> dict[str, str]:
        return {"state": await run.order(command.command, command.place)}

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
        text = PAGE.read_text(encoding="utf-8")
        return HTMLResponse(text, headers={"content-security-policy": page_policy(text)})

    return app


def openapi_examples(examples: Mapping[str, Any]) -> dict[str, Example]:
    """Examples by what they say, and all of them as one batch."""
    single: dict[str, Example] = {name: {"summary": name, "value": value} for name, value in examples.items()}
    return {**single, "a batch": {"summary": "a batch", "value": list(examples.values())}}


def complaints(error: RequestValidationError) -> list[dict[str, Any]]:
    """What was wrong with a request, without the input itself: it may hold what JSON cannot say (NaN, half a
    character), be very long, or be a secret that was sent to the wrong place."""
    return [
        {
            "loc": [part if isinstance(part, int) else _printable(part) for part in found["loc"]],
            "msg": _printable(found["msg"]),
            "type": found["type"],
        }
        for found in error.errors()[:_MOST_COMPLAINTS]
    ]


def page_policy(page: str) -> str:
    """A Content-Security-Policy that lets the page run its own scripts and nobody else's (CSP level 3)."""
    hashes = [
        "'sha256-" + base64.b64encode(hashlib.sha256(script.encode()).digest()).decode() + "'"
        for script in re.findall(r"<script>(.*?)</script>", page, re.DOTALL)
    ]
    return "; ".join(
        (
            "default-src 'none'",
            "script-src 'self' " + " ".join(hashes),
            "style-src 'self' 'unsafe-inline'",
            "img-src 'self' blob: data:",
            "connect-src 'self'",
            "frame-ancestors 'none'",
            "base-uri 'none'",
            "form-action 'none'",
        )
    )


def _printable(text: object) -> str:
    """A text that any JSON reader takes: short, and with nothing but whole characters."""
    short = str(text)[:_MOST_CHARACTERS]
    return short if short.isprintable() else json.dumps(short)[1:-1]
