"""The computer's clock steps: every frame is still put at the time at which it was taken, or refused."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import pytest

from roisearch import FieldOfView
from service.clock import Clock
from service.evidence.intake import Intake
from service.evidence.mask import Sensor
from service.evidence.moments import Moments
from service.evidence.observe import FramePose
from service.evidence.reports import Report
from service.evidence.timing import SourceClocks
from service.journal import Journal, read_rows
from tests.service.reporting import FRAME, Ground

YEAR_2026 = 1_767_225_600.0
DAYS_400 = 400 * 86_400.0


class Computer:
    """A computer whose clock somebody sets, and a service's clock on it."""

    def __init__(self) -> None:
        self.ticks, self.off = 5_000.0, 0.0
        self.clock = Clock(wall=self.wall, ticks=lambda: self.ticks)
        self.sources = SourceClocks(self.clock, 120.0)
        self.true_epoch = self.clock.now() - self.ticks

    def wall(self) -> float:
        return YEAR_2026 + self.ticks + self.off

    def error(self, source: str, told: float, taken_at_tick: float) -> float:
        """By how much the service is off when a report of a frame taken at a tick arrives now."""
        self.sources.measure()
        return self.sources.captured(source, told, self.clock.now()) - (self.true_epoch + taken_at_tick)


def heard_for_20_s(computer: Computer, *sources: str, late: float = 0.2) -> None:
    for _ in range(40):
        computer.ticks += 0.5
        for source in sources:
            assert computer.error(source, computer.wall() - late, computer.ticks - late) == pytest.approx(0.0)


@pytest.mark.parametrize("step", [DAYS_400, 3600.0, 45.0, 2.0, -2.0, -45.0, -3600.0, -DAYS_400])
def test_a_step_of_the_clock_moves_no_frame_of_a_detector_on_this_computer(step: float) -> None:
    computer = Computer()
    heard_for_20_s(computer, "cam")
    computer.off += step
    heard_for_20_s(computer, "cam")
    computer.off -= step
    heard_for_20_s(computer, "cam")


@pytest.mark.parametrize("step", [DAYS_400, 45.0, -45.0])
def test_it_moves_no_frame_of_a_detector_whose_clock_has_not_stepped(step: float) -> None:
    computer = Computer()
    heard_for_20_s(computer, "here", "elsewhere")
    computer.off += step
    for _ in range(400):
        computer.ticks += 0.5
        assert computer.error("here", computer.wall() - 0.2, computer.ticks - 0.2) == pytest.approx(0.0)
        elsewhere = computer.wall() - step - 0.3
        assert computer.error("elsewhere", elsewhere, computer.ticks - 0.3) == pytest.approx(0.0)


@pytest.mark.parametrize("step", [DAYS_400, 45.0, -45.0])
def test_frames_that_were_on_their_way_at_the_step_keep_their_time(step: float) -> None:
    computer = Computer()
    heard_for_20_s(computer, "cam", late=3.0)
    waiting = [(computer.wall() - 0.5 * n, computer.ticks - 0.5 * n) for n in range(6)][::-1]
    computer.off += step
    for told, tick in waiting:
        computer.ticks += 0.5
        assert computer.error("cam", told, tick) == pytest.approx(0.0)
    heard_for_20_s(computer, "cam", late=3.0)


@pytest.mark.parametrize("outage", [5.0, 45.0, 100.0])
@pytest.mark.parametrize("step", [45.0, -45.0])
def test_an_outage_long_after_a_step_is_no_step(step: float, outage: float) -> None:
    computer = Computer()
    heard_for_20_s(computer, "cam")
    computer.off += step
    for _ in range(5):
        heard_for_20_s(computer, "cam")
    waiting = [(computer.wall() + 0.5 * n, computer.ticks + 0.5 * n) for n in range(int(2 * outage))]
    computer.ticks += outage
    for told, tick in waiting:
        assert computer.error("cam", told, tick) == pytest.approx(0.0)
    heard_for_20_s(computer, "cam")


def test_a_slewed_clock_is_followed_and_is_no_step() -> None:
    computer = Computer()
    for _ in range(20):
        computer.off += 0.2
        assert computer.sources.measure() == 0.0
        heard_for_20_s(computer, "cam")
    assert computer.sources.wall_ahead == pytest.approx(4.0, abs=0.02)


def test_a_step_is_noticed_told_and_journalled_before_the_report_that_it_moves(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    computer = Computer()
    journal = Journal(tmp_path / "j.sqlite")
    lat, lon = FRAME.to_latlon([[3, 4]])[0].tolist()
    asked: list[float] = []

    def pose_at(moment: float) -> FramePose:
        asked.append(moment - computer.true_epoch)
        return FramePose(lat, lon, 30.0, 0.0, moment)

    sensor: Any = Sensor(FRAME, FieldOfView.point(), 0.9, 0.9, 0.2, 0.8, 30.0)
    intake = Intake(Ground(), sensor, journal, Moments(computer.clock), pose_at, lambda *_: None)  # type: ignore[arg-type]
    for number in range(4):
        computer.ticks += 1.0
        computer.off -= 45.0 * (number == 2)
        report = Report(id=f"{number}", captured_at=computer.wall() - 0.25)
        assert asyncio.run(intake.submit(report)).status == "accepted"
        assert asked[-1] == pytest.approx(computer.ticks - 0.25)
    rows = list(read_rows(journal.path))
    assert [row.kind for row in rows] == ["clock", "report", "report", "clock", "report", "report"]
    assert rows[3].body["step_s"] == pytest.approx(-45.0)
    assert "set back by 45.0 s" in intake.moments.last_step
    assert "set back by 45.0 s" in caplog.text


def test_a_source_whose_clock_stands_still_is_refused_and_told(tmp_path: Path) -> None:
    computer = Computer()
    lat, lon = FRAME.to_latlon([[3, 4]])[0].tolist()
    here = FramePose(lat, lon, 30.0, 0.0, 0.0)
    sensor: Any = Sensor(FRAME, FieldOfView.point(), 0.9, 0.9, 0.2, 0.8, 30.0)
    journal = Journal(tmp_path / "j.sqlite")
    intake = Intake(Ground(), sensor, journal, Moments(computer.clock), lambda _: here, lambda *_: None)  # type: ignore[arg-type]
    stuck, receipts = computer.wall(), []
    for number in range(12):
        computer.ticks += 0.5
        told = {"still": stuck, "moving": computer.wall()}
        batch = [Report(id=f"{name}{number}", source=name, captured_at=at) for name, at in told.items()]
        receipts.append(asyncio.run(intake.submit_all(batch)))
    assert {moving.status for _, moving in receipts} == {"accepted"}
    assert [still.status for still, _ in receipts] == ["accepted"] * 6 + ["refused"] * 6
    assert "stands still" in receipts[-1][0].reason
    assert "stands still" in intake.counts.last_refusal
