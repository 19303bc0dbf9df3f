"""A journal that has lost its end, and one that another program holds up."""

from __future__ import annotations

import shutil
import sqlite3
import time
from pathlib import Path

import numpy as np
import pytest

from service import journal as journal_module
from service.errors import BadInput
from service.journal import Journal, read_meta, read_rows
from service.mark import mark_path, read_mark

ROWS = 60


def abandoned(folder: Path) -> Path:
    """A journal as a killed service leaves it: its newest rows are in the -wal file."""
    folder.mkdir()
    live = Journal(folder / "live.sqlite")
    live.set_meta("settings", {})
    for number in range(ROWS):
        live.write(float(number), "look", {"n": number, "filler": "x" * 200}).result()
    for name in ("", "-wal", ".mark"):
        shutil.copyfile(folder / f"live.sqlite{name}", folder / f"j.sqlite{name}")
    live.close()
    return folder / "j.sqlite"


def numbers(path: Path) -> list[int]:
    return [row.body["n"] for row in read_rows(path)]


def test_the_mark_is_the_last_row_that_is_on_disk(tmp_path: Path) -> None:
    path = abandoned(tmp_path / "run")
    assert read_mark(path) == ROWS
    assert numbers(path) == list(range(ROWS))
    Journal(path).close()
    assert read_mark(path) == ROWS


@pytest.mark.parametrize("reading", ["open", "rows", "kinds", "meta"])
def test_a_copy_without_the_newest_rows_is_refused(reading: str, tmp_path: Path) -> None:
    path = abandoned(tmp_path / "run")
    with sqlite3.connect(path) as database:  # tidied up, so that the file is a journal, but a shorter one
        database.execute("DELETE FROM events WHERE seq > 40")
    database.close()
    read = {
        "open": lambda: Journal(path),
        "rows": lambda: list(read_rows(path)),
        "kinds": lambda: list(read_rows(path, "tea")),
        "meta": lambda: read_meta(path, "settings"),
    }[reading]
    with pytest.raises(
        BadInput, match=r"has lost its end \(row 60 was written, row 40 is the last here\); copy it"
    ):
        read()
    mark_path(path).unlink()  # somebody has decided to do without them
    assert len(numbers(path)) == 40


def test_a_copy_without_its_wal_file_is_refused(tmp_path: Path) -> None:
    path = abandoned(tmp_path / "run")
    path.with_name("j.sqlite-wal").unlink()
    with pytest.raises(BadInput, match="journal"):
        list(read_rows(path))
    with pytest.raises(BadInput, match="lost its end"):
        Journal(path)


def test_a_wal_file_that_was_cut_anywhere_never_gives_a_shorter_journal(tmp_path: Path) -> None:
    path = abandoned(tmp_path / "run")
    wal, rng, refused = path.with_name("j.sqlite-wal").read_bytes(), np.random.default_rng(3), 0
    for number in range(40):
        folder = tmp_path / str(number)
        folder.mkdir()
        shutil.copyfile(path, folder / "j.sqlite")
        shutil.copyfile(mark_path(path), mark_path(folder / "j.sqlite"))
        (folder / "j.sqlite-wal").write_bytes(wal[: int(rng.integers(0, len(wal)))])
        try:
            kept = numbers(folder / "j.sqlite")
        except BadInput:
            refused += 1
        else:
            assert kept == list(range(ROWS))
    assert refused > 30


@pytest.mark.parametrize(
    "mark", [b"", b"row 99 che", b"row 99 check 1\n", b"\0" * 40, b"row 61 check 12345\n"]
)
def test_a_mark_that_is_torn_says_nothing(mark: bytes, tmp_path: Path) -> None:
    path = abandoned(tmp_path / "run")
    mark_path(path).write_bytes(mark)
    assert read_mark(path) == 0
    assert numbers(path) == list(range(ROWS))


def test_a_journal_that_another_program_locks_for_a_while_is_slow_and_not_lost(tmp_path: Path) -> None:
    journal = Journal(tmp_path / "j.sqlite")
    assert journal.behind_s() == 0.0
    other = sqlite3.connect(tmp_path / "j.sqlite", isolation_level=None)
    other.execute("BEGIN IMMEDIATE")
    waiting = [journal.write(float(number), "look", {"n": number}) for number in range(5)]
    time.sleep(journal_module.BUSY_S + 0.6)  # longer than SQLite itself waits
    assert journal.behind_s() > journal_module.BUSY_S
    assert not any(row.done() for row in waiting)
    other.execute("COMMIT")
    other.close()
    assert [row.result(10.0) for row in waiting] == [1, 2, 3, 4, 5]
    journal.close()
    assert (journal.failed, journal.behind_s()) == (None, 0.0)


def test_only_a_lock_that_lasts_loses_the_journal(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(journal_module, "LOCKED_S", 0.2)
    journal = Journal(tmp_path / "j.sqlite")
    other = sqlite3.connect(tmp_path / "j.sqlite", isolation_level=None)
    other.execute("BEGIN IMMEDIATE")
    with pytest.raises(sqlite3.OperationalError, match="locked"):
        journal.write(0.0, "look", {}).result(30.0)
    assert isinstance(journal.failed, sqlite3.OperationalError)
    other.execute("ROLLBACK")
    other.close()
    journal.close()
