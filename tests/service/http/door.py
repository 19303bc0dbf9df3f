"""A run that only remembers what it was asked, and its door: in memory, or on a real socket."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager
from typing import Any

import httpx
import numpy as np
from numpy.typing import NDArray

from service.config import HttpSettings
from service.evidence.reports import OrderReceipt, Receipt, Report
from service.http import Access, Door, Server, create_app, open_door, read_access
from service.news.request import NewsRequest
from service.view.feed import Moment
from service.view.state import HeardState

COMMAND, REPORT = "command-token-0123456789", "report-token-0123456789"
HOLD = {"command": "hold"}
FRAME = {"id": "a", "captured_at": 1.0}


class FakeRun:
    """Accepts everything and notes it down."""

    def __init__(self) -> None:
        self.reports: list[Report] = []
        self.orders: list[str] = []
        self.wanted_system: list[int | None] = []

    async def state(self) -> dict[str, Any]:
        return {"state": "SEARCHING", "drawn": {"number": 0, "words": None}}

    async def map(self) -> bytes:
        return b'{"probability": []}'

    async def geojson(self) -> bytes:
        return b'{"type": "FeatureCollection", "features": []}'

    async def picture(self) -> bytes:
        return b"\x89PNG"

    async def metrics(self) -> bytes:
        return b""

    async def decisions(self, count: int) -> bytes:
        return json.dumps([{"reason": "because"}][:count]).encode()

    def scene(self) -> dict[str, Any]:
        return {"area": "field", "drawn": 0}

    def written(self, place: tuple[float, float]) -> str:
        return f"{place[0]:.3f} {place[1]:.3f}"

    async def kept_picture(self, name: str) -> bytes | None:
        return b"\xff\xd8\xff\xd9" if name == "a.jpg" else None

    def searchable(self) -> NDArray[np.bool_]:
        return np.ones((1, 2), dtype=bool)

    async def moment(self) -> Moment:
        return Moment(await self.state(), np.array([0.25, 0.75]), 1.0, np.zeros((1, 2)), [], [], [])

    async def regions(self) -> dict[str, Any]:
        return {"regions": {"type": "FeatureCollection", "features": []}, "names": [], "drawn": 1}

    async def ready(self) -> bool:
        return True

    async def submit_all(self, reports: Sequence[Report]) -> list[Receipt]:
        self.reports += reports
        return [Receipt(id=report.id, status="accepted") for report in reports]

    async def order(
        self,
        command: str,
        place: tuple[float, float] | None = None,
        aircraft: str | None = None,
        system_id: int | None = None,
    ) -> OrderReceipt:
        self.orders.append(command)
        self.wanted_system.append(system_id)
        return OrderReceipt(state="HOLDING")

    async def hear(self, request: NewsRequest) -> HeardState:
        return {"id": request.id or "news-1", "status": "accepted", "cells": 7, "notes": []}

    async def withdraw(self, name: str) -> HeardState:
        return {"id": name, "status": "withdrawn", "cells": 7, "notes": []}


def settings(**values: Any) -> HttpSettings:
    """Settings of a door on a port that the system picks."""
    return HttpSettings.model_validate({"listen": "127.0.0.1:0", **values})


def both_tokens() -> dict[str, str]:
    """An environment with a token of each scope."""
    return {"ROISEARCH_HTTP_TOKEN": COMMAND, "ROISEARCH_HTTP_REPORT_TOKEN": REPORT}


def bearer(token: str) -> dict[str, str]:
    return {"authorization": f"Bearer {token}"}


TOKENS = read_access(settings(), both_tokens(), loopback=False)


def in_memory(
    run: FakeRun, *, http: HttpSettings | None = None, access: Access | None = None, **more: Any
) -> httpx.AsyncClient:
    """A client of the real application, without a socket; whatever the application raises is raised here."""
    app = create_app(run, http=http, access=access, **more)
    return httpx.AsyncClient(transport=httpx.ASGITransport(app=app), base_url="http://127.0.0.1:8080")


@asynccontextmanager
async def on_a_socket(
    run: FakeRun,
    *,
    any_address: bool = False,
    token_environment: dict[str, str] | None = None,
    **values: Any,
) -> AsyncIterator[Door]:
    """The real server, on a real socket; with `any_address` it takes that for one of many that it listens on."""
    door = open_door(settings(**values), token_environment or {})
    server = door.server(run)
    if any_address:
        server = Server(create_app(run, http=door.http, any_address=True), door.listener)
    serving = asyncio.create_task(server.run_until_told())
    try:
        while not server.started:  # noqa: ASYNC110 - uvicorn has nothing to wait for
            await asyncio.sleep(0.01)
        yield door
    finally:
        server.should_exit = True
        await serving
        door.close()


async def say(door: Door, data: bytes, *, pause_s: float = 0.0, patience_s: float = 20.0) -> bytes:
    """Send raw bytes, wait, and read until the other side hangs up or has said nothing more for a while."""
    port = door.listener.getsockname()[1]
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    try:
        writer.write(data)
        await asyncio.sleep(pause_s)
        answer = b""
        async with asyncio.timeout(patience_s):
            while chunk := await reader.read(4096):
                answer += chunk
                if b"connection: close" not in answer and b"\r\n\r\n" in answer:
                    break
        return answer
    finally:
        writer.close()


def ask(
    method: str,
    path: str,
    *,
    json: Any = None,
    headers: dict[str, str] | None = None,
    access: Access | None = None,
    http: HttpSettings | None = None,
    run: FakeRun | None = None,
    **more: Any,
) -> httpx.Response:
    """One request to a fresh door."""

    async def once() -> httpx.Response:
        async with in_memory(run or FakeRun(), http=http, access=access, **more) as client:
            return await client.request(method, path, json=json, headers=headers)

    return asyncio.run(once())
