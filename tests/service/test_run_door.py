"""A door that does not open ends the run before anything flies."""

from __future__ import annotations

import asyncio
import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from rich.console import Console

from service.area import build_grid, parse_area
from service.config import Settings
from service.evidence.sensors import make_sensor
from service.journal import Journal
from service.run import Service
from service.search import Search
from tests.integration.flight import FIELD


def test_a_door_that_does_not_open_is_told_before_the_flight(tmp_path: Path) -> None:
    settings = Settings.model_validate({"sensor": {"cell_m": 20.0}})
    area = parse_area(json.dumps(FIELD).encode(), source="field")
    search = Search(build_grid(area, 20.0), settings)
    service = Service(area, search, make_sensor(settings, search.grid), settings, tmp_path, Console())

    async def shut() -> None:
        raise OSError("the door is jammed")

    async def serve(*_: object) -> None:
        await asyncio.sleep(60.0)

    server = SimpleNamespace(started=False, run_until_told=shut)
    door: Any = SimpleNamespace(server=lambda view: server)
    door.with_guest = lambda: (door, "")
    doors: Any = SimpleNamespace(serve=serve)
    journal = Journal(tmp_path / "journal.sqlite")
    with pytest.raises(OSError, match="jammed"):
        asyncio.run(asyncio.wait_for(service.fly(door, doors, journal, None), 30.0))
    assert service.world is None
    journal.close()
