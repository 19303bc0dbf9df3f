"""What a run's folder tells of its pace: when POS had reached what, and how fast the aircraft was while it searched."""

from __future__ import annotations

import itertools
import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from service.geometry import distance_m
from service.journal import read_rows

GOALS = (0.5, 0.75, 0.9)
LONGEST_GAP_S = 5.0
"""A gap in the track longer than this is no flight."""


@dataclass(frozen=True)
class Times:
    """Seconds from the first report on until POS was 50, 75 and 90 %, None where it never was, and metres a second
    over ground between the first report and the end of the search; None when nothing was flown. `frame_s`: median
    seconds from frame to frame."""

    reached: tuple[float | None, ...]
    mean_mps: float | None
    frame_s: float | None = None


def times_of(folder: Path) -> Times:
    """The times of a run, from its report and its track. Raises BadInput when its journal cannot be read."""
    report = json.loads((folder / "report.json").read_text(encoding="utf-8"))
    reached = tuple(report["pos_after_s"][f"{goal:g}"] for goal in GOALS)
    rows = [row.time for row in read_rows(folder / "journal.sqlite", "report")]
    track = json.loads((folder / "track.geojson").read_text(encoding="utf-8"))["features"]
    line = next((each for each in track if each["properties"]["role"] == "track"), None)
    if line is None or not rows:
        return Times(reached, None)
    ended = [
        row.time
        for row in read_rows(folder / "journal.sqlite", "transition")
        if row.body["to"] in ("RETURNING", "FOUND", "DONE", "ABORTED")
    ]
    places = [(lat, lon) for lon, lat, *_ in line["geometry"]["coordinates"]]
    speed = mean_speed(line["properties"]["times"], places, min(rows), min(ended, default=max(rows)))
    return Times(reached, speed, float(np.median(np.diff(rows))) if len(rows) > 1 else None)


def mean_speed(
    times: Sequence[float], places: Sequence[tuple[float, float]], begin: float, end: float
) -> float | None:
    """Metres a second over ground between two times, of places (latitude, longitude); None when it was nowhere."""
    metres = seconds = 0.0
    for (before, here), (after, there) in itertools.pairwise(zip(times, places, strict=True)):
        if begin <= before and after <= end and after - before <= LONGEST_GAP_S:
            metres += distance_m(here, there)
            seconds += after - before
    return metres / seconds if seconds > 0.0 and math.isfinite(metres) else None
