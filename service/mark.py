"""The high-water mark beside a journal: which row was its last, so that a journal that has lost its end is noticed.

SQLite keeps the newest rows in a file of its own (`-wal`) until it is tidied up. A copy without that file, or with a
part of it, opens without complaint and tells less. The mark is written after a row is on disk, so it is never ahead
of the truth; a mark that is torn or gone says nothing.
"""

from __future__ import annotations

import contextlib
import os
import re
import zlib
from pathlib import Path

_MARK = re.compile(rb"row (\d{1,15}) check (\d{1,10})\n")
_LENGTH = 40


def mark_path(journal: Path) -> Path:
    """The file that the mark of a journal is in."""
    return journal.with_name(journal.name + ".mark")


def read_mark(journal: Path) -> int:
    """The number of the last row that a journal is known to have had; 0 when nothing is known."""
    try:
        found = _MARK.match(mark_path(journal).read_bytes())
    except OSError:
        return 0
    if found is None or int(found[2]) != zlib.crc32(found[1]):
        return 0
    return int(found[1])


class Mark:
    """The mark, open for writing by the one who writes the journal."""

    def __init__(self, journal: Path) -> None:
        """Raises OSError when the file cannot be written."""
        self._file = os.open(mark_path(journal), os.O_WRONLY | os.O_CREAT | os.O_CLOEXEC, 0o644)

    def move(self, row: int) -> None:
        """This row is on disk. A mark that cannot be written stays behind, which is no harm."""
        number = str(row).encode()
        text = b"row %s check %d\n" % (number, zlib.crc32(number))
        with contextlib.suppress(OSError):
            os.pwrite(self._file, text.ljust(_LENGTH), 0)

    def close(self) -> None:
        """No more is written."""
        os.close(self._file)
