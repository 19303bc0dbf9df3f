"""Settings read from where they come from: defaults, a file, the environment, flags."""

from __future__ import annotations

import os
import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from service.config.aircraft import check_apart, each_aircraft, lay_over
from service.config.keys import KNOWN_KEYS, checked, problems
from service.config.tables import SPARE_M, Settings
from service.errors import BadInput
from service.toml_lines import key_lines


def read_toml(file: Path) -> tuple[dict[str, Any], str]:
    """The values of a TOML file, and its text; raises BadInput with the line that is wrong."""
    try:
        text = file.read_text(encoding="utf-8")
        return tomllib.loads(text), text
    except OSError as error:
        raise BadInput(f"{file}: cannot be read ({error.strerror}); give an existing TOML file") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        line = re.search(r"at line (\d+)", str(error))
        raise BadInput(f"{file}{f':{line[1]}' if line else ''}: is not TOML: {error}") from error


def file_problems(file: Path) -> list[str]:
    """Everything that is wrong with a settings file, as sentences with file and line; raises BadInput if no TOML."""
    values, text = read_toml(file)
    wrong = problems(values)
    lines = key_lines(text) if wrong else {}

    def line(key: str) -> int:
        while key and key not in lines:  # a wrong item of a list stands where the list does
            key = key.rpartition(".")[0]
        return lines.get(key, 0)

    found = sorted((line(key), sentence) for key, sentence in wrong)
    return [f"{file}:{number}: {sentence}" if number else f"{file}: {sentence}" for number, sentence in found]


def variable_name(key: str) -> str:
    """The environment variable that overrides 'section.key'."""
    return f"ROISEARCH_{key.replace('.', '_')}".upper()


def read_settings(
    file: Path | None = None,
    *,
    environment: Mapping[str, str] | None = None,
    flags: Mapping[str, Any] | None = None,
) -> Settings:
    """Settings from defaults, then `file`, then ROISEARCH_SECTION_KEY variables, then `flags`.

    `flags` maps 'section.key' to a value; None means 'not given'. Raises BadInput in one sentence.
    """
    values: dict[str, dict[str, Any]] = {}
    where = "settings"
    if file is not None:
        where = str(file)
        values, _ = read_toml(file)
        if wrong := file_problems(file):
            raise BadInput(wrong[0])
    variables = os.environ if environment is None else environment
    for dotted in KNOWN_KEYS:
        section, key = dotted.split(".")
        name = variable_name(dotted)
        if name in variables:
            values.setdefault(section, {})[key] = variables[name]
            where = f"environment variable {name}"
            checked(values, where)
    return changed_settings(values, flags or {}, where)


FLAGS = {
    "sensor.cell_m": "--cell",
    "http.listen": "--http",
    "run.folder": "--runs",
    "ground.file": "--ground",
}
"""The flags that are not called as the key of the setting that they change."""


def changed_settings(values: dict[str, Any], changed: Mapping[str, Any], where: str) -> Settings:
    """Settings from `values` (tables by section, named `where`) with some 'section.key' changed; None: not.

    "aircraft" in `changed` is a list of tables, which are laid over those that there are. Raises BadInput in one
    sentence.
    """
    for dotted, value in changed.items():
        if dotted == "aircraft" and value is not None:
            lay_over(values, value)
            checked(values, "--aircraft")
        elif value is not None:
            section, key = dotted.split(".")
            values.setdefault(section, {})[key] = value
            checked(values, FLAGS.get(dotted, f"--{key}"))
    settings = checked(values, where)
    for name, alone in each_aircraft(settings).items():
        _check_flight(alone, f"{where}: aircraft '{name}'" if name else where)
    check_apart(settings, where)
    return settings


def _check_flight(settings: Settings, where: str) -> None:
    """Raises BadInput when the heights or the link of one aircraft cannot be."""
    flight = settings.flight
    if not flight.min_height_m <= flight.altitude_m <= flight.max_height_m:
        raise BadInput(
            f"{where}: 'flight.altitude_m' = {flight.altitude_m:g} is not between min_height_m = "
            f"{flight.min_height_m:g} and max_height_m = {flight.max_height_m:g}; change one of them"
        )
    if settings.ground_files and flight.altitude_m < flight.clearance_m + SPARE_M:
        raise BadInput(
            f"{where}: 'flight.altitude_m' = {flight.altitude_m:g} above the ground is not {SPARE_M:g} m more than "
            f"clearance_m = {flight.clearance_m:g}; change one of them"
        )
    if settings.link.speedup not in (None, 1.0) and settings.link.connect.startswith("serial"):
        raise BadInput(f"{settings.link.connect} is a real aircraft: it flies at a speedup of 1")
