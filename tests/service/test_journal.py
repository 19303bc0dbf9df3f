"""The journal: on disk when it says so, in order, each key once."""

from __future__ import annotations

import asyncio
import contextlib
import gc
import os
import shutil
import signal
import sqlite3
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from service.errors import BadInput
from service.journal import Duplicate, Journal, read_last, read_meta, read_rows


def filled(path: Path, rows: int) -> Path:
    """A closed journal with some rows."""
    journal = Journal(path)
    journal.set_meta("settings", {"a": 1})

    async def write() -> None:
        for n in range(rows):
            await journal.append(float(n), "look", {"n": n, "text": "3" * n}, key=f"k{n}")

    asyncio.run(write())
    journal.close()
    return path


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
    for reading in (lambda: Journal(path), lambda: read_meta(path, "settings")):
        with pytest.raises(
            BadInput, match=r"schema 99, this version reads 1 to 2; resume it with the version"
        ):
            reading()


def test_a_journal_without_checksums_is_brought_up_to_this_schema(tmp_path: Path) -> None:
    path = filled(tmp_path / "j.sqlite", 5)
    rows = list(read_rows(path))
    with sqlite3.connect(path) as database:
        database.execute("ALTER TABLE events DROP COLUMN crc")
        database.execute("UPDATE meta SET value = '1' WHERE key = 'schema'")
    assert list(read_rows(path)) == rows
    journal = Journal(path)
    asyncio.run(journal.append(9.0, "look", {"n": 9}))
    journal.close()
    again = Journal(path)
    assert again.meta("schema") == 2
    again.close()
    assert [row.seq for row in read_rows(path)] == [1, 2, 3, 4, 5, 6]
    assert list(read_rows(path))[:5] == rows


@pytest.mark.parametrize("damage", ["flip", "cut"])
def test_a_damaged_journal_is_refused_and_never_believed(damage: str, tmp_path: Path) -> None:
    """Whatever byte is flipped, wherever the file ends: the same rows, or a clear refusal."""
    whole = filled(tmp_path / "whole.sqlite", 40)
    rows, content = list(read_rows(whole)), whole.read_bytes()
    rng, refused = np.random.default_rng(5), 0
    for number in range(120):
        where = int(rng.integers(0, len(content)))
        broken = bytearray(content)
        if damage == "flip":
            broken[where] ^= 1 << int(rng.integers(0, 8))
        else:
            del broken[where:]
        path = tmp_path / f"{number}.sqlite"
        path.write_bytes(broken)
        try:
            assert read_meta(path, "settings") == {"a": 1}
            Journal(path).close()
            kept = list(read_rows(path))
        except BadInput:
            refused += 1
        else:
            assert kept == rows, f"{damage} at {where}"
    assert refused >= 10


def test_a_row_that_was_taken_out_is_missed(tmp_path: Path) -> None:
    path = filled(tmp_path / "j.sqlite", 9)
    with sqlite3.connect(path) as database:
        database.execute("DELETE FROM events WHERE seq = 4")
    with pytest.raises(BadInput, match="row 4 is missing"):
        Journal(path)


def test_a_changed_digit_is_noticed(tmp_path: Path) -> None:
    path = filled(tmp_path / "j.sqlite", 9)
    with sqlite3.connect(path) as database:
        database.execute("UPDATE events SET body = replace(body, '3', '4') WHERE seq = 4")
    with pytest.raises(BadInput, match="row 4 is not what was written"):
        Journal(path)


def test_a_full_disk_is_told_to_the_writer_and_remembered_and_nothing_half_written_stays(
    tmp_path: Path,
) -> None:
    path = tmp_path / "j.sqlite"
    journal = Journal(path)
    # a full disk, for the one connection that writes
    journal._database.execute("PRAGMA max_page_count = 12")

    written = 0

    async def write() -> None:
        nonlocal written
        for written in range(10_000):
            await journal.append(0.0, "look", {"n": written, "text": "x" * 500}, key=str(written))

    with pytest.raises(sqlite3.Error, match="full"):
        asyncio.run(write())
    assert "full" in str(journal.failed)
    journal.close()
    Journal(path).close()  # whole, as far as it goes
    assert [row.body["n"] for row in read_rows(path)] == list(range(written))


