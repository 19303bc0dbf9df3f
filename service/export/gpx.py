"""A run as GPX 1.1, for handheld receivers: a track for each aircraft, the launch, the find, hits, and the middle of
each gap."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator

from service.export.features import PlacedItem, iso, items
from service.export.gaps import find_gaps
from service.export.model import ExportedRun
from service.export.wishes import Wishes

NAMESPACE = "http://www.topografix.com/GPX/1/1"
SYMBOLS = {"launch": "Helipad", "found": "Flag, Red", "hit": "Flag, Blue", "gap": "Crossing"}


def write(run: ExportedRun, wishes: Wishes) -> bytes:
    """The run; that its heights are above the launch point and not the sea is said in the track's `desc`."""
    ET.register_namespace("", NAMESPACE)
    root = ET.Element(_tag("gpx"), {"version": "1.1", "creator": "roisearch"})
    about = ET.SubElement(root, _tag("metadata"))
    _text(about, "name", f"{run.area.name}: {run.name}")
    _text(about, "desc", run.summary)
    _text(about, "time", iso(run.last))
    for lat, lon, role, name, note, time in _marks(run, wishes):
        mark = ET.SubElement(root, _tag("wpt"), {"lat": f"{lat:.7f}", "lon": f"{lon:.7f}"})
        if time is not None:
            _text(mark, "time", iso(time))
        _text(mark, "name", name)
        _text(mark, "desc", note)
        _text(mark, "sym", SYMBOLS[role])
        _text(mark, "type", role)
    for aircraft, pieces in run.tracks.items():
        track = ET.SubElement(root, _tag("trk"))
        _text(track, "name", f"flight of aircraft {aircraft}" if aircraft else "flight")
        _text(track, "desc", "heights are metres above the launch point")
        for piece in pieces:
            part = ET.SubElement(track, _tag("trkseg"))
            for fix in piece:
                at = {"lat": f"{fix.lat:.7f}", "lon": f"{fix.lon:.7f}"}
                point = ET.SubElement(part, _tag("trkpt"), at)
                _text(point, "ele", f"{fix.height_m:.2f}")
                _text(point, "time", iso(fix.time))
    ET.indent(root)
    return bytes(ET.tostring(root, encoding="utf-8", xml_declaration=True)) + b"\n"


def _marks(run: ExportedRun, wishes: Wishes) -> Iterator[tuple[float, float, str, str, str, float | None]]:
    """Points: lat, lon, role, name, note, time."""
    for number, gap in enumerate(find_gaps(run, wishes), 1):
        note = f"fly again: {gap.poa:.1%} of the probability, {gap.area_m2 / 1e4:.1f} ha, POD {gap.pod:.0%}"
        yield *gap.middle, "gap", f"gap {number}", note, None
    for item in items(run, wishes):
        if item.role in ("launch", "hit", "found"):
            assert item.shape is not None
            yield item.shape.y, item.shape.x, item.role, item.name, _note(item), item.time


def _note(item: PlacedItem) -> str:
    said = [
        f"{name} {value if isinstance(value, str) else f'{value:.4g}'}" for name, value in item.facts.items()
    ]
    return ", ".join(said) or item.name


def _tag(name: str) -> str:
    return f"{{{NAMESPACE}}}{name}"


def _text(parent: ET.Element, name: str, text: str) -> None:
    ET.SubElement(parent, _tag(name)).text = text
