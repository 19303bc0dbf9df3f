"""The journal of a run: every report, decision, command and state change, on disk before it acts.

One SQLite file in WAL mode, `synchronous=FULL`: a row that `append` has returned for survives a power cut. A
single writer thread commits what has gathered since its last commit in one transaction, so that many reports a
second cost few flushes. Bodies are JSON; floats are written with every bit.
"""

from __future__ import annotations

import asyncio
import json
import queue
import sqlite3
import threading
from collections.abc import Iterator, Mapping
from concurrent.futures import Future
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from service.errors import BadInput

SCHEMA_VERSION = 1
SCHEMA = """
CREATE TABLE IF NOT EXISTS meta (key TEXT PRIMARY KEY, value TEXT NOT NULL);
CREATE TABLE IF NOT EXISTS events (
    seq INTEGER PRIMARY KEY, time REAL NOT NULL, kind TEXT NOT NULL, key TEXT UNIQUE, body TEXT NOT NULL
);
CREATE INDEX IF NOT EXISTS events_by_kind ON events (kind, seq);
"""


@dataclass(frozen=True)
class Row:
    """One event: its number, time (seconds since the epoch), kind, idempotence key and body."""

    seq: int
    time: float
    kind: str
    key: str | None
    body: dict[str, Any]


class Duplicate(ValueError):
    """The key of this event is in the journal already."""


@dataclass(frozen=True)
class _Entry:
    time: float
    kind: str
    key: str | None
    body: str
    done: Future[int]


class Journal:
    """A journal open for writing. Use `append` from the event loop, `close` at the end."""

    def __init__(self, path: Path) -> None:
        """Open or create the file; raises BadInput when that is impossible or its schema is another one."""
        self.path = path
        self._queue: queue.SimpleQueue[_Entry | None] = queue.SimpleQueue()
        self._closed = False
        try:
            self._database = sqlite3.connect(path, check_same_thread=False, isolation_level=None)
            self._database.execute("PRAGMA journal_mode=WAL")
            self._database.execute("PRAGMA synchronous=FULL")
            self._database.executescript(SCHEMA)
            self._database.execute(
                "INSERT OR IGNORE INTO meta VALUES ('schema', ?)", (json.dumps(SCHEMA_VERSION),)
            )
        except sqlite3.Error as error:
            raise BadInput(
                f"{path}: the journal cannot be opened ({error}); give a writable folder"
            ) from error
        if (found := self.meta("schema")) != SCHEMA_VERSION:
            raise BadInput(f"{path}: journal of schema {found}, this version reads {SCHEMA_VERSION}")
        self._writer = threading.Thread(target=self._write, name="journal", daemon=True)
        self._writer.start()

    def meta(self, key: str) -> Any:
        """A value stored with `set_meta`, or None."""
        row = self._database.execute("SELECT value FROM meta WHERE key = ?", (key,)).fetchone()
        return None if row is None else json.loads(row[0])

    def set_meta(self, key: str, value: Any) -> None:
        """Store a JSON value under a key (used before the run starts)."""
        self._database.execute("INSERT OR REPLACE INTO meta VALUES (?, ?)", (key, json.dumps(value)))

    def write(self, time: float, kind: str, body: Mapping[str, Any], key: str | None = None) -> Future[int]:
        """Queue a row; the future holds its number once it is on disk, or raises Duplicate."""
        if self._closed:
            raise RuntimeError("the journal is closed")
        entry = _Entry(time, kind, key, json.dumps(dict(body)), Future())
        self._queue.put(entry)
        return entry.done

    async def append(self, time: float, kind: str, body: Mapping[str, Any], key: str | None = None) -> int:
        """Write a row and return its number once it is on disk; raises Duplicate when `key` is known."""
        return await asyncio.wrap_future(self.write(time, kind, body, key))

    def close(self) -> None:
        """Write what is queued, then close the file."""
        if not self._closed:
            self._closed = True
            self._queue.put(None)
            self._writer.join()
            self._database.close()

    def _write(self) -> None:
        """The writer thread: one transaction for all that has gathered."""
        open_ = True
        while open_:
            batch = [self._queue.get()]
            while not self._queue.empty():
                batch.append(self._queue.get())
            open_ = None not in batch
            self._commit([entry for entry in batch if entry is not None])

    def _commit(self, entries: list[_Entry]) -> None:
        outcomes: list[tuple[_Entry, int | Exception]] = []
        try:
            self._database.execute("BEGIN IMMEDIATE")
            for entry in entries:
                try:
                    cursor = self._database.execute(
                        "INSERT INTO events (time, kind, key, body) VALUES (?, ?, ?, ?)",
                        (entry.time, entry.kind, entry.key, entry.body),
                    )
                    outcomes.append((entry, int(cursor.lastrowid or 0)))
                except sqlite3.IntegrityError:
                    outcomes.append((entry, Duplicate(f"'{entry.key}' is in the journal already")))
            self._database.execute("COMMIT")
        except sqlite3.Error as error:
            if self._database.in_transaction:
                self._database.execute("ROLLBACK")
            outcomes = [(entry, error) for entry in entries]
        for entry, outcome in outcomes:
            if isinstance(outcome, Exception):
                entry.done.set_exception(outcome)
            else:
                entry.done.set_result(outcome)


def read_meta(path: Path, key: str) -> Any:
    """A value that a journal was given with `set_meta`; raises BadInput when there is no such journal or value."""
    database = _open_to_read(path)
    try:
        row = database.execute("SELECT value FROM meta WHERE key = ?", (key,)).fetchone()
    except sqlite3.Error as error:
        raise BadInput(f"{path}: the journal cannot be read ({error})") from error
    finally:
        database.close()
    if row is None:
        raise BadInput(f"{path}: the journal has no {key}; it is not one of a started run")
    return json.loads(row[0])


def _open_to_read(path: Path) -> sqlite3.Connection:
    if not path.is_file():
        raise BadInput(f"{path}: there is no journal here; give the folder of a run")
    return sqlite3.connect(f"file:{path}?mode=ro", uri=True)


def read_rows(path: Path, *kinds: str) -> Iterator[Row]:
    """The rows of a journal in order, of the given kinds or all; raises BadInput when it cannot be read."""
    database = _open_to_read(path)
    try:
        where = f"WHERE kind IN ({', '.join('?' * len(kinds))})" if kinds else ""
        query = f"SELECT seq, time, kind, key, body FROM events {where} ORDER BY seq"
        for seq, time, kind, key, body in database.execute(query, kinds):
            yield Row(seq, time, kind, key, json.loads(body))
    except sqlite3.Error as error:
        raise BadInput(f"{path}: the journal cannot be read ({error})") from error
    finally:
        database.close()


def read_last(path: Path, kind: str, count: int, before: float | None = None) -> list[Row]:
    """The last rows of a kind, the newest first, or the last until a time; raises BadInput like `read_rows`."""
    database = _open_to_read(path)
    try:
        query = "SELECT seq, time, kind, key, body FROM events WHERE kind = ? AND time <= ? ORDER BY seq DESC LIMIT ?"
        until = 1e300 if before is None else before
        found = database.execute(query, (kind, until, count)).fetchall()
        return [Row(seq, time, kind, key, json.loads(body)) for seq, time, kind, key, body in found]
    except sqlite3.Error as error:
        raise BadInput(f"{path}: the journal cannot be read ({error})") from error
    finally:
        database.close()
