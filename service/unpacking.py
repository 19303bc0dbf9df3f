"""A packed run, taken out of its file: what a search is made of, and nothing that its file says beyond that.

The file may come from anywhere. So only the files of a run are taken out, a journal that does things by itself is
refused, and what would reach out of the search (who may call, who is told, over which link, whether it takes off, whose
code plans) is not taken over: whoever goes on with it says that again.
"""

from __future__ import annotations

import contextlib
import logging
import lzma
import re
import shutil
import sqlite3
import struct
import zipfile
import zlib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from service.config import KNOWN_KEYS, Settings, checked, variable_name, without_unknown
from service.errors import BadInput
from service.evidence.images import FOLDER as PICTURES
from service.journal import Journal
from service.packing import LEFT_OUT, carried
from service.survey import AREA, GIVEN, JOURNAL, PRIOR

log = logging.getLogger("roisearch")
SECTIONS = ("http", "doors", "telling", "page")
"""Sections that are of the computer on which a run is flown: they are not taken over."""
LINK = "to be given again with --connect"
"""Stands for a link that is not taken over: no URL, and so refused until another one is given."""
MOST_BYTES = 20_000_000_000
_RUN = re.compile(
    rf"{re.escape(AREA)}|{re.escape(JOURNAL)}|{re.escape(PRIOR)}|{GIVEN}\.\w+|{PICTURES}/\w+\.jpg"
)
_DAMAGED = (
    zipfile.BadZipFile,
    zipfile.LargeZipFile,
    zlib.error,
    lzma.LZMAError,
    struct.error,
    sqlite3.Error,
    EOFError,
    RuntimeError,  # an entry with a password, or compressed by what is not known
    ValueError,
)
"""What is raised by files that are no packed runs."""


def again_by_variable() -> list[str]:
    """The settings that are not taken over and may be given again by a variable, as 'section.key'."""
    secrets = [f"{section}.{key}" for section, key in LEFT_OUT]
    others = [key for key in KNOWN_KEYS if key.partition(".")[0] in SECTIONS and key not in secrets]
    return [*secrets, *others, "link.connect"]


def given_again(environment: Mapping[str, str]) -> dict[str, str]:
    """What does not travel and is told anew, by ROISEARCH_SECTION_KEY variables: 'section.key' to its value."""
    names = {key: variable_name(key) for key in again_by_variable()}
    return {key: environment[name] for key, name in names.items() if name in environment}


def not_taken_over(settings: Settings) -> list[str]:
    """Which settings of a run are to be given again where it goes on, as 'section.key'."""
    given, unset = settings.model_dump(), Settings().model_dump()

    def is_set(dotted: str) -> bool:
        section, key = dotted.split(".")
        return bool(given[section][key] != unset[section][key])

    return [key for key in again_by_variable() if is_set(key)]


def unpack(file: Path, parent: Path, again: Mapping[str, Any]) -> Path:
    """The folder under `parent` that a packed run now lies in, ready to be gone on with.

    `again` has what is given for this run here, by 'section.key'.

    Raises BadInput: the file is no packed run, or is damaged, or says what it may not, or its folder is there already.
    """
    folder = parent / file.stem
    try:
        with zipfile.ZipFile(file) as packed:
            sizes = {item.filename: item.file_size for item in packed.infolist()}
            if not {AREA, JOURNAL} <= set(sizes) or sum(sizes.values()) > MOST_BYTES:
                raise BadInput(f"{file}: is no packed run; make one with roisearch-service pack RUN")
            _make(folder)
            try:
                _take_out(packed, filter(_RUN.fullmatch, sizes), folder)
                _refuse_doing(folder / JOURNAL, file)
                with contextlib.closing(Journal(folder / JOURNAL)) as journal:
                    settings = _taken_over(journal.meta("settings"), again, file)
                    settings["run"] = {**settings.get("run", {}), "folder": str(parent)}
                    _take_out(packed, _name_anew(settings, folder, file) & set(sizes), folder)
                    journal.set_meta("settings", settings)
            except BaseException:
                shutil.rmtree(folder, ignore_errors=True)
                raise
    except BadInput:
        raise
    except _DAMAGED as error:
        raise BadInput(f"{file}: is no packed run, or is damaged ({error}); copy it again") from error
    except OSError as error:
        raise BadInput(f"{error.filename or file}: {error.strerror}; give a writable --runs") from error
    return folder


def _make(folder: Path) -> None:
    try:
        folder.mkdir(parents=True)
    except FileExistsError:
        raise BadInput(f"{folder}: is there already; go on with it, or move it away") from None


def _take_out(packed: zipfile.ZipFile, names: Iterable[str], folder: Path) -> None:
    for name in names:
        packed.extract(name, folder)


def _refuse_doing(journal: Path, file: Path) -> None:
    """A journal has tables and indices; what acts when it is written to, or shows what is not there, it has not."""
    address = f"{journal.resolve().as_uri()}?mode=ro"
    with contextlib.closing(sqlite3.connect(address, uri=True)) as database:
        others = "type NOT IN ('table', 'index') OR sql LIKE 'CREATE VIRTUAL%'"
        for kind, name in database.execute(f"SELECT type, name FROM sqlite_master WHERE {others}"):
            raise BadInput(
                f"{file}: its journal has a {kind} '{name}', as no run's has; get it anew from whoever flew it"
            )


def _taken_over(stored: Any, again: Mapping[str, Any], file: Path) -> dict[str, Any]:
    """The settings of a run without what is to be given again here; says so."""
    if not isinstance(stored, dict):
        raise BadInput(f"{file}: is no packed run: its journal has no settings; copy it again")
    values, gone = without_unknown(stored)
    settings = checked(values, str(file))
    planner = settings.search.planner
    if ":" in planner and not again.get("search.planner"):
        raise BadInput(
            f"{file}: its planner '{planner}' is code that does not come along; give --planner {planner} if you "
            "know it, or the name of another"
        )
    for key in gone:
        log.warning("%s: its setting %s is none of this version, and left out", file, key)
    if left := not_taken_over(settings):
        name = variable_name(left[0])
        log.warning(
            "%s: not taken over: %s; give them again by variables such as %s", file, ", ".join(left), name
        )
    if settings.flight.takeoff:
        log.warning("%s: it took off by itself, and does not here; give --takeoff if it shall", file)
    _blank(values)
    return values


def _blank(values: dict[str, Any]) -> None:
    """Take out of settings what is not taken over."""
    for section in SECTIONS:
        values.pop(section, None)
    for section, key in (*LEFT_OUT, ("link", "lockstep")):
        if section in values:
            values[section][key] = ""
    values.setdefault("flight", {})["takeoff"] = False
    if ":" in values.setdefault("search", {}).get("planner", ""):
        del values["search"]["planner"]
    for number, table in enumerate([values.setdefault("link", {}), *values.get("aircraft", [])]):
        if table.get("connect"):
            table["connect"] = LINK + (f" ({number})" if number else "")


def _name_anew(settings: dict[str, Any], folder: Path, file: Path) -> set[str]:
    """Name the files that come along where they lie now; returns how they are called in the packed run."""
    names: set[str] = set()
    if "ground" in settings:  # a list, however it was written
        settings["ground"]["file"] = checked(settings, str(file)).ground.file
    for table, key in carried(settings):
        name = Path(table[key]).name
        if name.startswith(JOURNAL) or _RUN.fullmatch(name):
            raise BadInput(
                f"{file}: its settings name the run's own {name} as a file; get it anew from whoever flew it"
            )
        table[key] = str((folder / name).resolve())
        names.add(name)
    return names
