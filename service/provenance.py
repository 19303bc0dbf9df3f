"""What a run was begun with, by its fingerprints: a search that goes on over other ground is another search.

The settings themselves are in the journal. The files that they and the search are made of are told apart by their
SHA-256, so that one that was edited, swapped or not copied is noticed before the search goes on.
"""

from __future__ import annotations

import hashlib
import logging
from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any

from service.config import Settings, name_of
from service.errors import BadInput, shown
from service.journal import Journal
from service.resume import NUMBER, runs_in_order, stored_settings
from service.rows import ResumedRow
from service.survey import AREA, PRIOR
from service.timebase import clock_for

log = logging.getLogger("roisearch")
SECRET = (
    ("link", "signing_key_file"),
    ("http", "token_file"),
    ("http", "report_token_file"),
    ("http", "view_token_file"),
    ("doors", "mqtt_credentials_file"),
    ("telling", "webhook"),  # its path is often the secret
    ("telling", "webhook_token_file"),
    ("telling", "mqtt_credentials_file"),
    ("telling", "tak_certificate_file"),
    ("page", "tiles_url"),  # with the key of who pays for them
)
"""Settings, by section and key, that are secrets or say where one is: they are not written where others may read."""
_SECRETS = frozenset(f"{section}.{key}" for section, key in SECRET)
RASTERS = ("cover_file", "mobility_file")
"""Settings of the ground that may name a raster, or none."""
VERSION = "version"
"""The key of the version that a run was begun by, in its journal."""
FINGERPRINTS = "files"
"""The key of them in a journal; runs of earlier versions have none."""


def fingerprints(folder: Path, settings: Settings) -> dict[str, str]:
    """The SHA-256 of each file that decides what a run's search is, by what it is; "" for one that is not there."""
    files = {"area": folder / AREA, "prior": folder / PRIOR}
    named = {
        "sensor.calibration_file": settings.sensor.calibration_file,
        "sensor.terrain_file": settings.sensor.terrain_file,
    }
    named |= {
        f"aircraft.{name_of(each, i)}.sensor.calibration_file": each.sensor.given.get("calibration_file", "")
        for i, each in enumerate(settings.aircraft)
    }
    named |= {f"ground.file[{i}]": name for i, name in enumerate(settings.ground.file)}
    files |= {key: Path(name) for key, name in named.items() if name}
    rasters = {f"ground.{key}": getattr(settings.ground, key) for key in RASTERS}
    return {key: _fingerprint(path) for key, path in files.items()} | {
        key: _fingerprint(Path(name)) if name else "" for key, name in rasters.items()
    }


def refuse_changed(folder: Path, settings: Settings, begun_with: Mapping[str, str] | None) -> None:
    """Raises BadInput when a file is not what the run of this folder was begun with, or has been added since."""
    if begun_with is None:
        return
    now = fingerprints(folder, settings)
    for key in {f"ground.{each}" for each in RASTERS} - begun_with.keys():  # as early runs
        del now[key]
    for key in sorted({*now, *begun_with}):
        if now.get(key, "") != begun_with.get(key, ""):
            what = {"area": str(folder / AREA), "prior": str(folder / PRIOR)}.get(key, key)
            raise BadInput(
                f"{folder}: {what} is not what this run was begun with; put that back, or begin a new run"
            )


def changes(before: Settings, after: Settings) -> dict[str, Any]:
    """The settings in which two differ, as 'section.key' with the value after."""
    old, new = before.model_dump(mode="json"), after.model_dump(mode="json")
    old_aircraft, aircraft = old.pop("aircraft"), new.pop("aircraft")
    several = {} if aircraft == old_aircraft else {"aircraft": aircraft}
    return several | {
        f"{section}.{key}": value
        for section, table in new.items()
        for key, value in table.items()
        if old[section][key] != value
    }


def note_beginning(journal: Journal, folder: Path, settings: Settings) -> None:
    """Keep in a new journal what its run is begun with."""
    journal.set_meta(FINGERPRINTS, fingerprints(folder, settings))
    journal.set_meta(VERSION, version("roisearch"))
    _number(journal, folder)


def note_resumption(journal: Journal, folder: Path, settings: Settings) -> None:
    """Keep in a journal that another process goes on with it, and by which aircraft, and say what it flies otherwise.

    Raises BadInput when it cannot go on with what is here.
    """
    refuse_changed(folder, settings, journal.meta(FINGERPRINTS))
    _number(journal, folder)
    begun_by, ours = journal.meta(VERSION) or "of an early version", version("roisearch")
    if begun_by != ours:
        log.info("this run was begun by roisearch %s and goes on with %s", begun_by, ours)
    changed = changes(stored_settings(journal.path, {}), settings)
    if "aircraft" in changed:  # or the next one to go on with it forgets who may be in the air
        stored = journal.meta("settings")
        link = {**stored.get("link", {}), "connect": settings.link.connect}
        journal.set_meta("settings", {**stored, "link": link, "aircraft": settings.model_dump()["aircraft"]})
    told = {key: "(not told)" if value and key in _SECRETS else value for key, value in changed.items()}
    tell_changes(told)
    now = clock_for(
        journal.path, settings.speedup
    ).now()  # the run's own time, whatever the computer's date is
    journal.write(now, ResumedRow(version("roisearch"), told)).result()


def _number(journal: Journal, folder: Path) -> None:
    """This run is the last that was begun or gone on with where it lies."""
    others = [number for each, number in runs_in_order(folder.resolve().parent) if each != folder.resolve()]
    journal.set_meta(NUMBER, 1 + max(others, default=0))


def tell_changes(changed: Mapping[str, Any]) -> None:
    """Say what is flown otherwise from here on."""
    for key, value in changed.items():
        log.info("from here on, %s = %s", key, shown(value))


def _fingerprint(path: Path) -> str:
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except FileNotFoundError:
        return ""
    except OSError as error:
        raise BadInput(f"{path}: cannot be read ({error.strerror}); see who may read it") from error