def test_a_folder_that_cannot_be_written_is_refused_in_a_sentence(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="cannot be opened"):
        Journal(Path("/proc/j.sqlite"))
    path = filled(tmp_path / "j.sqlite", 3)
    script = f"""
import os, sys
from pathlib import Path
from service.errors import BadInput
from service.journal import Journal
if os.geteuid() == 0:
    os.setuid(65534)  # root may write anywhere
try:
    Journal(Path({str(path)!r}))
except BadInput as error:
    sys.exit(str(error))
"""
    tmp_path.chmod(0o555)
    path.chmod(0o444)
    for parent in tmp_path.parents[:2]:
        parent.chmod(0o755)
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    tmp_path.chmod(0o755)
    assert (done.returncode, "cannot be opened" in done.stderr) == (1, True), done.stderr


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


def test_a_run_is_flown_by_one_service_and_read_by_any(tmp_path: Path) -> None:
    path = filled(tmp_path / "j.sqlite", 3)
    journal = Journal(path)
    with pytest.raises(BadInput, match="this run is being flown by another service"):
        Journal(path)
    assert read_meta(path, "settings") == {"a": 1}
    assert len(list(read_rows(path))) == 3
    journal.close()
    Journal(path).close()


def test_a_journal_that_was_refused_is_not_kept_locked(tmp_path: Path) -> None:
    path = tmp_path / "j.sqlite"
    path.write_text("not a database" * 100)
    for _ in range(2):
        with pytest.raises(BadInput, match="cannot be opened"):
            Journal(path)


def test_a_clash_of_row_numbers_is_a_failure_and_no_duplicate(tmp_path: Path) -> None:
    path = filled(tmp_path / "j.sqlite", 3)
    journal = Journal(path)
    with sqlite3.connect(path) as database:
        database.execute("INSERT INTO events VALUES (4, 0.0, 'look', 'theirs', '{}', 0)")

    async def write(key: str | None) -> None:
        await journal.append(0.0, "report", {}, key=key)

    for key in ("mine", None):
        with pytest.raises(sqlite3.IntegrityError, match=r"events\.seq"):
            asyncio.run(write(key))
    assert isinstance(journal.failed, sqlite3.IntegrityError)
    journal.close()


def test_a_failure_that_was_told_is_not_logged_as_forgotten(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    journal = Journal(tmp_path / "j.sqlite")
    with sqlite3.connect(tmp_path / "j.sqlite") as database:
        database.execute("DROP TABLE events")

    async def write() -> None:
        told = ""
        try:
            await journal.append_all([(0.0, "report", "a", "{}")])
        except sqlite3.Error as error:  # not pytest.raises: it would keep the frames, and so the futures
            told = str(error)
        assert "no such table" in told
        journal.failed = None
        gc.collect()

    asyncio.run(write())
    journal.close()
    gc.collect()
    assert "never retrieved" not in caplog.text


def test_what_is_no_json_is_refused_also_among_the_last_rows(tmp_path: Path) -> None:
    path = filled(tmp_path / "j.sqlite", 3)
    with sqlite3.connect(path) as database:
        database.execute("UPDATE events SET body = '{' WHERE seq = 3")
    with pytest.raises(BadInput, match="the journal cannot be read"):
        read_last(path, "look", 2)


def test_a_journal_that_may_not_be_read_is_refused_in_a_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = filled(tmp_path / "j.sqlite", 3)

    def refuse(*_: object, **__: object) -> None:
        raise sqlite3.OperationalError("unable to open database file")

    monkeypatch.setattr(sqlite3, "connect", refuse)
    with pytest.raises(BadInput, match="the journal cannot be read"):
        list(read_rows(path))


@pytest.mark.parametrize("how", ["deleted", "its -wal file deleted", "its folder moved"])
def test_a_journal_that_is_deleted_while_it_is_written_is_lost_and_one_that_is_moved_is_not(
    how: str, tmp_path: Path
) -> None:
    (tmp_path / "run").mkdir()
    with contextlib.closing(Journal(tmp_path / "run" / "journal.sqlite")) as journal:
        journal.write(1.0, "report", {}).result()
        if "deleted" in how:
            if "-wal" in how:
                (tmp_path / "run" / "journal.sqlite-wal").unlink()
            else:
                shutil.rmtree(tmp_path / "run")
            with pytest.raises(sqlite3.Error, match="has been deleted"):
                journal.write(2.0, "report", {}).result()
            assert journal.failed is not None
            return
        (tmp_path / "run").rename(tmp_path / "there")
        journal.write(2.0, "report", {}).result()
    assert len(list(read_rows(tmp_path / "there" / "journal.sqlite"))) == 2
