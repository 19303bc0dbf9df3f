"""The journal: on disk when it says so, in order, each key once."""

from __future__ import annotations

import asyncio
import os
import signal
import sqlite3
import subprocess
import sys
from pathlib import Path

import pytest

from service.errors import BadInput
from service.journal import Duplicate, Journal, read_rows


def test_rows_come_back_in_order_with_every_bit_of_their_numbers(tmp_path: Path) -> None:
    journal = Journal(tmp_path / "j.sqlite")
    numbers = [0.1 + 0.2, 1e-300, 1 / 3]

    async def write() -> None:
        for index, number in enumerate(numbers):
            await journal.append(float(index), "look" if index else "start", {"p": number})

    asyncio.run(write())
    journal.close()
    rows = list(read_rows(tmp_path / "j.sqlite"))
    assert [row.body["p"] for row in rows] == numbers
    assert [row.kind for row in read_rows(tmp_path / "j.sqlite", "start")] == ["start"]


def test_who_stops_waiting_neither_loses_the_row_nor_the_journal(tmp_path: Path) -> None:
    journal = Journal(tmp_path / "j.sqlite")

    async def write() -> None:
        for n in range(50):
            waiting = asyncio.create_task(journal.append(0.0, "given up", {"n": n}))
            await asyncio.sleep(0)
            waiting.cancel()
        await asyncio.wait_for(journal.append(1.0, "after", {}), timeout=60)

    asyncio.run(write())
    journal.close()
    assert [row.kind for row in read_rows(tmp_path / "j.sqlite")] == ["given up"] * 50 + ["after"]


def test_a_key_is_taken_once_even_among_many_written_together(tmp_path: Path) -> None:
    journal = Journal(tmp_path / "j.sqlite")

    async def write() -> list[object]:
        jobs = [journal.append(0.0, "report", {"n": n}, key=f"k{n % 50}") for n in range(100)]
        return list(await asyncio.gather(*jobs, return_exceptions=True))

    outcomes = asyncio.run(write())
    journal.close()
    assert sum(isinstance(outcome, Duplicate) for outcome in outcomes) == 50
    assert len(list(read_rows(tmp_path / "j.sqlite"))) == 50


def test_what_was_acknowledged_survives_a_kill(tmp_path: Path) -> None:
    script = f"""
import asyncio, sys
from pathlib import Path
from service.journal import Journal
async def main():
    journal = Journal(Path({str(tmp_path / "j.sqlite")!r}))
    for n in range(100000):
        await journal.append(float(n), "look", {{"n": n}})
        print(n, flush=True)
asyncio.run(main())
"""
    process = subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    for line in process.stdout:
        if int(line) >= 40:
            break
    os.kill(process.pid, signal.SIGKILL)
    said = [int(line), *(int(rest) for rest in process.stdout if rest.strip().isdigit())]
    process.wait()
    kept = [row.body["n"] for row in read_rows(tmp_path / "j.sqlite")]
    assert kept[: said[-1] + 1] == list(range(said[-1] + 1))


def test_a_journal_of_another_schema_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "j.sqlite"
    Journal(path).close()
    with sqlite3.connect(path) as database:
        database.execute("UPDATE meta SET value = '99' WHERE key = 'schema'")
    with pytest.raises(BadInput, match="schema 99"):
        Journal(path)


def test_a_file_that_is_no_journal_is_refused(tmp_path: Path) -> None:
    (tmp_path / "j.sqlite").write_text("not a database, whatever its name says" * 100)
    with pytest.raises(BadInput, match="cannot be opened"):
        Journal(tmp_path / "j.sqlite")
    with pytest.raises(BadInput, match="there is no journal here"):
        list(read_rows(tmp_path / "other.sqlite"))


def test_a_write_that_fails_is_told_to_the_writer(tmp_path: Path) -> None:
    journal = Journal(tmp_path / "j.sqlite")
    with sqlite3.connect(tmp_path / "j.sqlite") as database:
        database.execute("DROP TABLE events")

    async def write() -> None:
        await journal.append(0.0, "report", {})

    with pytest.raises(sqlite3.Error, match="no such table"):
        asyncio.run(write())
    journal.close()
