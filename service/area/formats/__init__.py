"""The files that teams have, each read by a reader of its own into a `Document`: what kind it is, its bytes say.

KML is read by fastkml and GPX by gpxpy: both are pure Python, small and kept well, and know the corners of these
formats (namespaces, nested geometries, extensions, altitudes, both versions of GPX). GDAL (pyogrio) would read more,
with 60 MB that differ from machine to machine and drivers that differ in what they tell. JSON needs no library.
"""

from __future__ import annotations

from typing import Any

from service.area.document import Document
from service.area.formats import caltopo, plain, plan
from service.area.formats.guard import check_xml, unzip
from service.area.formats.texts import json_text, mended_xml, refuse_others, xml_text
from service.area.geojson import Where, load_json
from service.area.words import give_roles
from service.errors import BadInput

_ZIP = b"PK\x03\x04"
_RECORD = "\x1e"
"""Begins each value of a GeoJSON text sequence (RFC 8142)."""


def read_document(data: bytes, where: Where) -> Document:
    """What a file says, whatever program wrote it; things without a role have one by `words`, or are in its notes.

    Raises:
        BadInput: it is none of the kinds that are known, or is built to do harm.
    """
    if data.startswith(_ZIP):
        first, *linked = unzip(data, where)
        document = _read(first, where, "KMZ")
        for each in linked:
            more = _read(each, where, "KMZ")
            document.items += more.items
            document.notes += more.notes
            document.faults += more.faults
    else:
        document = _read(data, where, "KML")
    give_roles(document)
    return document


def _read(data: bytes, where: Where, kml: str) -> Document:
    """What one file says. `kml` is what a KML document is called."""
    refuse_others(data, where)
    text, notes = xml_text(data)
    if text.lstrip().startswith("<"):
        document = _read_xml(text, where, kml)
    else:
        text, notes = json_text(data)
        value, as_is = _json_value(text, where)
        if value.get("fileType") == "Plan":
            document = plan.read_plan(value, where)
        elif caltopo.is_caltopo(value):
            document = caltopo.read_caltopo(value)
        else:
            document = plain.read_plain(value, where)
            document.plain = as_is and data.endswith(text.encode(errors="replace"))
    document.notes = [*notes, *document.notes]
    return document


def _read_xml(text: str, where: Where, kml: str) -> Document:
    try:
        root = check_xml(text.encode(errors="replace"), where)
    except BadInput:
        text = mended_xml(text)
        root = check_xml(text.encode(errors="replace"), where)
    if root == "kml":
        from service.area.formats.kml import read_kml

        return read_kml(text, kml, where)
    if root == "gpx":
        from service.area.formats.gpx import read_gpx

        return read_gpx(text, where)
    raise where.bad(f"this is XML of <{root[:40]}>, which names no area; give KML, GPX or GeoJSON")


def _json_value(text: str, where: Where) -> tuple[dict[str, Any], bool]:
    """The GeoJSON object in a text, or the collection that a list or a sequence of features makes; and whether it is
    there as it stands."""
    try:
        value = load_json(text, where)
    except BadInput:
        if (value := _sequence(text, where)) is None:
            raise
    as_is = isinstance(value, dict)
    if isinstance(value, list) and value and all(isinstance(each, dict) and "type" in each for each in value):
        value = {"type": "FeatureCollection", "features": value}
    if not isinstance(value, dict):
        raise where.bad(
            "not GeoJSON: the top level must be an object with a 'type', such as FeatureCollection"
        )
    for key in ("result", "state"):  # as CalTopo's own server answers
        inner = value.get(key)
        if "type" not in value and isinstance(inner, dict):
            value, as_is = inner, False
    return value, as_is


def _sequence(text: str, where: Where) -> list[Any] | None:
    """The features of a file that has one on each line, as QGIS and GDAL write GeoJSONSeq; None where it is none."""
    lines = [line.strip(" \t\r" + _RECORD) for line in text.split("\n")]
    try:
        features = [load_json(line, where) for line in lines if line]
    except BadInput:
        return None
    return features if len(features) > 1 and all(isinstance(each, dict) for each in features) else None
