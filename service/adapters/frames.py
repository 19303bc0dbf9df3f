"""What a detector makes of one frame, whatever it is called where it comes from."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

Box = tuple[float, float, float, float]
"""x0, y0, x1, y1 in parts of the image's width and height, from its top left corner: 0 to 1."""

MOST_SEEN = 256
"""Detections of a report, at most: the schema's limit."""


@dataclass(frozen=True, slots=True)
class Seen:
    """One object in a frame; `score` is 0 to 1."""

    kind: str
    score: float
    box: Box


@dataclass(frozen=True, slots=True)
class Frame:
    """A frame that was looked at. Without anything seen it is a report too: it is what clears the ground.

    `captured_at` is in seconds of `clock`, as the schema of a report names it; `name` is the camera's own name of it.
    """

    captured_at: float
    seen: tuple[Seen, ...] = ()
    clock: str = "unix"
    name: str | None = None
    usable: bool = True


def in_shares(box: Iterable[float], width: float, height: float) -> Box | None:
    """A box in pixels of an image of that size as parts of it, clipped to it; None where nothing is left of it."""
    x0, y0, x1, y1 = (float(value) for value in box)
    x0, x1 = max(x0 / width, 0.0), min(x1 / width, 1.0)
    y0, y1 = max(y0 / height, 0.0), min(y1 / height, 1.0)
    return (x0, y0, x1, y1) if x0 < x1 and y0 < y1 else None


def as_report(frame: Frame, name: str, source: str, threshold: float | None = None) -> dict[str, Any]:
    """The report of a frame, as the public schema has it; `name` is its id. The best come first."""
    best = sorted(frame.seen, key=lambda seen: -seen.score)[:MOST_SEEN]
    report: dict[str, Any] = {
        "version": 1,
        "id": name,
        "source": source,
        "captured_at": frame.captured_at,
        "clock": frame.clock,
        "box_unit": "share",
        "detections": [
            {"class": seen.kind, "score": min(max(seen.score, 0.0), 1.0), "box": list(seen.box)}
            for seen in best
        ],
    }
    if frame.name is not None:
        report["frame_id"] = frame.name
    if not frame.usable:
        report["usable"] = False
    if threshold is not None:
        report["threshold"] = threshold
    return report
