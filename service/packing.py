"""A run as one file, to be gone on with on another computer: its journal, its ground, and its settings without secrets.

The journal is copied as SQLite copies a database that may be in use, so that no row is left in a `-wal` file. Files
that the settings name (a detector's calibration, a terrain) come along and are named anew where they are unpacked; so
do the pictures that came with reports, and the area file as it was given.
Files with keys and tokens stay where they are, and so must be given again.
"""

from __future__ import annotations

import contextlib
import json
import shutil
import sqlite3
import tempfile
import zipfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from service.config import variable_name
from service.errors import BadInput
from service.evidence.images import FOLDER as PICTURES
from service.journal import Journal, read_meta, read_rows
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
MOST_BYTES = 20_000_000_000


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
    for table, key in _carried(settings):
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


def given_again(environment: Mapping[str, str]) -> dict[str, str]:
    """What does not travel and is told anew, by ROISEARCH_SECTION_KEY variables: 'section.key' to its value."""
    names = {f"{section}.{key}": variable_name(f"{section}.{key}") for section, key in LEFT_OUT}
    return {key: environment[name] for key, name in names.items() if name in environment}


def _carried(settings: dict[str, Any]) -> Iterator[tuple[Any, Any]]:
    """Where the settings name a file that travels: the table or list, and the key or index in it."""
    for section, key in CARRIED:
        if settings.get(section, {}).get(key):
            yield settings[section], key
    for aircraft in settings.get("aircraft", []):
        if aircraft.get("sensor", {}).get("calibration_file"):
            yield aircraft["sensor"], "calibration_file"
    files = settings.get("ground", {}).get("file", [])
    yield from ((files, i) for i in range(len(files)))


def unpack(file: Path, parent: Path) -> Path:
    """The folder under `parent` that a packed run now lies in, ready to be gone on with.

    Raises BadInput: the file is no packed run, or is damaged, or its folder is there already.
    """
    folder = parent / file.stem
    try:
        with zipfile.ZipFile(file) as packed:
            sizes = {item.filename: item.file_size for item in packed.infolist()}
            if not {AREA, JOURNAL} <= set(sizes) or sum(sizes.values()) > MOST_BYTES:
                raise BadInput(f"{file}: is no packed run; make one with roisearch-service pack RUN")
            folder.mkdir(parents=True)
            try:
                for name in sizes:
                    picture = name.startswith(f"{PICTURES}/") and name.count("/") == 1
                    if Path(name).name == name or picture:  # nothing is put elsewhere
                        packed.extract(name, folder)
                _settle(folder)
            except BaseException:
                shutil.rmtree(folder, ignore_errors=True)
                raise
    except FileExistsError:
        raise BadInput(f"{folder}: is there already; go on with it, or move it away") from None
    except (zipfile.BadZipFile, zipfile.LargeZipFile, EOFError, ValueError) as error:
        if isinstance(error, BadInput):
            raise
        raise BadInput(f"{file}: is no packed run, or is damaged ({error}); copy it again") from error
    except OSError as error:
        raise BadInput(f"{error.filename or file}: {error.strerror}; give a writable --runs") from error
    return folder


def _copy(journal: Path, copy: Path, settings: dict[str, Any]) -> None:
    with (
        contextlib.closing(sqlite3.connect(f"{journal.resolve().as_uri()}?mode=ro", uri=True)) as source,
        contextlib.closing(sqlite3.connect(copy)) as target,
    ):
        source.backup(target)
        target.execute("PRAGMA journal_mode=DELETE")  # one file
        target.execute("UPDATE meta SET value = ? WHERE key = 'settings'", (json.dumps(settings),))
        target.commit()


def _settle(folder: Path) -> None:
    """Name the files where they lie now, and see that the journal is whole; its mark begins here."""
    with contextlib.closing(Journal(folder / JOURNAL)) as journal:
        settings = journal.meta("settings")
        for table, key in _carried(settings):
            table[key] = str((folder / Path(table[key]).name).resolve())
        journal.set_meta("settings", settings)
