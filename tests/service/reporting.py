"""A process that takes reports in as fast as it can and tells what it has acknowledged, until it is killed."""

from __future__ import annotations

import asyncio
from multiprocessing.connection import Connection
from pathlib import Path

import numpy as np

from roisearch import Belief, FieldOfView
from roisearch.detection import DetectionRecord
from service.area import GridFrame
from service.clock import Clock
from service.evidence.intake import Intake
from service.evidence.mask import Sensor
from service.evidence.moments import Moments
from service.evidence.observe import FramePose, Observation
from service.evidence.reports import Detection, Report
from service.journal import Journal

FRAME = GridFrame(47.05, 8.30, 0.0, 25.0, 20, 30, -375.0, 250.0)


class Ground:
    """What a journal is retraced on: a belief and a record of looks."""

    aircraft = ""

    def __init__(self) -> None:
        self.believing = asyncio.Lock()
        self.belief = Belief(np.ones(FRAME.shape))
        self.record = DetectionRecord(np.ones(FRAME.shape))

    def redrawn(self, now: float) -> None:
        """Its regions stay as they are."""

    def take(self, said: Observation, time: float | None = None) -> None:
        """Update the belief; nobody judges here, and there is no news."""
        self.belief.observe(said.cells, said.hits, said.p_tp, said.p_tn)


def intake(path: Path, seed: int) -> Intake:
    """An intake beside an aircraft that is somewhere else at every moment."""
    rng = np.random.default_rng(seed)

    def pose_at(moment: float) -> FramePose:
        lat, lon = FRAME.to_latlon([rng.uniform((0, 0), (19, 29)).round()])[0]
        return FramePose(float(lat), float(lon), 30.0, 0.0, moment)

    sensor = Sensor(FRAME, FieldOfView.point(), 0.9, 0.9, 0.2, 0.8, 30.0)
    return Intake(Ground(), sensor, Journal(path), Moments(Clock()), pose_at, lambda *_: None)  # type: ignore[arg-type]


def report(number: int, captured_at: float) -> Report:
    """Report `number`; every fifth has a detection."""
    seen = (Detection(lat=47.05, lon=8.3),) if number % 5 == 0 else ()
    return Report(id=f"r{number}", captured_at=captured_at, detections=seen)


def run(path: str, seed: int, tell: Connection) -> None:
    """Take in batch after batch; tells (ids acknowledged, reports so far, the belief's digest) after each."""
    taker, rng = intake(Path(path), seed), np.random.default_rng(seed)

    async def work() -> None:
        number = 0
        while True:
            size = int(rng.integers(1, 9))
            batch = [report(number + each, taker.clock.now()) for each in range(size)]
            number += size
            receipts = await taker.submit_all(batch)
            accepted = [receipt.id for receipt in receipts if receipt.status == "accepted"]
            ground: Ground = taker.search  # type: ignore[assignment]
            tell.send((accepted, taker.accepted, ground.belief.digest()))

    asyncio.run(work())
