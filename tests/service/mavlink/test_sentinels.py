"""The values by which a field says that it knows nothing, for every field that the link reads."""

from __future__ import annotations

import copy
import importlib.resources
import math
import xml.etree.ElementTree as ET
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.mavlink.heard import Heard
from service.mavlink.readers import READERS
from service.mavlink.sentinels import FIELDS, KnownFields
from service.mavlink.settings import MavlinkSettings
from service.mavlink.telemetry import Telemetry

from .peer import Rig
from .samples import SAMPLES

NAMES = {"UINT8_MAX": 2**8 - 1, "UINT16_MAX": 2**16 - 1, "INT16_MAX": 2**15 - 1, "INT32_MAX": 2**31 - 1}
BITS = ("flags", "onboard_control_sensors_enabled", "onboard_control_sensors_health", "type_mask")
NUMBERS = [
    (name, field)
    for name, rules in sorted(FIELDS.items())
    for field in sorted(rules)
    if field not in (*BITS, "id", "coordinate_frame", "chancount", "orientation")
]


def definitions() -> dict[str, dict[str, tuple[str, str | None, bool]]]:
    """From MAVLink's own XML: message, field to (type, what it calls invalid, whether it is an extension)."""
    found: dict[str, dict[str, tuple[str, str | None, bool]]] = {}
    folder = importlib.resources.files("pymavlink") / "dialects" / "v20"
    for file in ("minimal.xml", "standard.xml", "common.xml", "ardupilotmega.xml"):
        for message in ET.fromstring((folder / file).read_text(encoding="utf-8")).iter("message"):
            extension, read = False, found.setdefault(message.get("name", ""), {})
            for part in message:
                extension |= part.tag == "extensions"
                if part.tag == "field":
                    read[part.get("name", "")] = (part.get("type", ""), part.get("invalid"), extension)
    return found


DEFINITIONS = definitions()


def sentinels(name: str, field: str) -> list[float]:
    """All that may mean 'unknown' in this field: as its definition says, and as its type's end is used in the wild."""
    kind, invalid, extension = DEFINITIONS[name][field]
    kind = kind.split("[")[0]
    values: list[float] = []
    if invalid is not None:
        word = invalid.strip("[]").split(":")[0].rstrip(",")
        values.append(math.nan if word == "NaN" else float(NAMES.get(word, word) if word in NAMES else word))
    if kind == "float":
        return [*values, math.nan, math.inf, -math.inf]
    bits = int(kind.split("int")[1].split("_")[0])
    values.append(2 ** (bits if kind.startswith("u") else bits - 1) - 1)
    return [*values, 0] if extension else values


def with_field(name: str, field: str, value: float) -> Any:
    """The sample of a message with one field changed."""
    message = copy.copy(SAMPLES[name])
    whole = getattr(message, field)
    setattr(message, field, [value] * len(whole) if isinstance(whole, list) else value)
    return message


@pytest.mark.parametrize(("name", "field"), NUMBERS)
def test_every_sentinel_of_every_field_that_is_read_is_unknown(name: str, field: str) -> None:
    assert sentinels(name, field)
    for value in sentinels(name, field):
        known = KnownFields(with_field(name, field, value))
        if isinstance(getattr(SAMPLES[name], field), list):
            assert known.each(field) == [], value
        else:
            assert known.read(field) is None, value


@pytest.mark.parametrize(("name", "field"), NUMBERS)
def test_no_sentinel_gets_into_the_telemetry_as_a_number(name: str, field: str) -> None:
    for value in sentinels(name, field):
        heard = Heard(MavlinkSettings())
        heard.base = Telemetry(heartbeat_time=100.0)
        heard.take(with_field(name, field, value), 100.0)
        numbers = [part for part in numbers_in(heard.view(100.0)) if not math.isnan(part)]
        scaled = [value / per for per in (1.0, 100.0, 1e3, 1e7) if value not in (0, -1)]
        assert not any(math.isclose(part, other) for part in numbers for other in scaled), value


def numbers_in(t: Telemetry) -> list[float]:
    """Every number in a snapshot that a message can have put there."""
    values: list[Any] = [
        getattr(t, field)
        for field in Telemetry.__slots__
        if field not in ("told", "heartbeat_time", "position_time", "status_time")
    ]
    for place in (t.home, t.origin, t.target):
        values += [] if place is None else [place.lat, place.lon, place.alt_amsl_m]
    values += [] if t.wind is None else [t.wind.north_mps, t.wind.east_mps]
    values += t.velocity_ned_mps
    return [float(v) for v in values if isinstance(v, int | float) and not isinstance(v, bool)]


def test_a_reader_cannot_read_past_the_table() -> None:
    for name, reader in READERS.items():
        assert reader(KnownFields(SAMPLES[name])), name
    with pytest.raises(KeyError):
        KnownFields(SAMPLES["GPS_RAW_INT"]).read("vel")


def test_a_position_at_the_end_of_its_type_is_none() -> None:
    rig = Rig()
    rig.say(rig.peer.heartbeat())
    nowhere = mavlink.MAVLink_global_position_int_message(1000, 2**31 - 1, 2**31 - 1, 0, 0, 0, 0, 0, 65535)
    rig.say(rig.peer.pack(nowhere))
    assert not rig.core.telemetry.position_known


def test_a_heading_and_a_speed_that_are_unknown_stay_unknown() -> None:
    rig = Rig()
    rig.say(rig.peer.heartbeat())
    rig.say(
        rig.peer.pack(
            mavlink.MAVLink_global_position_int_message(
                1000, 470000000, 80000000, 509000, 20000, 32767, 0, 0, 65535
            )
        )
    )
    t = rig.core.telemetry
    assert t.position_known
    assert math.isnan(t.heading_deg)
    assert math.isnan(t.ground_speed_mps)


def test_px4_says_minus_one_ampere_for_a_current_that_it_does_not_measure() -> None:
    message = with_field("BATTERY_STATUS", "current_battery", -100)
    assert KnownFields(message).read("current_battery") is None
