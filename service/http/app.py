"""What can be asked at the door, for one run. Who may ask, and how often, is `guard`'s concern."""

from __future__ import annotations

import asyncio
import json
import logging
import time
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Literal

from fastapi import Body, FastAPI, Path, Query, Request, Response
from fastapi.exceptions import RequestValidationError
from fastapi.openapi.models import Example
from fastapi.responses import FileResponse, HTMLResponse, JSONResponse, PlainTextResponse
from prometheus_client import CONTENT_TYPE_LATEST
from pydantic import Field, ValidationError, WrapValidator
from starlette.middleware.cors import CORSMiddleware

from service.complaint import complaint
from service.config import MOST_BATCH, HttpSettings
from service.errors import BadInput
from service.evidence.reports import EXAMPLES, OrderReceipt, OrderRequest, Receipt, Report, field_names
from service.http import examples
from service.http.access import Access
from service.http.docs import describe_api
from service.http.events import Watchers
from service.http.guard import Guard, Refusal, client_of, too_many
from service.http.page import FOLDER, PICTURE_HEADERS, PageFiles, policy
from service.http.rate import Buckets
from service.http.run import PastRun, ShownMoment, ShownRun, Unanswered
from service.journal import JournalLost
from service.news.request import EXAMPLES as NEWS_EXAMPLES
from service.news.request import NewsRequest
from service.view.state import HeardState, RunState
from service.view.underlay import NO_UNDERLAY, Underlay

log = logging.getLogger("roisearch")
At = Annotated[
    float | None,
    Query(description="of a replay: the time to look at, seconds since the epoch", allow_inf_nan=False),
]
Batch = Annotated[list[Report], Field(max_length=MOST_BATCH)]
Unchecked = WrapValidator(lambda given, _: given)
"""Described as what it should be, and taken as it comes: `_checked` checks it in turns."""

_MOST_COMPLAINTS = 8
_MOST_CHARACTERS = 200
_MOST_DECISIONS = 1000


