"""A run's folder for the tests of what is made from it: a real journal of a flight that nobody flew."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from service.area import Grid
from service.config import Settings
from service.evidence.observe import Observation, Sighting
from service.journal import Journal
from service.survey import AREA, JOURNAL, survey
from tests.service.area.files import at, box, collection, feature, point, polygon, ring

BEGAN = 1767225600.0
ELLIPSE = {"semi_major_m": 40.0, "semi_minor_m": 10.0, "bearing_deg": 70.0}
EVIL = "=cmd|' /C calc'!A0 <script>alert(1)</script> \ud800\x07"
SETTINGS = Settings.model_validate({"sensor": {"cell_m": 20.0}, "flight": {"altitude_m": 25.0}})

# A field of 300 x 200 m turned by 30 degrees, with a hole that is not flown over and the launch point outside.
FIELD = collection(
    feature(
        polygon(ring([(0, 0), (173.2, -100), (273.2, 73.2), (100, 173.2)])), name="Höhe <2>", outside=0.1
    ),
    feature(point(at(200, 40)), role="prior", sigma_m=40),
    feature(polygon(box(110, 20, 140, 50)), role="exclude", name="mast"),
    feature(point(at(-20, -20)), role="launch"),
)


def field_grid(folder: Path) -> Grid:
    """The area file in a folder, and its grid."""
    (folder / AREA).write_text(json.dumps(FIELD), encoding="utf-8")
    return survey(folder / AREA, None, SETTINGS)[1]


class Recorder:
    """Writes a run's journal as a service does, without a flight."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.grid = folder, field_grid(folder)
        self.journal = Journal(folder / JOURNAL)
        self.journal.set_meta("grid", self.grid.frame.to_dict())
        self.journal.set_meta("settings", SETTINGS.model_dump())
        self.time, self.frames = BEGAN, 0
        self.aircraft: dict[str, str] = {}
        """The field with the name of the aircraft that the rows are of, where several fly."""

    def write(self, kind: str, **body: Any) -> None:
        """One row, a second later, on disk when this returns."""
        self.time += 1.0
        self.journal.write(self.time, kind, {**body, **self.aircraft}).result()

    def start(self) -> None:
        """Up to the search."""
        steps = [
            ("WAITING", "linked", "READY", "px4 is ready"),
            ("READY", "airborne", "SEARCHING", "in the air"),
        ]
        for before, event, after, reason in steps:
            self.write("transition", **{"from": before, "event": event, "to": after, "reason": reason})
        self.write("command", command="reposition", lat=47.0, lon=11.0, alt_amsl_m=525.0)

    def look(
        self,
        cell: tuple[int, int],
        *,
        hit: bool = False,
        detections: tuple[Any, ...] = (),
        sightings: tuple[Sighting, ...] = (),
    ) -> None:
        """One frame over the middle of a cell, with one look at it."""
        lat, lon = self.grid.frame.to_latlon([cell])[0].tolist()
        self.frames += 1
        looked = Observation(
            np.array([cell]), np.array([hit]), np.array([0.9]), np.array([0.9]), np.array([True]), sightings
        )
        report = {
            "id": str(self.frames),
            "source": EVIL,
            "captured_at": self.time + 0.75,
            "usable": True,
            "pose": None,
            "detections": list(detections),
        }
        pose = [lat, lon, 25.0, 30.0]
        self.write("report", report=report, pose=pose, observation=looked.to_dict())

    def cells(self) -> Iterator[tuple[int, int]]:
        """The flyable cells, row by row there and back."""
        for row in range(self.grid.frame.rows):
            cols = np.flatnonzero(self.grid.flyable[row]).tolist()
            yield from ((row, col) for col in (cols if row % 2 == 0 else cols[::-1]))

    def end(self, *, found: bool) -> None:
        """Home, and the journal closed."""
        state = "SEARCHING"
        if found:
            lat, lon = at(200, 40)[::-1]
            self.write("found", lat=lat, lon=lon, probability=0.9994, sigma_m=6.5, ellipse=ELLIPSE)
            said = {"event": "confirmed", "to": "FOUND", "reason": "found"}
            self.write("transition", **{"from": state, **said})
            state = "FOUND"
        for event, after in (("return", "RETURNING"), ("landed", "DONE")):
            self.write("transition", **{"from": state, "event": event, "to": after, "reason": "it was time"})
            state = after
        self.journal.close()


def record(folder: Path, *, found: bool = False, part: float = 0.5) -> Path:
    """A run that has looked at a part of the cells, once each, with one hit and three reported detections."""
    folder.mkdir(parents=True, exist_ok=True)
    recorder = Recorder(folder)
    recorder.start()
    cells = list(recorder.cells())
    lon, lat = at(150, 60)
    seen = (
        {"class": "=person", "score": 0.7, "lat": lat, "lon": lon},
        {"class": "person", "box": [1, 2, 3, 4]},
    )
    for number, cell in enumerate(cells[: round(part * len(cells))]):
        recorder.look(cell, hit=number == 5, detections=seen if number in (5, 6) else ())
    recorder.end(found=found)
    return folder


def record_two(folder: Path) -> Path:
    """A run of two: kite looks at four cells, and then crow at three others."""
    recorder = Recorder(folder)
    tables = [{"name": "kite"}, {"name": "crow"}]
    recorder.journal.set_meta("settings", {**SETTINGS.model_dump(), "aircraft": tables})
    cells = list(recorder.cells())
    for name, seen in (("kite", cells[:4]), ("crow", cells[20:23])):
        recorder.aircraft = {"aircraft": name}
        recorder.start()
        for cell in seen:
            recorder.look(cell)
    recorder.journal.close()
    return folder
