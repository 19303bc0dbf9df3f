"""Keeps the signing timestamp across restarts, on a computer whose clock may not be right.

The MAVLink guide wants it stored at least once a minute. Here a little time ahead is stored, and stored again
before it is used up, so a restart at any instant goes on after every timestamp that was ever used. It is less
than the minute by which a peer allows a stream it hears for the first time to differ.
"""

from __future__ import annotations

import asyncio
import logging
import os
import time
from pathlib import Path

from service.errors import BadInput
from service.mavlink.signing import PER_S, Signer, timestamp_at

log = logging.getLogger("roisearch")
_AHEAD = 20 * PER_S
_LEAST_AHEAD = 10 * PER_S
_LOOK_S = 1.0


class TimestampKeeper:
    """Moves a signer's timestamp along with the wall clock, and its stored copy ahead of it.

    Args:
        file: where to keep it; None trusts the clock alone.
    """

    def __init__(self, signer: Signer, file: Path | None) -> None:
        self._signer = signer
        self._file = file
        self._stored = 0
        self._failed = False

    def begin(self) -> None:
        """Go on where the last run has ended, or at the clock's time if that is later.

        Raises:
            BadInput: the file cannot be written.
        """
        self._signer.advance(timestamp_at(time.time()))
        if self._file is None:
            return
        self._signer.advance(self._load(self._file))
        try:
            self._store(self._file, self._signer.timestamp + _AHEAD)
        except OSError as error:
            raise BadInput(
                f"{self._file}: the signing timestamp cannot be kept here ({error.strerror})"
            ) from error

    async def run(self) -> None:
        """Keep both going until cancelled."""
        while True:
            await asyncio.sleep(_LOOK_S)
            await self.keep()

    async def keep(self) -> None:
        """Take the clock's time, and store more if little is left."""
        self._signer.advance(timestamp_at(time.time()))
        wanted = self._signer.timestamp
        if self._file is None or self._stored >= wanted + _LEAST_AHEAD:
            return
        try:
            await asyncio.to_thread(self._store, self._file, wanted + _AHEAD)
            self._failed = False
        except OSError as error:
            if not self._failed:
                log.warning("%s: the signing timestamp is not kept (%s)", self._file, error.strerror)
            self._failed = True

    def _store(self, file: Path, timestamp: int) -> None:
        file.parent.mkdir(parents=True, exist_ok=True)
        new = file.with_name(file.name + ".new")
        with new.open("w", encoding="ascii") as stream:
            stream.write(f"{timestamp}\n")
            stream.flush()
            os.fsync(stream.fileno())
        new.replace(file)
        self._stored = timestamp

    @staticmethod
    def _load(file: Path) -> int:
        try:
            text = file.read_text(encoding="ascii").strip()
            if not text.isdigit() or len(text) > 15:
                raise ValueError("not a number")
            return int(text)
        except FileNotFoundError:
            return 0
        except (OSError, ValueError) as error:
            log.warning("%s: no signing timestamp (%s); going on with the clock's", file, error)
            return 0