def create_app(
    run: ShownRun,
    *,
    http: HttpSettings | None = None,
    access: Access | None = None,
    names: Sequence[str] = (),
    any_address: bool = False,
    underlay: Underlay | None = None,
    past: PastRun | None = None,
) -> FastAPI:
    """The application for one run, behind its guard; for the other arguments see `Guard`.

    Args:
        underlay: map tiles for the page.
        past: the run, when it is over and is looked at with `?at=`; `run` is then its end.
    """
    underlay = underlay or NO_UNDERLAY
    http, access = http or HttpSettings(), access or Access()
    buckets = Buckets()
    app = FastAPI(
        title="roisearch",
        summary="A search in progress: report frames, read the state, give orders.",
        version="1",
        docs_url=None,
        redoc_url=None,
    )
    app.add_middleware(Guard, http=http, access=access, names=names, any_address=any_address, buckets=buckets)
    if http.allowed_origins:
        app.add_middleware(
            CORSMiddleware,
            allow_origins=http.allowed_origins,
            allow_methods=["GET", "POST"],
            allow_headers=["authorization", "content-type"],
        )

    def only_live() -> None:
        if past is not None:
            raise Refusal(409, "this is a replay: it takes neither reports nor orders")

    @app.exception_handler(JournalLost)
    async def journal_lost(_: Request, error: Exception) -> Response:
        return JSONResponse({"detail": str(error)}, status_code=503)

    @app.exception_handler(Unanswered)
    async def unanswered(_: Request, error: Exception) -> Response:
        return JSONResponse({"detail": str(error)}, status_code=503)

    @app.exception_handler(BadInput)
    async def bad(_: Request, error: Exception) -> Response:
        return JSONResponse({"detail": str(error)}, status_code=422)

    @app.exception_handler(Exception)
    async def at_fault(_: Request, error: Exception) -> Response:
        log.error("a request could not be answered", exc_info=error)
        return JSONResponse({"detail": "internal error"}, status_code=500)

    @app.exception_handler(RequestValidationError)
    async def not_valid(_: Request, error: Exception) -> Response:
        assert isinstance(error, RequestValidationError)
        return JSONResponse({"detail": complaints(error)}, status_code=422)

    @app.exception_handler(Refusal)
    async def refused(request: Request, error: Exception) -> Response:
        assert isinstance(error, Refusal)
        return error.response(request.scope)

    @app.post(
        "/api/reports",
        summary="Report what a detector saw in one frame, or in several",
        response_model=list[Receipt],
        responses=examples.RECEIPTS,
    )
    async def reports(
        request: Request,
        body: Annotated[Report | Batch, Unchecked, Body(openapi_examples=openapi_examples(EXAMPLES))],
    ) -> Response:
        only_live()
        batch = await _checked(body, http.max_batch)
        who = (client_of(request.scope), "reports")
        wait = buckets.take(who, http.reports_per_s, time.monotonic(), len(batch))
        if wait:
            raise too_many(http.reports_per_s, wait)
        detections = sum(len(report.detections) for report in batch)
        if detections:
            who, most = (client_of(request.scope), "detections"), http.detections_per_s
            if wait := buckets.take(who, most, time.monotonic(), detections):
                raise Refusal(429, f"more than {most:g} detections a second; try again in {wait:.1f} s", wait)
        return JSONResponse([receipt.model_dump() for receipt in await run.submit_all(batch)])

    @app.post(
        "/api/commands",
        summary="Give an order, to one aircraft or all: hold, resume, return, launch, finish, abort; confirm or reject",
        response_model=OrderReceipt,
        response_model_exclude_none=True,
        responses=examples.ORDERED,
    )
    async def commands(
        command: Annotated[OrderRequest, Body(openapi_examples=examples.COMMANDS)],
    ) -> OrderReceipt:
        only_live()
        return await run.order(command.command, command.place, command.aircraft, command.system_id)

    @app.post(
        "/api/news",
        summary="Tell news from the field: a clue, ground that others have searched, ground not to fly over any more",
        response_model=HeardState,
        responses=examples.HEARD,
    )
    async def news(
        feature: Annotated[NewsRequest, Body(openapi_examples=named_examples(NEWS_EXAMPLES))],
    ) -> HeardState:
        only_live()
        return await run.hear(feature)

    @app.post(
        "/api/news/{name:path}/withdraw",
        summary="Take news back: the belief is then what it would be had they never come",
        response_model=HeardState,
        responses=examples.HEARD,
    )
    async def withdraw(name: Annotated[str, Path(max_length=64)]) -> HeardState:
        only_live()
        return await run.withdraw(name)

    def then(at: float | None) -> ShownMoment:
        if at is None:
            return run
        if past is None:
            raise Refusal(404, "this run is live, it has no 'at'; a replay has")
        return past.at(at)

    @app.get(
        "/api/state",
        summary="Where the search stands, and the footprint of a frame taken now",
        response_model=RunState,
        responses=examples.STATE,
    )
    async def state(at: At = None) -> Response:
        return JSONResponse(await then(at).state())

    @app.get(
        "/api/map",
        summary="The belief and the probability of detection, cell by cell, or as GeoJSON",
        responses=examples.MAP,
    )
    async def grid_map(
        at: At = None,
        format: Annotated[
            Literal["cells", "geojson"], Query(description="rows of cells, or RFC 7946")
        ] = "cells",
    ) -> Response:
        if format == "geojson":
            return Response(await then(at).geojson(), media_type="application/geo+json")
        return Response(await then(at).map(), media_type="application/json")

    @app.get(
        "/api/map.png", summary="The same as a picture", response_class=Response, responses=examples.PICTURE
    )
    async def picture(at: At = None) -> Response:
        return Response(await then(at).picture(), media_type="image/png")

    @app.get(
        "/api/decisions",
        summary="The last decisions with their reasons and options, the newest first",
        responses=examples.DECISIONS,
    )
    async def decisions(
        at: At = None, count: Annotated[int, Query(ge=1, le=_MOST_DECISIONS)] = 20
    ) -> Response:
        return Response(await then(at).decisions(count), media_type="application/json")

    @app.get(
        "/api/written",
        summary="A place as the team writes places (run.coordinates)",
        responses=examples.WRITTEN,
    )
    async def written(
        lat: Annotated[float, Query(ge=-90, le=90, allow_inf_nan=False)],
        lon: Annotated[float, Query(ge=-180, le=180, allow_inf_nan=False)],
    ) -> dict[str, str]:
        return {"written": run.written((lat, lon))}

    @app.get(
        "/api/pictures/{name}",
        summary="A picture that came with a report",
        response_class=Response,
        responses=examples.JPEG,
    )
    async def kept_picture(name: Annotated[str, Path(max_length=80)]) -> Response:
        data = await run.kept_picture(name)
        if data is None:
            raise Refusal(404, "there is no such picture")
        return Response(data, media_type="image/jpeg", headers=PICTURE_HEADERS)

    @app.get(
        "/api/replay",
        summary="From when to when a replay goes; 404 for a live run",
        responses=examples.REPLAY,
    )
    async def replay() -> dict[str, float]:
        if past is None:
            raise Refusal(404, "this run is live; 'roisearch-service replay RUN' shows one that is over")
        first, last = past.span()
        return {"from": first, "to": last}

    watchers = Watchers(run, past, {"tiles": underlay.describe(), "replay": past and list(past.span())})
    app.add_api_websocket_route("/api/events", watchers.serve)

    @app.get("/tiles/{z}/{x}/{y}", include_in_schema=False)
    async def tile(z: int, x: int, y: int) -> Response:
        data = await asyncio.to_thread(underlay.tile, z, x, y)
        if data is None:
            raise Refusal(404, "there is no such tile")
        return Response(data, media_type=underlay.kind, headers={"cache-control": "private, max-age=86400"})

    @app.get("/healthz", include_in_schema=False)
    async def healthy() -> Response:
        await run.ready()  # a door behind which nobody answers is no sign of life
        return PlainTextResponse("ok\n")

    @app.get("/readyz", include_in_schema=False)
    async def ready() -> Response:
        is_ready = await run.ready()
        return PlainTextResponse("ready\n" if is_ready else "waiting\n", status_code=200 if is_ready else 503)

    @app.get("/metrics", include_in_schema=False)
    async def metrics() -> Response:
        return Response(await run.metrics(), media_type=CONTENT_TYPE_LATEST)

    @app.get("/", include_in_schema=False)
    async def page() -> Response:
        headers = {"content-security-policy": policy(underlay.source)}
        return FileResponse(FOLDER / "index.html", headers=headers)

    @app.get("/docs", include_in_schema=False)
    async def docs() -> Response:
        return HTMLResponse(describe_api(app.openapi()), headers={"content-security-policy": policy()})

    app.mount("/page", PageFiles(directory=FOLDER))
    return app


