"""KML and KMZ, as Google Earth, CalTopo, SARTopo and QGIS write them (OGC KML 2.3), by fastkml."""

from __future__ import annotations

import logging
import re
from collections.abc import Iterator
from typing import Any

import fastkml
from fastkml.data import Data, SchemaData

from service.area.document import (
    OURS,
    Document,
    Item,
    Json,
    label,
    one_line,
    plain_text,
    settings_in,
    short_text,
    spelt,
    typed,
)
from service.area.formats.caltopo import close
from service.area.formats.guard import MOST_DEPTH
from service.area.formats.plain import MOST_ITEMS, share_of, simple_parts
from service.area.geojson import Where
from service.errors import BadInput

_OLD = re.compile(r"http://(earth\.google\.com/kml/2\.[0-2]|www\.opengis\.net/kml/2\.3)")
_NAMESPACE = "http://www.opengis.net/kml/2.2"


def read_kml(text: str, kind: str, where: Where) -> Document:
    """The placemarks of a KML document, in whatever folders; what is no placemark is noted.

    Raises:
        BadInput: fastkml cannot make sense of it.
    """
    logging.getLogger("fastkml").setLevel(
        logging.CRITICAL
    )  # it tells of each odd element; we tell of placemarks
    plain = _OLD.sub(_NAMESPACE, text)
    if _NAMESPACE not in plain:
        plain = plain.replace("<kml", '<kml xmlns="' + _NAMESPACE + '"', 1)
    try:
        root = fastkml.KML.from_string(plain, strict=False)
        names = [
            one_line(getattr(each, "name", "") or "") for each in root.features if hasattr(each, "features")
        ]
        document = Document(kind, name=next((name for name in names if name and ".kml" not in name), ""))
        for number, (feature, folder) in enumerate(_features(root, "", 0)):
            _take(document, feature, number, folder)
            if len(document.items) > MOST_ITEMS:
                raise where.bad(f"more than {MOST_ITEMS} places are drawn; export only the area")
    except BadInput:
        raise
    except Exception as error:  # a library of this size has its own ways to say no
        raise where.bad(f"this KML cannot be read ({one_line(error)}); export it again") from None
    return document


def _features(holder: Any, folder: str, depth: int) -> Iterator[tuple[Any, str]]:
    """The features in a document, each with the name of the folder it is in."""
    for feature in holder.features:
        if hasattr(feature, "features"):
            if depth < MOST_DEPTH:
                name = one_line(feature.name or "") if isinstance(feature, fastkml.Folder) else ""
                yield from _features(feature, name or folder, depth + 1)
        else:
            yield feature, folder


def _take(document: Document, feature: Any, number: int, folder: str) -> None:
    kind = type(feature).__name__
    columns = _extended(feature)
    name = one_line(plain_text(feature.name or "")) or one_line(
        columns.pop("name", "") or columns.pop("title", "")
    )
    called = label(kind.lower(), number, name)
    if kind == "NetworkLink":
        document.notes.append(
            f"{called}: left out, it only links to a map; open that one and export it itself"
        )
        return
    if kind != "Placemark":
        document.notes.append(f"{called}: left out, it marks no place")
        return
    geometry = _geometry(feature)
    if geometry is None:
        document.notes.append(f"{called}: left out, it has no geometry that can be read")
        return
    ours = {key: value for key, value in columns.items() if key in OURS}
    said = {**ours, **settings_in(feature.description or "")}
    hints = (short_text(feature.description), folder)
    try:
        parts = simple_parts(geometry, Where("", called))
    except BadInput as error:
        document.faults.append(str(error).removeprefix(": "))
        return
    for index, part in enumerate(parts, 1):
        if part["type"] == "LinearRing":
            part = {"type": "Polygon", "coordinates": [part["coordinates"]]}
        elif part["type"] == "LineString" and "role" not in said:
            close(part, name)
        own = called if len(parts) == 1 else f"{called}, part {index}"
        document.items.append(Item(own, part, share_of(said, len(parts)), name, hints=hints))


def _extended(feature: Any) -> Json:
    """What ExtendedData says, as QGIS and GDAL write attributes."""
    found: Json = {}
    for element in feature.extended_data.elements if feature.extended_data is not None else ():
        if isinstance(element, Data):
            found[str(element.name or "")] = element.value
        elif isinstance(element, SchemaData):
            found.update({str(each.name): each.value for each in element.data})
    return typed({key: value for key, value in spelt(found).items() if value not in (None, "")})


def _geometry(feature: Any) -> Json | None:
    """Where a placemark is; None where it says nothing that can be read, as a gx:Track without times."""
    try:
        made: Json = _lists(feature.geometry.__geo_interface__)
    except (AttributeError, TypeError, ValueError):
        return None
    return made


def _lists(value: Any) -> Any:
    """A geometry in tuples as one in lists, rings closed: KML's readers close them, and so do we."""
    if isinstance(value, dict):
        made = {key: _lists(each) for key, each in value.items() if key != "bbox"}
        if made.get("type") == "LinearRing":
            return {"type": "Polygon", "coordinates": [made["coordinates"]]}
        return made
    return [_lists(each) for each in value] if isinstance(value, tuple | list) else value
