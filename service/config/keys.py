"""What the settings' keys are, and what is wrong with values that are given for them."""

from __future__ import annotations

import copy
import difflib
from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel, ValidationError

from service.complaint import complaint
from service.config.tables import AircraftSettings, SensorSettings, Settings
from service.errors import BadInput, shown


def _flatten(model: type[BaseModel]) -> dict[str, Any]:
    """Every known key as 'section.key' with its annotation."""
    return {
        f"{section}.{key}": field.annotation
        for section, table in model.model_fields.items()
        if section != "aircraft"  # which is a list of tables
        for key, field in table.annotation.model_fields.items()  # type: ignore[union-attr]
    }


KNOWN_KEYS: tuple[str, ...] = tuple(_flatten(Settings))


def nearest_key(key: str) -> str | None:
    """The setting that a key which is none most likely means: of the same name elsewhere, or of a similar one."""
    namesakes = [known for known in KNOWN_KEYS if known.rpartition(".")[2] == key.rpartition(".")[2]]
    if namesakes:
        return namesakes[0]
    known = KNOWN_KEYS if "." in key else (*Settings.model_fields, *KNOWN_KEYS)
    near = difflib.get_close_matches(key, known, n=1, cutoff=0.4)
    return near[0] if near else None


def problems(values: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Everything that is wrong with settings: pairs of a dotted key and a sentence; empty when nothing is."""
    try:
        Settings.model_validate(values)
    except ValidationError as error:
        return [_problem(details) for details in error.errors()]
    return []


def without_unknown(values: Mapping[str, Any]) -> tuple[dict[str, Any], tuple[str, ...]]:
    """Settings of another version without those that there are none of now, and these, as dotted keys."""
    known, gone = copy.deepcopy(dict(values)), []
    try:
        Settings.model_validate(values)
    except ValidationError as error:
        for details in error.errors():
            if details["type"] == "extra_forbidden":
                table: Any = known
                for part in details["loc"][:-1]:
                    table = table[part]
                del table[details["loc"][-1]]
                gone.append(".".join(str(part) for part in details["loc"]))
    return known, tuple(gone)


def _problem(details: Any) -> tuple[str, str]:
    key = ".".join(str(part) for part in details["loc"])
    if details["type"] == "extra_forbidden":
        table, _, name = key.rpartition(".")
        if table.startswith("aircraft."):
            of_sensor = table.endswith(".sensor")
            own = tuple((SensorSettings if of_sensor else AircraftSettings).model_fields)
            whose = "an aircraft's sensor" if of_sensor else "an aircraft"
            return key, f"there is no setting '{name}' of {whose}; there is {', '.join(own)}"
        near = nearest_key(key)
        known = KNOWN_KEYS if "." in key else tuple(Settings.model_fields)
        hint = f"did you mean '{near}'?" if near else f"known are {', '.join(known)}"
        return key, f"there is no setting '{key}'; {hint}"
    return key, f"'{key}' = {shown(details['input'])} is not possible: {complaint(details)}"


def checked(values: dict[str, Any], where: str) -> Settings:
    """The settings of these values, named `where`; raises BadInput with the first thing that is wrong."""
    if wrong := problems(values):
        raise BadInput(f"{where}: {wrong[0][1]}")
    return Settings.model_validate(values)
