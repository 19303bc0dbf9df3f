"""A run as one file, to be gone on with on another computer: its journal, its ground, and its settings without secrets.

The journal is copied as SQLite copies a database that may be in use, so that no row is left in a `-wal` file. Files
that the settings name (a detector's calibration, a terrain) come along and are named anew where they are unpacked; so
do the pictures that came with reports, and the area file as it was given.
Files with keys and tokens stay where they are, and so must be given again; `service.unpacking` says what else.
"""

from __future__ import annotations

import contextlib
import json
import sqlite3
import tempfile
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from service.errors import BadInput
from service.evidence.images import FOLDER as PICTURES
from service.journal import read_meta, read_rows
from service.provenance import SECRET
from service.survey import AREA, GIVEN, JOURNAL, PRIOR

CARRIED = (
    ("sensor", "calibration_file"),
    ("sensor", "terrain_file"),
    ("ground", "cover_file"),
    ("ground", "mobility_file"),
)
"""Settings that name a file which travels, by section and key; each aircraft's calibration does, too."""
LEFT_OUT = (*SECRET, ("telling", "tak_ca_file"), ("page", "mbtiles_file"))
"""Settings that do not travel: secrets, and what names a file that does not."""


def pack(folder: Path, out: Path) -> int:
    """Write the run of a folder, under way or over, to one file; returns how many rows its journal has.

    Raises BadInput: there is no run, a file that it needs cannot be read, or `out` exists or cannot be written.
    """
    journal = folder / JOURNAL
    settings: dict[str, Any] = read_meta(journal, "settings")
    rows = sum(1 for _ in read_rows(journal))  # whole, and not shorter than its mark says
    files = {AREA: folder / AREA}
    if (folder / PRIOR).exists():
        files[PRIOR] = folder / PRIOR
    files |= {given.name: given for given in folder.glob(f"{GIVEN}.*")}
    files |= {f"{PICTURES}/{file.name}": file for file in (folder / PICTURES).glob("*.jpg")}
    for table, key in carried(settings):
        given = Path(table[key])
        name = given.name  # some formats are told by their name
        if name in files or name == JOURNAL:
            name = f"{len(files)}-{name}"
        table[key], files[name] = name, given
    for section, key in left_out(settings):
        settings[section][key] = ""
    try:
        with (
            tempfile.TemporaryDirectory() as aside,
            zipfile.ZipFile(out, "x", zipfile.ZIP_DEFLATED) as packed,
        ):
            _copy(journal, Path(aside) / JOURNAL, settings)
            packed.write(Path(aside) / JOURNAL, JOURNAL)
            for name, file in files.items():
                packed.write(file, name)
    except FileExistsError:
        raise BadInput(f"{out}: is there already; give another --out") from None
    except BaseException as error:  # half a run is none
        out.unlink(missing_ok=True)
        if isinstance(error, OSError):
            why = f"{error.filename or out}: {error.strerror}"
        elif isinstance(error, sqlite3.Error):
            why = f"{journal}: cannot be copied ({error}); is there room in {tempfile.gettempdir()}?"
        else:
            raise
        raise BadInput(f"{why}; {out} was not written") from error
    return rows


def left_out(settings: dict[str, Any]) -> list[tuple[str, str]]:
    """Which of the settings that are there do not travel, by section and key."""
    return [(section, key) for section, key in LEFT_OUT if settings.get(section, {}).get(key)]


def carried(settings: dict[str, Any]) -> Iterator[tuple[Any, Any]]:
    """Where the settings name a file that travels: the table or list, and the key or index in it."""
    for section, key in CARRIED:
        if settings.get(section, {}).get(key):
            yield settings[section], key
    for aircraft in settings.get("aircraft", []):
        if aircraft.get("sensor", {}).get("calibration_file"):
            yield aircraft["sensor"], "calibration_file"
    files = settings.get("ground", {}).get("file", [])
    yield from ((files, i) for i in range(len(files)))


def _copy(journal: Path, copy: Path, settings: dict[str, Any]) -> None:
    with (
        contextlib.closing(sqlite3.connect(f"{journal.resolve().as_uri()}?mode=ro", uri=True)) as source,
        contextlib.closing(sqlite3.connect(copy)) as target,
    ):
        source.backup(target)
        target.execute("PRAGMA journal_mode=DELETE")  # one file
        target.execute("UPDATE meta SET value = ? WHERE key = 'settings'", (json.dumps(settings),))
        target.commit()
