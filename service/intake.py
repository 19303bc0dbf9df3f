"""The one intake behind every door: a detector report is checked, written to the journal, and then believed.

A report is acknowledged only after it is on disk, together with what it was taken to mean, so a restart that
replays the journal has the same belief to the last bit. A repeated id changes nothing.
"""

from __future__ import annotations

import asyncio
import sqlite3
import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from service.clock import Clock
from service.evidence import Cell, Footprint, Observation, Passes, Pose, Sensor, observe
from service.journal import Duplicate, Journal
from service.reports import Receipt, Report
from service.search import Search

PoseAt = Callable[[float], Pose | None]


class JournalLost(RuntimeError):
    """The journal cannot be written: nothing may be believed or acknowledged any more."""


@dataclass
class Intake:
    """Where reports go in. `pose_at` looks a capture time up in the telemetry; `told` is called after each
    applied observation with the time (perf_counter) at which its report arrived."""

    search: Search
    sensor: Sensor
    journal: Journal
    clock: Clock
    pose_at: PoseAt
    told: Callable[[Observation, float], None]
    passes: Passes = field(default_factory=Passes)
    accepted: int = 0
    refused: int = 0
    last_at: float = 0.0
    _ids: set[str] = field(default_factory=set)
    _pending: dict[str, asyncio.Event] = field(default_factory=dict)

    async def submit(self, report: Report) -> Receipt:
        """Take one report in. Raises JournalLost when it could not be written."""
        arrived = time.perf_counter()
        while report.id in self._pending:  # the same report again, before the first is on disk
            await self._pending[report.id].wait()
        if report.id in self._ids:
            return Receipt(id=report.id, status="duplicate")
        pose = self._pose(report)
        if pose is None:
            self.refused += 1
            reason = (
                f"no position of the aircraft is known and trusted for captured_at {report.captured_at:.3f}"
            )
            return Receipt(id=report.id, status="refused", reason=reason)
        written = self._pending[report.id] = asyncio.Event()
        footprint = self.sensor.footprint(pose)
        hits = self._hits(report, footprint)
        passes_before = dict(self.passes.verdict)
        observation = observe(self.sensor, self.passes, footprint, hits) if report.usable else None
        body = {
            "report": report.model_dump(by_alias=True),
            "pose": [pose.lat, pose.lon, pose.height_m, pose.heading_deg],
            "observation": observation.to_dict() if observation else None,
        }
        try:
            await self.journal.append(self.clock.now(), "report", body, key=f"report {report.id}")
            self._ids.add(report.id)
        except Duplicate:
            return Receipt(id=report.id, status="duplicate")
        except (sqlite3.Error, OSError) as error:
            self.passes.verdict = passes_before
            raise JournalLost(f"the journal {self.journal.path} cannot be written: {error}") from error
        finally:
            del self._pending[report.id]
            written.set()
        self.accepted += 1
        self.last_at = self.clock.now()
        if observation is None:
            return Receipt(id=report.id, status="accepted")
        self.search.apply(observation)
        self.told(observation, arrived)
        return Receipt(
            id=report.id, status="accepted", looks=len(observation.cells), hits=int(observation.hits.sum())
        )

    def remember(self, ids: set[str]) -> None:
        """Ids that an earlier run of the same search has counted."""
        self._ids |= ids

    def _pose(self, report: Report) -> Pose | None:
        if report.pose is None:
            return self.pose_at(report.captured_at)
        own = report.pose
        return Pose(own.lat, own.lon, own.height_m, own.heading_deg, report.captured_at)

    def _hits(self, report: Report, footprint: Footprint) -> set[Cell]:
        """The cells of the footprint that a detection lies in, or next to (its position is not exact)."""
        if not report.detections or not len(footprint.cells):
            return set()
        points = np.array([[d.lat, d.lon] for d in report.detections])
        cells, _ = self.sensor.frame.locate(points)
        hits: set[Cell] = set()
        for cell in cells:
            gap = np.abs(footprint.cells - cell).max(axis=1)
            nearest = int(gap.argmin())
            if gap[nearest] <= 1:
                row, col = footprint.cells[nearest]
                hits.add((int(row), int(col)))
        return hits
