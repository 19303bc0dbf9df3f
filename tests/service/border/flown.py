"""A run that is flown in this process, behind a real door in another."""

from __future__ import annotations

import asyncio
import contextlib
import json
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import httpx
import numpy as np
from prometheus_client import CollectorRegistry, Gauge

from service.area import build_grid, parse_area
from service.border.keeper import serving
from service.config import DoorSettings, HttpSettings
from service.doors import open_doors
from service.errors import BadInput
from service.evidence.reports import OrderReceipt, Receipt, Report
from service.http import open_door
from service.journal import Journal
from service.news.bearing import FieldNews
from service.news.request import NewsRequest
from service.telling import TellingPlan
from service.view.feed import Moment
from service.view.scene import SearchGround
from service.view.state import HeardState
from tests.integration.flight import FIELD

PATIENCE_S = 60.0


def ground() -> SearchGround:
    """The field of the integration tests, in cells of 20 m."""
    grid = build_grid(parse_area(json.dumps(FIELD).encode(), source="field"), 20.0)
    return SearchGround.of(
        parse_area(json.dumps(FIELD).encode(), source="field"),
        grid,
        np.where(grid.searchable, 1, 0),
        "index",
    )


class Flown:
    """Takes what comes, and remembers it."""

    def __init__(self) -> None:
        self.ground = ground()
        self.registry = CollectorRegistry()
        Gauge("roisearch_pos", "as flown", registry=self.registry).set(0.25)
        self.reports: list[Report] = []
        self.orders: list[tuple[str, tuple[float, float] | None]] = []
        self.wanted_system: int | None = None
        self.news: list[FieldNews] = []
        self.looks = 0
        self.fault: Exception | None = None
        self.weights = self.ground.grid.prior.ravel().copy()
        self.tracks: list[list[tuple[float, float]]] = [[]]

    def state(self) -> dict[str, Any]:
        self.looks += 1
        return {
            "state": "HOLDING" if self.orders else "SEARCHING",
            "time": float(self.looks),
            "pos": 0.25,
            "outside": 0.0,
            "regions": [1.0],
            "drawn": {"number": 0, "words": None},
            "reports": {"accepted": len(self.reports)},
            "found": None,
            "pose": None,
            "ahead": [],
            "news": [],
            "steps": 3,
            "flight_time_s": 4.0,
            "aircraft": [{"name": f"drone {number}"} for number in range(1, len(self.tracks) + 1)],
        }

    def moment(self) -> Moment:
        pod = np.zeros(self.ground.grid.frame.shape)
        return Moment(self.state(), self.weights, 1.0, pod, self.tracks, [], [(0.0, 0.0)])

    def fingerprint(self) -> Callable[[], str]:
        return lambda: "a digest"

    def ready(self) -> bool:
        return True

    async def submit_all(self, reports: Sequence[Report]) -> list[Receipt]:
        if self.fault:
            raise self.fault
        self.reports += reports
        return [Receipt(id=report.id, status="accepted", looks=2) for report in reports]

    async def order(
        self,
        command: str,
        place: tuple[float, float] | None = None,
        aircraft: str | None = None,
        system_id: int | None = None,
    ) -> OrderReceipt:
        if self.fault:
            raise self.fault
        self.orders.append((command, place))
        self.wanted_system = system_id
        return OrderReceipt(state="HOLDING")

    async def hear(self, request: NewsRequest) -> HeardState:
        self.news.append(request.news(self.ground.grid, request.id or "news-1"))
        return {"id": self.news[-1].id, "status": "accepted", "cells": len(self.news[-1].cells), "notes": []}

    async def withdraw(self, name: str) -> HeardState:
        (back,) = [each for each in self.news if each.id == name] or [None]
        if back is None:
            raise BadInput(f"there is no news '{name}'")
        self.news.remove(back)
        return {"id": name, "status": "withdrawn", "cells": len(back.cells), "notes": []}


@asynccontextmanager
async def behind_a_door(
    run: Flown,
    folder: Path,
    doors: dict[str, str] | None = None,
    telling: TellingPlan | None = None,
    **http: Any,
) -> AsyncIterator[httpx.AsyncClient]:
    """A client of a run's real door process."""
    _EARLIER.clear()
    _EARLIER.update(await _doors())
    Journal(folder / "journal.sqlite").close()
    settings = HttpSettings.model_validate({"listen": "127.0.0.1:0", **http})
    with (
        contextlib.closing(open_door(settings, {})) as door,
        contextlib.closing(open_doors(DoorSettings.model_validate(doors or {}))) as others,
    ):
        async with (
            serving(door, others, run, run.ground, folder / "journal.sqlite", telling or TellingPlan()),
            httpx.AsyncClient(base_url=door.url, timeout=PATIENCE_S) as client,
        ):
            yield client


_EARLIER: set[int] = set()
"""Door processes of earlier tests that take their time to end."""


async def children() -> list[int]:
    """The door processes that this one has started behind its last door and that still live."""
    return [pid for pid in await _doors() if pid not in _EARLIER]


async def _doors() -> list[int]:
    text = await asyncio.to_thread(Path("/proc/self/task").iterdir)
    found: list[int] = []
    for task in text:
        with contextlib.suppress(FileNotFoundError):  # a thread that has ended since
            found += [int(pid) for pid in (task / "children").read_text().split()]
    return [pid for pid in found if b"service.border" in _command_of(pid)]


def _command_of(pid: int) -> bytes:
    try:
        return Path(f"/proc/{pid}/cmdline").read_bytes()
    except OSError:  # it has ended meanwhile
        return b""
