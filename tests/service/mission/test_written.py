"""Rows on their way to disk: what waits for them, and what is told when they never get there."""

from __future__ import annotations

import asyncio
import contextlib
import sqlite3
from pathlib import Path
from typing import Any

import pytest

from service.clock import Clock
from service.journal import Journal, JournalLost, read_rows
from service.mission.written import WrittenRows
from service.rows import OrderRow


class Broken(Journal):
    """A journal whose rows fail as a full disk makes them fail."""

    def write(self, *given: Any, **named: Any) -> Any:
        written = super().write(*given, **named)
        written.result()
        failing: Any = type(written)()
        failing.set_exception(sqlite3.OperationalError("database or disk is full"))
        return failing


def test_all_rows_before_are_on_disk_and_of_their_aircraft(tmp_path: Path) -> None:
    async def once() -> bool:
        with contextlib.closing(Journal(tmp_path / "journal.sqlite")) as journal:
            rows = WrittenRows(journal, Clock(), "north")
            for command in ("hold", "resume"):
                rows.write(OrderRow(command, "SEARCHING"))
            there = await rows.all_on_disk()
            kept = [row.body for row in read_rows(journal.path, "order")]
        assert [(each["command"], each["aircraft"]) for each in kept] == [
            ("hold", "north"),
            ("resume", "north"),
        ]
        return there

    assert asyncio.run(once())


def test_a_row_that_cannot_be_written_is_told_where_it_happened(tmp_path: Path) -> None:
    async def once() -> tuple[bool, JournalLost | None]:
        with contextlib.closing(Broken(tmp_path / "journal.sqlite")) as journal:
            rows = WrittenRows(journal, Clock(), "")
            assert rows.lost is None
            with pytest.raises(JournalLost, match=r"journal\.sqlite cannot be written: .* is full"):
                await rows.on_disk(OrderRow("hold", "SEARCHING"))
            return await rows.all_on_disk(), rows.lost

    there, lost = asyncio.run(once())
    assert not there
    assert lost is not None
    assert "disk is full" in str(lost)