async def _checked(body: Any, most: int) -> list[Report]:
    """The reports of a request. They are checked one after the other, and others have their turn between: a batch may
    hold thousands of detections, which takes a tenth of a second.

    Raises RequestValidationError, Refusal.
    """
    several = isinstance(body, list)
    if several and len(body) > most:  # before they are checked, which takes longer than reading them
        raise Refusal(413, f"a batch has at most {most} reports")
    reports: list[Report] = []
    faults: list[Any] = []
    for number, given in enumerate(body if several else [body]):
        try:
            reports.append(Report.model_validate(given))
        except ValidationError as error:
            where = ("body", number) if several else ("body",)
            faults += [{**fault, "loc": (*where, *fault["loc"])} for fault in error.errors()]
            if len(faults) >= _MOST_COMPLAINTS:
                break
        await asyncio.sleep(0)
    if faults:
        raise RequestValidationError(faults, body=body)
    return reports


def named_examples(examples: Mapping[str, Any]) -> dict[str, Example]:
    """Examples by what they say."""
    return {name: {"summary": name, "value": value} for name, value in examples.items()}


def openapi_examples(examples: Mapping[str, Any]) -> dict[str, Example]:
    """Examples by what they say, and all of them as one batch."""
    return {**named_examples(examples), "a batch": {"summary": "a batch", "value": list(examples.values())}}


def complaints(error: RequestValidationError) -> list[dict[str, Any]]:
    """What was wrong with a request, without the input itself: it may hold what JSON cannot say (NaN, half a
    character), be very long, or be a secret that was sent to the wrong place."""
    told = []
    for found in error.errors()[:_MOST_COMPLAINTS]:
        shown = [part if isinstance(part, int) else _printable(part) for part in found["loc"]]
        told.append({"loc": shown, "msg": _printable(complaint(found, field_names())), "type": found["type"]})
    return told


def _printable(text: object) -> str:
    """A text that any JSON reader takes: short, and with nothing but whole characters."""
    short = str(text)[:_MOST_CHARACTERS]
    return short if short.isprintable() else json.dumps(short)[1:-1]
