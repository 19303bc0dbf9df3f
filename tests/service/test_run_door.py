"""A door that does not open ends the run before anything flies."""

from __future__ import annotations

import asyncio
import contextlib
import json
from pathlib import Path

import pytest
from rich.console import Console

from service.area import build_grid, parse_area
from service.config import DoorSettings, HttpSettings, Settings
from service.doors import open_doors
from service.evidence.cover import sensors_over
from service.http import open_door
from service.journal import Journal
from service.run import Prepared, Service
from service.search import Search
from tests.integration.flight import FIELD


def test_a_door_that_does_not_open_is_told_before_the_flight(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    settings = Settings.model_validate({"sensor": {"cell_m": 20.0}})
    area = parse_area(json.dumps(FIELD).encode(), source="field")
    search = Search(build_grid(area, 20.0), settings)
    sensors = sensors_over(search.grid, settings)
    monkeypatch.setattr("service.border.keeper.sys.executable", "/bin/false")
    with (
        contextlib.closing(Journal(tmp_path / "journal.sqlite")) as journal,
        contextlib.closing(open_door(HttpSettings(listen="127.0.0.1:0"), {})) as door,
        contextlib.closing(open_doors(DoorSettings())) as doors,
    ):
        prepared = Prepared(area, search.grid, sensors, settings, False, False, door, doors, None, Console())
        with pytest.raises(RuntimeError, match="the doors could not be opened"):
            asyncio.run(asyncio.wait_for(Service(prepared, [search], tmp_path).fly(journal), 30.0))
