"""The journal of a run: every report, decision, command and state change, on disk before it acts.

One SQLite file in WAL mode, `synchronous=FULL`: a row that `append` has returned for survives a power cut. A
single writer thread commits what has gathered since its last commit in one transaction, so that many reports a
second cost few flushes. Bodies are JSON; floats are written with every bit. Every row has its number and a checksum,
so a journal that was damaged since is refused rather than believed. The first write that fails is remembered
(`failed`), for those who must not go on without a journal.
"""

from __future__ import annotations

import asyncio
import contextlib
import fcntl
import json
import os
import queue
import sqlite3
import threading
import time
import zlib
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from service.errors import BadInput
from service.mark import Mark, mark_path, read_mark

BUSY_S, AGAIN_S = 1.0, 0.05
LOCKED_S = 120.0  # of waiting for a program that has locked the file, before the journal counts as lost
SCHEMA_VERSION = 2  # 1 had no checksums
SCHEMA = """
CREATE TABLE IF NOT EXISTS meta (key TEXT PRIMARY KEY, value TEXT NOT NULL);
CREATE TABLE IF NOT EXISTS events (
    seq INTEGER PRIMARY KEY, time REAL NOT NULL, kind TEXT NOT NULL, key TEXT UNIQUE, body TEXT NOT NULL,
    crc INTEGER NOT NULL DEFAULT 0
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


class RowValue(Protocol):
    """What a row says, as the classes of `service.rows` do: what kind of row, and its body."""

    @property
    def kind(self) -> str:
        """Of the row."""

    def body(self) -> Mapping[str, Any]:
        """As JSON has it."""


class Duplicate(ValueError):
    """The key of this event is in the journal already."""


class JournalLost(RuntimeError):
    """The journal cannot be written: nothing may be believed or acknowledged any more."""


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
        """Open or create the file, brought up to this version's schema.

        Raises BadInput: it cannot be opened or written, is of a newer schema or damaged, or another service writes it.
        """
        self.path = path
        self.failed: Exception | None = None
        """The first write that did not succeed."""
        self._queue: queue.SimpleQueue[list[_Entry] | None] = queue.SimpleQueue()
        self._waiting: deque[float] = deque()
        self._closed = False
        self._last = 0
        with contextlib.ExitStack() as undo:
            self._lock = _lock(path)
            undo.callback(os.close, self._lock)
            try:
                self._database = sqlite3.connect(
                    path, check_same_thread=False, isolation_level=None, timeout=BUSY_S
                )
                undo.callback(self._database.close)
                self._database.execute("PRAGMA journal_mode=WAL")
                self._database.execute("PRAGMA synchronous=FULL")
                self._open()
                self._mark = Mark(path)
                self._files = [_descriptor(path), _descriptor(path.with_name(path.name + "-wal"))]
            except (sqlite3.Error, UnicodeDecodeError, OSError) as error:
                raise _cannot_open(path, error) from error
            self._mark.move(self._last)
            undo.pop_all()
        self._writer = threading.Thread(target=self._write, name="journal", daemon=True)
        self._writer.start()

    def _open(self) -> None:
        mark = read_mark(self.path)
        if not self._database.execute("SELECT 1 FROM sqlite_master WHERE name = 'meta'").fetchone():
            if mark:  # all there was is in the file that is missing
                raise _shorter(self.path, mark, 0)
            self._database.executescript(SCHEMA)
            self.set_meta("schema", SCHEMA_VERSION)
            return
        _refuse_newer(self.path, self.meta("schema"))
        if (damage := self._database.execute("PRAGMA quick_check(1)").fetchone()[0]) != "ok":
            raise _damaged(self.path, damage)
        if self.meta("schema") == 1:
            self._add_checksums()
        for row in self._database.execute(_ROWS + ", crc FROM events ORDER BY seq"):
            self._last += 1
            if row[0] != self._last:
                raise _damaged(self.path, f"row {self._last} is missing")
            if row[-1] != _crc(*row[:-1]):
                raise _damaged(self.path, f"row {row[0]} is not what was written")
        if mark > self._last:
            raise _shorter(self.path, mark, self._last)

    def _add_checksums(self) -> None:
        """From schema 1 to 2."""
        self._database.execute("BEGIN IMMEDIATE")
        self._database.execute("ALTER TABLE events ADD COLUMN crc INTEGER NOT NULL DEFAULT 0")
        rows = self._database.execute(_ROWS + " FROM events").fetchall()
        self._database.executemany(
            "UPDATE events SET crc = ? WHERE seq = ?", [(_crc(*row), row[0]) for row in rows]
        )
        self.set_meta("schema", 2)
        self._database.execute("COMMIT")

    def meta(self, key: str) -> Any:
        """A value stored with `set_meta`, or None."""
        return _meta(self._database, self.path, key)

    def set_meta(self, key: str, value: Any) -> None:
        """Store a JSON value under a key (used before the run starts)."""
        self._database.execute("INSERT OR REPLACE INTO meta VALUES (?, ?)", (key, json.dumps(value)))

    def write(
        self, time: float, said: RowValue | str, body: Mapping[str, Any] | None = None, key: str | None = None
    ) -> Future[int]:
        """Queue a row, by its value, or by its kind and its body.

        The future holds its number once it is on disk, or raises Duplicate.
        """
        kind, told = (said, body or {}) if isinstance(said, str) else (said.kind, said.body())
        entry = _Entry(time, kind, key, json.dumps(dict(told)), Future())
        self._enqueue([entry])
        return entry.done

    def _enqueue(self, entries: list[_Entry]) -> None:
        """Queue rows that are written in one transaction: all of them, or none."""
        if self._closed:
            raise RuntimeError("the journal is closed")
        for entry in entries:
            entry.done.set_running_or_notify_cancel()  # who stops waiting does not stop the row from being written
        self._waiting.append(time.monotonic())
        self._queue.put(entries)

    def behind_s(self) -> float:
        """How long the oldest row has waited to be on disk, in seconds of wall time: a slow or locked disk. Nobody
        waits for one that has failed."""
        if self.failed is not None:
            return 0.0
        try:
            return time.monotonic() - self._waiting[0]
        except IndexError:
            return 0.0

    async def append(
        self, time: float, said: RowValue | str, body: Mapping[str, Any] | None = None, key: str | None = None
    ) -> int:
        """Write a row as `write` does, and return its number once it is on disk; raises Duplicate when `key` is
        known."""
        return await asyncio.wrap_future(self.write(time, said, body, key))

    async def append_all(self, rows: Sequence[tuple[float, str, str, str]]) -> list[bool]:
        """Write rows of (time, kind, key, body as JSON) in one transaction; returns when they are on disk.

        Returns for each whether it is new; raises what kept them from being written, and then none is.
        """
        entries = [_Entry(time, kind, key, body, Future()) for time, kind, key, body in rows]
        if not entries:
            return []
        self._enqueue(entries)
        last = asyncio.wrap_future(entries[-1].done)  # the outcomes come in their order
        await asyncio.wait([last])  # which leaves it to the writer when we are cancelled
        last.exception()  # asked for, so that it is not logged as forgotten
        failures = [entry.done.exception() for entry in entries]
        for failure in failures:
            if failure is not None and not isinstance(failure, Duplicate):
                raise failure
        return [failure is None for failure in failures]

    def close(self) -> None:
        """Write what is queued, then close the file."""
        if not self._closed:
            self._closed = True
            self._queue.put(None)
            self._writer.join()
            self._database.close()
            self._mark.close()
            os.close(self._lock)

    def _write(self) -> None:
        """The writer thread: one transaction for all that has gathered."""
        open_ = True
        while open_:
            batch = [self._queue.get()]
            while not self._queue.empty():
                batch.append(self._queue.get())
            open_ = None not in batch
            rows = [entry for entries in batch if entries is not None for entry in entries]
            self._settle(self._commit(rows))
            for _ in range(len(batch) - (not open_)):
                self._waiting.popleft()

    def _commit(self, entries: list[_Entry]) -> list[tuple[_Entry, int | Exception]]:
        """Write them in one transaction; a database that another program has locked is waited for."""
        patience = time.monotonic() + LOCKED_S
        while True:
            try:
                return self._insert(entries)
            except sqlite3.Error as error:
                with contextlib.suppress(sqlite3.Error):
                    if self._database.in_transaction:
                        self._database.execute("ROLLBACK")
                if not _is_locked(error) or time.monotonic() > patience:
                    self.failed = self.failed or error
                    return [(entry, error) for entry in entries]
                time.sleep(AGAIN_S)

    def _insert(self, entries: list[_Entry]) -> list[tuple[_Entry, int | Exception]]:
        if any(
            os.fstat(file).st_nlink == 0 for file in self._files
        ):  # into what nobody can ever read SQLite writes on
            raise sqlite3.OperationalError("its file, or the -wal file beside it, has been deleted")
        outcomes: list[tuple[_Entry, int | Exception]] = []
        last = self._last
        self._database.execute("BEGIN IMMEDIATE")
        for entry in entries:
            row = (last + 1, entry.time, entry.kind, entry.key, entry.body)
            try:
                self._database.execute("INSERT INTO events VALUES (?, ?, ?, ?, ?, ?)", (*row, _crc(*row)))
                last += 1
                outcomes.append((entry, last))
            except sqlite3.IntegrityError:
                if not self._knows(entry.key):
                    raise
                outcomes.append((entry, Duplicate(f"'{entry.key}' is in the journal already")))
        self._database.execute("COMMIT")
        self._last = last
        self._mark.move(last)
        return outcomes

    @staticmethod
    def _settle(outcomes: list[tuple[_Entry, int | Exception]]) -> None:
        for entry, outcome in outcomes:
            if isinstance(outcome, Exception):
                entry.done.set_exception(outcome)
            else:
                entry.done.set_result(outcome)

    def _knows(self, key: str | None) -> bool:
        found = self._database.execute("SELECT 1 FROM events WHERE key = ?", (key,)).fetchone()
        return found is not None


def _lock(path: Path) -> int:
    """The open lock file beside a journal, held by this process alone until it is closed, or the process ends.

    The file stays: were it removed, two could hold locks on two files of that name.
    """
    try:
        lock = os.open(path.with_name(path.name + ".lock"), os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
    except OSError as error:
        raise _cannot_open(path, error) from error
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(lock)
        raise BadInput(
            f"{path}: this run is being flown by another service; end that one first, or begin a new run"
        ) from None
    except OSError as error:
        os.close(lock)
        raise _cannot_open(path, error) from error
    return lock


def _descriptor(path: Path) -> int:
    """By which number this process has the database open: a second one, once closed, would cost SQLite its locks."""
    sought = path.stat()
    for each in Path("/proc/self/fd").iterdir():
        with contextlib.suppress(OSError):
            if os.path.samestat(each.stat(), sought):
                return int(each.name)
    raise OSError(f"{path} is not the file that was opened")


def _cannot_open(path: Path, error: Exception) -> BadInput:
    return BadInput(f"{path}: the journal cannot be opened ({error}); give a writable folder")


_ROWS = "SELECT seq, time, kind, key, body"


def _crc(seq: int, time: float, kind: str, key: str | None, body: str) -> int:
    """The checksum of a row: a flipped bit anywhere in it changes this."""
    return zlib.crc32(json.dumps([seq, time, kind, key, body]).encode())


def _damaged(path: Path, how: str) -> BadInput:
    return BadInput(f"{path}: the journal is damaged ({how}); resume from a copy, or begin a new run")


def _is_locked(error: sqlite3.Error) -> bool:
    """Whether another program only has to let go of the file."""
    code = getattr(error, "sqlite_errorcode", 0) & 0xFF
    return code in (sqlite3.SQLITE_BUSY, sqlite3.SQLITE_LOCKED)


def _shorter(path: Path, mark: int, last: int) -> BadInput:
    return BadInput(
        f"{path}: the journal has lost its end (row {mark} was written, row {last} is the last here); copy it together "
        f"with its -wal file, or delete {mark_path(path).name} to do without those rows"
    )


def _refuse_newer(path: Path, schema: object) -> None:
    if schema not in (1, SCHEMA_VERSION):
        raise BadInput(
            f"{path}: journal of schema {schema}, this version reads 1 to {SCHEMA_VERSION}; "
            "resume it with the version that wrote it"
        )


def _meta(database: sqlite3.Connection, path: Path, key: str) -> Any:
    row = database.execute("SELECT value FROM meta WHERE key = ?", (key,)).fetchone()
    try:
        return None if row is None else json.loads(row[0])
    except (ValueError, TypeError):
        raise _damaged(path, f"its {key} cannot be read") from None


def read_meta(path: Path, key: str) -> Any:
    """A value that a journal was given with `set_meta`; raises BadInput when there is no such journal or value."""
    value = read_meta_if_any(path, key)
    if value is None:
        raise BadInput(f"{path}: the journal has no {key}; it is not one of a started run")
    return value


def read_meta_if_any(path: Path, key: str) -> Any:
    """The same, or None when it was not given that value; raises BadInput when there is no such journal."""
    database = _open_to_read(path)
    try:
        _refuse_newer(path, _meta(database, path, "schema"))
        value = _meta(database, path, key)
    except (sqlite3.Error, UnicodeDecodeError) as error:
        raise BadInput(f"{path}: the journal cannot be read ({error})") from error
    finally:
        database.close()
    return value


def _open_to_read(path: Path) -> sqlite3.Connection:
    """A reader beside the writer, if there is one: in WAL mode neither waits for the other."""
    if not path.is_file():
        raise BadInput(f"{path}: there is no journal here; give the folder of a run")
    address, mark = path.resolve().as_uri(), read_mark(path)
    try:
        database = sqlite3.connect(f"{address}?mode=ro", uri=True)
    except sqlite3.Error as error:
        raise BadInput(f"{path}: the journal cannot be read ({error}); see who may read it") from error
    try:
        database.execute("SELECT count(*) FROM sqlite_master").fetchone()
    except sqlite3.OperationalError:  # a finished run where not even SQLite's own files may be written
        if not path.with_name(path.name + "-wal").exists():
            database.close()
            database = sqlite3.connect(f"{address}?mode=ro&immutable=1", uri=True)
    except (sqlite3.Error, UnicodeDecodeError):  # the latter when the damage is in what SQLite wants to say
        pass  # whoever reads is told
    if mark:
        with contextlib.suppress(sqlite3.Error, UnicodeDecodeError):  # whoever reads is told
            last = database.execute("SELECT max(seq) FROM events").fetchone()[0] or 0
            if last < mark:
                database.close()
                raise _shorter(path, mark, last)
    return database


def read_rows(path: Path, *kinds: str) -> Iterator[Row]:
    """The rows of a journal in order, of the given kinds or all, as they were when the first was read.

    Raises BadInput when it cannot be read.
    """
    database = _open_to_read(path)
    try:
        where = f"WHERE kind IN ({', '.join('?' * len(kinds))})" if kinds else ""
        query = f"{_ROWS} FROM events {where} ORDER BY seq"
        for seq, time, kind, key, body in database.execute(query, kinds):
            yield Row(seq, time, kind, key, json.loads(body))
    except (sqlite3.Error, ValueError) as error:
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
    except (sqlite3.Error, ValueError) as error:
        raise BadInput(f"{path}: the journal cannot be read ({error})") from error
    finally:
        database.close()
