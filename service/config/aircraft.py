"""The settings of several aircraft: what each has of its own, and what must not be the same of two."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise
from typing import Any

from service.config.tables import AircraftSettings, FlightSettings, Settings
from service.errors import BadInput

_KEPT = 0.7  # the part of a layer that is left when both aircraft waver about their height
ONLY = "1"
"""What the only aircraft of a run is called where names are told."""


def each_aircraft(settings: Settings) -> dict[str, Settings]:
    """The settings of each aircraft by its name, as if it flew alone; without tables of aircraft, of the only one, "".

    An aircraft without an offset of its own flies `flight.layer_m` above the one before. The least clearance grows with
    the height, so that the layers stay apart over a hilltop too, where that decides.
    """
    if not settings.aircraft:
        return {"": settings}
    return {
        name_of(table, number): _alone(settings, table, offset_m)
        for number, (table, offset_m) in enumerate(zip(settings.aircraft, _offsets_m(settings), strict=True))
    }


@contextmanager
def about(name: str) -> Iterator[None]:
    """What is said of bad input in here is about the aircraft of this name; empty: of the only one."""
    try:
        yield
    except BadInput as error:
        raise BadInput(f"aircraft '{name}': {error}" if name else str(error)) from None


def name_of(table: AircraftSettings, number: int) -> str:
    """What an aircraft is called: as its table says, else by its number from 1. `number` counts from 0."""
    return table.name or str(number + 1)


def gap_m(flight: FlightSettings) -> float:
    """How far apart in height two layers have to be, so that who is in one need not look at who is in the other."""
    return _KEPT * flight.layer_m


def _offsets_m(settings: Settings) -> list[float]:
    """How much higher than `flight.altitude_m` each flies."""
    offsets_m: list[float] = []
    for table in settings.aircraft:
        above_m = offsets_m[-1] + settings.flight.layer_m if offsets_m else 0.0
        offsets_m.append(above_m if table.altitude_offset_m is None else table.altitude_offset_m)
    return offsets_m


def _alone(settings: Settings, table: AircraftSettings, offset_m: float) -> Settings:
    """The settings of one of several, as if it flew alone."""
    link, flight, demo = settings.link, settings.flight, settings.demo
    height = {"altitude_m": flight.altitude_m + offset_m, "clearance_m": flight.clearance_m + offset_m}
    height |= {"speed_mps": table.speed_mps or flight.speed_mps}
    own = {"connect": table.connect, "system_id": table.system_id or link.system_id}
    return settings.model_copy(
        update={
            "link": link.model_copy(update=own),
            "flight": flight.model_copy(update=height),
            "sensor": settings.sensor.model_copy(update=table.sensor.given),
            "demo": demo.model_copy(update={"flavor": table.flavor or demo.flavor}),
            "aircraft": [],
        }
    )


def lay_over(values: dict[str, Any], tables: list[dict[str, Any]]) -> None:
    """Lay what flags say of each aircraft over its table. Raises BadInput when that is another number of aircraft."""
    known: list[dict[str, Any]] = values.get("aircraft") or [{} for _ in tables]
    if len(known) != len(tables):
        raise BadInput(
            f"the flags are for {len(tables)} aircraft and the settings have {len(known)}: give --connect once for each"
        )
    values["aircraft"] = [{**table, **more} for table, more in zip(known, tables, strict=True)]
    if any("connect" in more for more in tables):
        link = values.setdefault("link", {})
        link["connect"] = ""
        if alone := link.pop("system_id", None):  # it was the first one's, when that flew alone
            values["aircraft"][0].setdefault("system_id", alone)


def check_apart(settings: Settings, where: str) -> None:
    """Raises BadInput when the tables of several aircraft do not go together."""
    tables = {name_of(table, number): table for number, table in enumerate(settings.aircraft)}
    if len(tables) < len(settings.aircraft):
        raise BadInput(f"{where}: two aircraft have the same name; give each its own, or none")
    layers_m = sorted(zip(_offsets_m(settings), tables, strict=True))
    for (low_m, low), (high_m, high) in pairwise(layers_m):
        if high_m - low_m < gap_m(settings.flight):
            raise BadInput(
                f"{where}: aircraft '{low}' and '{high}' fly {high_m - low_m:g} m apart in height, which is less than "
                f"the {gap_m(settings.flight):g} m that two layers need; change an altitude_offset_m, or leave it out"
            )
    linked = {name for name, table in tables.items() if table.connect}
    if linked and len(linked) < len(tables):
        without = next(name for name in tables if name not in linked)
        raise BadInput(
            f"{where}: aircraft '{without}' has no connect and others do; give all a link, or none"
        )
    if tables and settings.link.connect:
        raise BadInput(f"{where}: 'link.connect' is for one aircraft; give connect in each table of aircraft")
    if len(tables) > 1 and settings.link.system_id:
        raise BadInput(
            f"{where}: 'link.system_id' is for one aircraft; give system_id in each table of aircraft"
        )
    ids = {name: [str(table.system_id)] for name, table in tables.items() if table.system_id}
    for what, values in (
        ("connect", {name: [table.connect] for name, table in tables.items() if table.connect}),
        ("system_id", ids),
        ("source", {name: table.sources for name, table in tables.items()}),
    ):
        owner: dict[str, str] = {}
        for name, given in values.items():
            for value in given:
                if owner.setdefault(value, name) != name:
                    raise BadInput(
                        f"{where}: aircraft '{owner[value]}' and '{name}' both have the {what} '{value}'; each needs "
                        "its own"
                    )
