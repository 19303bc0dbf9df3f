"""CalTopo and SARTopo exports: GeoJSON whose `class` says what a thing is and whose `title` what it is called."""

from __future__ import annotations

from typing import Any

from service.area.document import Document, Json, one_line, settings_in, short_text
from service.area.formats.plain import label_of, take_feature
from service.area.words import are_positions, outline

CLASSES = frozenset(
    {"Folder", "Marker", "Shape", "Assignment", "Clue", "OperationalPeriod", "Resource", "MapMediaObject"}
    | {"AppTrack", "LiveTrack", "FieldTrack", "FieldWaypoint", "SmsLocationRequest"}
)
_TRACKS = ("AppTrack", "LiveTrack", "FieldTrack")


def is_caltopo(root: Json) -> bool:
    """Whether a GeoJSON value is an export of CalTopo, by the classes of its features."""
    features = root.get("features")
    return (
        root.get("type") == "FeatureCollection"
        and isinstance(features, list)
        and any(_class(each) in CLASSES for each in features)
    )


def _class(feature: Any) -> str:
    properties = feature.get("properties") if isinstance(feature, dict) else None
    kind = properties.get("class") if isinstance(properties, dict) else None
    return kind if isinstance(kind, str) else ""


def read_caltopo(root: Json) -> Document:
    """The things of an export. Folders are places to keep them; what a description sets (`role=prior`) counts."""
    document = Document("CalTopo")
    folders = {
        each.get("id"): each["properties"].get("title")
        for each in root["features"]
        if _class(each) == "Folder" and isinstance(each.get("id"), str)
    }
    for index, feature in enumerate(root["features"]):
        kind = _class(feature)
        if kind in ("Folder", "OperationalPeriod"):
            continue  # they hold others and are nowhere themselves
        label = label_of(index, feature)
        if kind in _TRACKS:
            document.notes.append(f"{label}: left out, where a team went is no ground to search")
            continue
        before = len(document.items)
        take_feature(document, feature, label)
        for item in document.items[before:]:
            properties = item.properties
            title = one_line(properties.get("title", ""))
            number = "".join(str(properties.get(key, "")) for key in ("number", "letter"))
            described = properties.get("description")
            item.kind = kind
            item.words = title or one_line(number)
            folder = properties.get("folderId")
            inside = folders.get(folder) if isinstance(folder, str) else None
            item.hints = (short_text(described), one_line(inside or ""))
            ours = {key: value for key, value in properties.items() if key == "role"}
            item.properties = {**ours, **settings_in(described if isinstance(described, str) else "")}
            if item.geometry.get("type") == "LineString" and "role" not in item.properties:
                close(item.geometry, item.words)
    return document


def close(geometry: Json, name: str) -> None:
    """Make a line that goes around an area, by its name, the area."""
    positions = geometry.get("coordinates")
    if are_positions(positions) and (ring := outline(positions, name, always=False)) is not None:
        geometry.update(type="Polygon", coordinates=[ring])
