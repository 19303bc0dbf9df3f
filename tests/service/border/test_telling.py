"""Telling from the real door process: news is out while the run goes on and when it ends, whoever does not listen."""

from __future__ import annotations

import asyncio
import contextlib
import json
import time
from pathlib import Path
from typing import Any

import httpx

from service.border.keeper import serving
from service.config import DoorSettings, HttpSettings
from service.doors import open_doors
from service.http import open_door
from service.journal import Journal
from service.telling.settings import Hook, TellingPlan
from tests.service.telling.seen import found, state, suspect
from tests.service.telling.test_webhook import server, status

from .flown import PATIENCE_S, Flown


class Seen(Flown):
    """A run with a state as those who are told need it."""

    def __init__(self) -> None:
        super().__init__()
        self.changed: dict[str, Any] = {}

    def state(self) -> dict[str, Any]:
        return {**super().state(), **state(**self.changed)}


@contextlib.asynccontextmanager
async def told(run: Seen, folder: Path, hook: Hook) -> Any:
    Journal(folder / "journal.sqlite").close()
    with (
        contextlib.closing(open_door(HttpSettings(listen="127.0.0.1:0"), {})) as door,
        contextlib.closing(open_doors(DoorSettings())) as doors,
    ):
        async with serving(door, doors, run, run.ground, folder / "journal.sqlite", TellingPlan(hook=hook)):
            yield door


def test_a_suspect_and_the_find_are_told_and_the_last_news_when_the_run_ends(tmp_path: Path) -> None:
    run = Seen()

    async def talk() -> list[dict[str, object]]:
        async with server(lambda n: status(200)) as (url, requests):
            async with told(run, tmp_path, Hook(url)):
                run.changed["suspects"] = [suspect()]
                async with asyncio.timeout(PATIENCE_S):
                    while not requests:  # noqa: ASYNC110 - it comes from another process
                        await asyncio.sleep(0.05)
                run.changed["found"] = found()  # and the run is over at once
            return [body for _, body in requests]

    first, last = asyncio.run(talk())
    assert (first["kind"], last["kind"]) == ("suspect", "found")
    assert first["run"] == tmp_path.name


def test_a_receiver_that_never_answers_keeps_neither_the_doors_nor_the_end_waiting(tmp_path: Path) -> None:
    run = Seen()
    run.changed["suspects"] = [suspect()]

    async def hang(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with contextlib.suppress(ConnectionError):
            await reader.read(-1)
        writer.close()

    async def talk() -> float:
        async with await asyncio.start_server(hang, "127.0.0.1", 0) as listening:
            hook = Hook(f"http://127.0.0.1:{listening.sockets[0].getsockname()[1]}/")
            async with told(run, tmp_path, hook) as door:
                async with httpx.AsyncClient(base_url=door.url, timeout=PATIENCE_S) as client:
                    for _ in range(20):
                        assert (await client.get("/api/state")).status_code == 200
                        frame = {"id": "a", "captured_at": 1.0}
                        receipt = (await client.post("/api/reports", json=frame)).json()
                        assert json.loads(json.dumps(receipt))[0]["status"] == "accepted"
                began = time.monotonic()
            return time.monotonic() - began

    from service.border.keeper import END_S

    assert asyncio.run(talk()) < END_S  # it ended by itself, and was not killed
