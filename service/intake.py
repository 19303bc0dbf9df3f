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

from service.clock import Clock
from service.evidence import Observation, Passes, Pose, Unreadable, observe
from service.journal import Duplicate, Journal
from service.reports import Receipt, Report
from service.search import Search
from service.sensors import Profile

PoseAt = Callable[[float], Pose | None]


class JournalLost(RuntimeError):
    """The journal cannot be written: nothing may be believed or acknowledged any more."""


@dataclass
class Intake:
    """Where reports go in. `pose_at` looks a capture time up in the telemetry; `told` is called after each
    applied observation with the time (perf_counter) at which its report arrived."""

    search: Search
    sensor: Profile
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
        try:
            pose = self._pose(report)
            reading = self.sensor.read(pose, report)
        except Unreadable as why:
            self.refused += 1
            return Receipt(id=report.id, status="refused", reason=str(why))
        written = self._pending[report.id] = asyncio.Event()
        passes_before = dict(self.passes.verdict)
        observation = observe(self.passes, reading) if report.usable else None
        body = {
            "report": report.model_dump(by_alias=True),
            "pose": [pose.lat, pose.lon, pose.height_m, pose.heading_deg, pose.pitch_deg, pose.roll_deg],
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

    def _pose(self, report: Report) -> Pose:
        """Where the frame was taken: as the report says, else as the telemetry of that time; raises Unreadable."""
        own, when = report.pose, report.captured_at
        if report.clock == "boot":
            raise Unreadable("the autopilot's time since boot cannot be told in this service's clock")
        known = self.pose_at(when)
        if own is None:
            if known is None:
                raise Unreadable(
                    f"no position of the aircraft is known and trusted for captured_at {when:.3f}"
                )
            return known
        pitch, roll = (known.pitch_deg, known.roll_deg) if known else (0.0, 0.0)
        pitch = own.pitch_deg if own.pitch_deg is not None else pitch
        roll = own.roll_deg if own.roll_deg is not None else roll
        return Pose(own.lat, own.lon, own.height_m, own.heading_deg, when, pitch, roll)
