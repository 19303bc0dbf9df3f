"""The intake: on disk before it is believed or acknowledged, each report once."""

from __future__ import annotations

import asyncio
import sqlite3
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from roisearch import Belief, FieldOfView
from roisearch.detection import DetectionRecord
from service.area import GridFrame
from service.clock import Clock
from service.evidence import Observation, Pose, Sensor
from service.intake import Intake, JournalLost
from service.journal import Journal, read_rows
from service.reports import Detection, Report

FRAME = GridFrame(47.05, 8.30, 0.0, 25.0, 20, 30, -375.0, 250.0)


class Ground:
    """What the intake needs of a search: something that an observation is applied to."""

    def __init__(self) -> None:
        self.belief = Belief(np.ones(FRAME.shape))
        self.record = DetectionRecord(np.ones(FRAME.shape))

    def apply(self, observation: Observation) -> None:
        self.belief.observe(observation.cells, observation.hits, observation.p_tp, observation.p_tn)


def over(row: float, col: float) -> Pose:
    lat, lon = FRAME.to_latlon([[row, col]])[0]
    return Pose(float(lat), float(lon), 30.0, 0.0, 100.0)


HERE = over(3, 4)


@pytest.fixture
def make(tmp_path: Path) -> Callable[..., Intake]:
    def intake(pose: Pose | None = HERE) -> Intake:
        sensor = Sensor(FRAME, FieldOfView.point(), 0.9, 0.9, 0.2, 0.8, 30.0)
        journal = Journal(tmp_path / "j.sqlite")
        return Intake(Ground(), sensor, journal, Clock(), lambda _: pose, lambda *_: None)  # type: ignore[arg-type]

    return intake


def frame(name: str, *, hit: bool = False, usable: bool = True) -> Report:
    detections = (Detection(lat=HERE.lat, lon=HERE.lon),) if hit else ()
    return Report(id=name, captured_at=100.0, usable=usable, detections=detections)


def test_a_report_is_on_disk_when_it_is_acknowledged(make: Callable[..., Intake]) -> None:
    intake = make()
    receipt = asyncio.run(intake.submit(frame("a", hit=True)))
    assert (receipt.status, receipt.looks, receipt.hits) == ("accepted", 1, 1)
    (row,) = read_rows(intake.journal.path, "report")
    assert row.body["observation"]["cells"] == [[3, 4]]


def test_the_same_report_sent_twice_at_once_is_counted_once(make: Callable[..., Intake]) -> None:
    intake = make()

    async def send() -> list[str]:
        receipts = await asyncio.gather(*(intake.submit(frame("a", hit=True)) for _ in range(5)))
        return sorted(receipt.status for receipt in receipts)

    assert asyncio.run(send()) == ["accepted"] + ["duplicate"] * 4
    assert intake.search.belief.probability()[3, 4] == pytest.approx(9 / (9 + 599))


def test_a_report_that_could_not_be_written_may_be_sent_again(make: Callable[..., Intake]) -> None:
    intake = make()
    with sqlite3.connect(intake.journal.path) as database:
        database.execute("ALTER TABLE events RENAME TO gone")
    for _ in range(2):
        with pytest.raises(JournalLost):
            asyncio.run(intake.submit(frame("a", hit=True)))
    assert intake.search.belief.probability()[3, 4] == pytest.approx(1 / 600)
    with sqlite3.connect(intake.journal.path) as database:
        database.execute("ALTER TABLE gone RENAME TO events")
    receipt = asyncio.run(intake.submit(frame("a", hit=True)))
    assert (receipt.status, receipt.hits) == ("accepted", 1)


def test_a_frame_of_an_unknown_time_is_refused_with_the_reason(make: Callable[..., Intake]) -> None:
    receipt = asyncio.run(make(None).submit(frame("a")))
    assert receipt.status == "refused"
    assert "captured_at 100.000" in receipt.reason


def test_an_unusable_frame_is_no_evidence(make: Callable[..., Intake]) -> None:
    intake = make()
    before = intake.search.belief.digest()
    assert asyncio.run(intake.submit(frame("a", usable=False))).looks == 0
    assert intake.search.belief.digest() == before


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({"detections": [{"box": [1, 2, 3, 4]}]}, "cannot place a pixel box"),
        ({"gimbal": {"pitch_deg": -30}}, "no use for a gimbal"),
        ({"footprint": [[47.0, 8.0], [47.0, 8.1], [47.1, 8.0]]}, "no use for a footprint"),
        ({"clock": "boot"}, "since boot"),
    ],
)
def test_what_cannot_be_interpreted_is_refused_with_the_reason_and_not_ignored(
    make: Callable[..., Intake], more: dict[str, Any], words: str
) -> None:
    intake = make()
    before = intake.search.belief.digest()
    report = Report.model_validate({"id": "a", "captured_at": 100.0, **more})
    receipt = asyncio.run(intake.submit(report))
    assert receipt.status == "refused"
    assert words in receipt.reason
    assert intake.search.belief.digest() == before
    assert list(read_rows(intake.journal.path, "report")) == []
