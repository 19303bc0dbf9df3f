"""A run as a CSV table (RFC 4180): a row for each thing that happened, in the order of time, for any spreadsheet."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator

from service.export.features import iso
from service.export.model import ExportedRun
from service.export.wishes import Wishes

COLUMNS = ("time_utc", "what", "lat", "lon", "height_m", "heading_deg", "probability", "note")


def write(run: ExportedRun, wishes: Wishes) -> bytes:
    """Track, detections, find and timeline; UTF-8 with a byte order mark, without which Excel guesses wrong."""
    text = io.StringIO()
    table = csv.writer(text)
    table.writerow(COLUMNS)
    for time, row in sorted(_rows(run), key=lambda pair: pair[0]):
        table.writerow([iso(time), *row])
    return text.getvalue().encode("utf-8-sig")


def _rows(run: ExportedRun) -> Iterator[tuple[float, tuple[str, ...]]]:
    """Time and the other columns."""
    for piece in run.track:
        for fix in piece:
            where = (f"{fix.lat:.7f}", f"{fix.lon:.7f}", f"{fix.height_m:.1f}", f"{fix.heading_deg:.0f}")
            note = f"aircraft {fix.aircraft}" if fix.aircraft else ""
            yield fix.time, ("track", *where, "", harmless(note))
    for each in run.detections:
        note = harmless(f"{each.kind} of {each.source}" + ("" if each.counted else ", did not count"))
        place = (f"{each.lat:.7f}", f"{each.lon:.7f}", "", "")
        yield each.time, ("detection", *place, f"{each.score:.3f}", note)
    for moment in run.timeline:
        if moment.kind != "found":
            yield moment.time, (moment.kind, "", "", "", "", "", harmless(moment.text))
    if run.find is not None:
        place = (f"{run.find.lat:.7f}", f"{run.find.lon:.7f}", "", "")
        note = f"1 sigma {run.find.sigma_m:.1f} m"
        yield run.find.time, ("found", *place, f"{run.find.probability:.5f}", note)


def harmless(text: str) -> str:
    """Text that no spreadsheet takes for a formula: what a detector calls itself is not ours to trust."""
    return f"'{text}" if text.startswith(("=", "+", "-", "@", "\t", "\r")) else text
