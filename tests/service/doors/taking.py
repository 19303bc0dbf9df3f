"""Who takes reports at the doors, and lines for it."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager
from typing import Any

from service.config import DoorSettings
from service.doors import Doors, open_doors
from service.evidence.reports import Receipt, Report

PATIENCE_S = 30.0


class Taker:
    """Takes every report, once."""

    def __init__(self) -> None:
        self.ids: list[str] = []

    async def submit_all(self, reports: Sequence[Report]) -> list[Receipt]:
        receipts = []
        for report in reports:
            known = report.id in self.ids
            receipts.append(Receipt(id=report.id, status="duplicate" if known else "accepted"))
            if not known:
                self.ids.append(report.id)
        return receipts


def lines(*reports: dict[str, Any]) -> bytes:
    return b"".join(json.dumps(report).encode() + b"\n" for report in reports)


def frames(count: int, prefix: str = "f") -> list[dict[str, Any]]:
    return [{"id": f"{prefix}{number}", "captured_at": 1.0} for number in range(count)]


def said(data: bytes) -> list[dict[str, Any]]:
    return [json.loads(line) for line in data.splitlines()]


@asynccontextmanager
async def served(taker: Taker, **settings: str) -> AsyncIterator[Doors]:
    doors = open_doors(DoorSettings.model_validate(settings))
    serving = asyncio.create_task(doors.serve(taker.submit_all))
    try:
        yield doors
    finally:
        serving.cancel()
        await asyncio.wait([serving])
        doors.close()
