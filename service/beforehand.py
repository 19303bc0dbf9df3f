"""What a run would refuse of settings that are well formed: addresses that are none, files that are missing or no good.

No address is taken and nobody is spoken to, so that it can be asked before the day.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

from service.config import Settings, each_aircraft
from service.doors.mqtt import read_broker
from service.errors import BadInput
from service.evidence.calibration import calibration_of
from service.http.access import read_access
from service.http.address import split_address
from service.mavlink import read_signing_key
from service.mavlink.url import parse_url
from service.telling.settings import read_plan
from service.view.underlay import open_underlay

_TOLD = ("webhook", "mqtt", "tak")


def refused(settings: Settings) -> list[tuple[str, str]]:
    """All of it: the key of a setting, and the sentence that a run would end with."""
    found: dict[tuple[str, str], None] = {}  # what several aircraft have in common is told once
    for key, check in _checks(settings):
        try:
            check()
        except BadInput as error:
            found[key, str(error)] = None
    return list(found)


def _checks(settings: Settings) -> Iterator[tuple[str, Callable[[], Any]]]:
    """For each setting that is given, what a run does with it first."""
    for alone in each_aircraft(settings).values():
        if alone.link.connect:
            yield "link.connect", partial(parse_url, alone.link.connect)
        yield "sensor.calibration_file", partial(calibration_of, alone)
    if settings.link.signing_key_file:
        yield "link.signing_key_file", partial(read_signing_key, settings.link.signing_key_file)
    files = [("ground.file", file) for file in settings.ground_files]
    files += [(f"ground.{key}", getattr(settings.ground, key)) for key in ("cover_file", "mobility_file")]
    for key, file in files:
        if file:
            yield key, partial(_there, key, file)
    yield "http.listen", partial(split_address, settings.http.listen)
    # whether a token is needed is asked where it listens: it may come from the environment there
    yield "http.token_file", partial(read_access, settings.http, {}, loopback=True)
    doors = settings.doors
    if doors.udp:
        yield "doors.udp", partial(split_address, doors.udp)
    if doors.mqtt:
        yield "doors.mqtt", partial(read_broker, doors.mqtt, doors.mqtt_topic, doors.mqtt_credentials_file)
    for key in _TOLD:
        others = {other: "" for other in _TOLD if other != key}
        yield f"telling.{key}", partial(read_plan, settings.telling.model_copy(update=others))
    yield (
        "page.mbtiles_file" if settings.page.mbtiles_file else "page.tiles_url",
        partial(open_underlay, settings.page),
    )


def _there(key: str, file: str) -> None:
    if not Path(file).exists():
        raise BadInput(f"{key}: there is no file {file}")
