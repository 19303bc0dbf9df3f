"""A mission's rows on their way to disk: what must not happen before they are there waits for them here."""

from __future__ import annotations

import asyncio
import contextlib
import sqlite3

from service.clock import Clock
from service.entries import of_aircraft
from service.journal import Journal, JournalLost
from service.rows import KnownRow


class WrittenRows:
    """The rows of one aircraft, in their order; `name` is its own, empty for the only one."""

    def __init__(self, journal: Journal, clock: Clock, name: str) -> None:
        self._journal, self._clock, self._name = journal, clock, name
        self._last: asyncio.Future[int] | None = None
        self._lost: JournalLost | None = None

    @property
    def lost(self) -> JournalLost | None:
        """Why rows cannot be kept any more."""
        if self._lost is None and self._journal.failed is not None:
            return self._loss(self._journal.failed)
        return self._lost

    def write(self, said: KnownRow) -> asyncio.Future[int]:
        """Queue a row."""
        written = self._journal.write(self._clock.now(), of_aircraft(said, self._name))
        row = asyncio.wrap_future(written)
        row.add_done_callback(self._written)
        self._last = row
        return row

    async def on_disk(self, said: KnownRow) -> None:
        """Write a row; returns once it is on disk. Raises JournalLost."""
        try:
            await self.write(said)
        except (sqlite3.Error, OSError) as error:
            raise self._loss(error) from error

    async def all_on_disk(self) -> bool:
        """Wait for all rows that were written before; False when one of them never will be there."""
        if self._last is not None:
            with contextlib.suppress(sqlite3.Error, OSError):
                await asyncio.shield(self._last)
        return self._lost is None

    def _written(self, row: asyncio.Future[int]) -> None:
        if not row.cancelled() and isinstance(error := row.exception(), (sqlite3.Error, OSError)):
            self._lost = self._lost or self._loss(error)

    def _loss(self, error: Exception | None) -> JournalLost:
        return JournalLost(f"the journal {self._journal.path} cannot be written: {error}")
