"""A run as KML 2.2 (OGC 07-147r2): a folder for each kind of thing, with styles that read well on satellite images."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Sequence

import numpy as np
import shapely

from service.export.features import PlacedItem, iso, items
from service.export.model import ExportedRun
from service.export.wishes import Wishes

NAMESPACE = "http://www.opengis.net/kml/2.2"
FOLDERS = {
    "found": "Found here",
    "uncertainty": "Where the target is with 95 %",
    "gap": "Gaps to fly again",
    "track": "Flight",
    "hit": "Cells with a hit",
    "detection": "Reported by the detector",
    "region": "Regions of interest",
    "search": "Search area",
    "exclude": "Not flown over",
    "launch": "Launch",
}
"""Each role with the name of its folder, in the order of the list beside the map."""

LINES = {  # colour as aabbggrr, width in pixels
    "uncertainty": ("ff00ffff", 2),
    "gap": ("ff0055ff", 2),
    "track": ("ff00a5ff", 2),
    "region": ("ffffffff", 1),
    "search": ("ffffaa00", 3),
    "exclude": ("ff0000ff", 2),
}
FILLS = {"gap": "550055ff", "exclude": "660000ff", "uncertainty": "3300ffff"}
HIDDEN = ("detection", "region")


def write(run: ExportedRun, wishes: Wishes) -> bytes:
    """The run as one document."""
    ET.register_namespace("", NAMESPACE)
    root = ET.Element(_tag("kml"))
    document = ET.SubElement(root, _tag("Document"))
    _text(document, "name", f"{run.area.name}: {run.name}")
    _text(document, "description", f"{run.summary}. As of {iso(run.last)}.")
    for role, (colour, width) in LINES.items():
        style = ET.SubElement(document, _tag("Style"), {"id": role})
        line = ET.SubElement(style, _tag("LineStyle"))
        _text(line, "color", colour)
        _text(line, "width", str(width))
        fill = ET.SubElement(style, _tag("PolyStyle"))
        _text(fill, "color", FILLS.get(role, "00ffffff"))
    things = items(run, wishes)
    for role, name in FOLDERS.items():
        found = [item for item in things if item.role == role]
        if found:
            folder = ET.SubElement(document, _tag("Folder"))
            _text(folder, "name", name)
            for item in found:
                _placemark(folder, item, run.launch_amsl_m if run.grid.relief is not None else None)
    ET.indent(root)
    return bytes(ET.tostring(root, encoding="utf-8", xml_declaration=True)) + b"\n"


def _placemark(folder: ET.Element, item: PlacedItem, amsl_m: float | None) -> None:
    """One thing; the order of the elements is that of the schema. A track is drawn at its heights where `amsl_m`, that
    of the ground at the launch point, is known, else on the ground."""
    mark = ET.SubElement(folder, _tag("Placemark"))
    _text(mark, "name", item.name)
    if item.role in HIDDEN:
        _text(mark, "visibility", "0")
    if item.time is not None:
        _text(ET.SubElement(mark, _tag("TimeStamp")), "when", iso(item.time))
    elif item.fixes:
        span = ET.SubElement(mark, _tag("TimeSpan"))
        _text(span, "begin", iso(item.fixes[0].time))
        _text(span, "end", iso(item.fixes[-1].time))
    if item.role in LINES:
        _text(mark, "styleUrl", f"#{item.role}")
    if item.facts:
        extended = ET.SubElement(mark, _tag("ExtendedData"))
        for name, value in item.facts.items():
            _text(ET.SubElement(extended, _tag("Data"), {"name": name}), "value", str(value))
    if item.shape is None:
        line = ET.SubElement(mark, _tag("LineString"))
        _text(line, "tessellate", "1")
        if amsl_m is not None:
            _text(line, "altitudeMode", "absolute")
        up = amsl_m or 0.0
        _text(
            line,
            "coordinates",
            " ".join(f"{f.lon:.7f},{f.lat:.7f},{f.height_m + up:.1f}" for f in item.fixes),
        )
    else:
        _geometry(mark, item.shape)


def _geometry(parent: ET.Element, shape: shapely.Geometry) -> None:
    if isinstance(shape, shapely.Point):
        _text(ET.SubElement(parent, _tag("Point")), "coordinates", _coordinates([(shape.x, shape.y)]))
        return
    parts = shapely.get_parts(shape)
    if len(parts) > 1:
        parent = ET.SubElement(parent, _tag("MultiGeometry"))
    for part in parts:
        polygon = ET.SubElement(parent, _tag("Polygon"))
        _text(polygon, "tessellate", "1")
        for name, ring in [
            ("outerBoundaryIs", part.exterior),
            *(("innerBoundaryIs", hole) for hole in part.interiors),
        ]:
            border = ET.SubElement(ET.SubElement(polygon, _tag(name)), _tag("LinearRing"))
            _text(border, "coordinates", _coordinates(np.asarray(ring.coords)[:, :2]))


def _coordinates(points: Sequence[Sequence[float]] | np.ndarray) -> str:
    return " ".join(f"{lon:.7f},{lat:.7f}" for lon, lat in points)


def _tag(name: str) -> str:
    return f"{{{NAMESPACE}}}{name}"


def _text(parent: ET.Element, name: str, text: str) -> None:
    ET.SubElement(parent, _tag(name)).text = text
