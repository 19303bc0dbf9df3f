"""What a receipt says about a report that was taken in, beside its numbers of looks and hits."""

from __future__ import annotations

from service.evidence.observe import Reading
from service.evidence.reports import Report

NOTHING_NEW = "shows nothing new: its cells have been looked at in this pass, and no better"


def said_of(report: Report, reading: Reading, looks: int, hits: int) -> str:
    """Why the frame was no look, or why a detection of it was no hit; empty where there is nothing to say."""
    said = []
    if not report.usable:
        said.append("the frame shows nothing, says the report (usable is false)")
        if report.detections:
            said.append(
                "its detections do not count: a frame with the target in it is usable, so send it as that"
            )
    elif not looks:
        footprint = reading.footprint
        said.append(
            NOTHING_NEW if footprint.counts.any() else footprint.why_not or "no cell is seen well enough"
        )
    elif not hits and report.detections and not reading.note:
        said.append("its detections are not the hit of any cell that it looked at")
    if reading.note:
        said.append(reading.note)
    return "; ".join(said)
