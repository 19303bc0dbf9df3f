"""The intake: on disk before it is believed or acknowledged, each report once."""

from __future__ import annotations

import asyncio
import sqlite3
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from roisearch import FieldOfView
from service.clock import Clock
from service.evidence.intake import ANOTHER_FRAME, Intake
from service.evidence.mask import Sensor
from service.evidence.moments import Moments
from service.evidence.observe import FramePose
from service.evidence.reports import Detection, Receipt, Report
from service.journal import Journal, JournalLost, read_rows
from tests.service.reporting import FRAME, Ground


def over(row: float, col: float) -> FramePose:
    lat, lon = FRAME.to_latlon([[row, col]])[0]
    return FramePose(float(lat), float(lon), 30.0, 0.0, 100.0)


HERE = over(3, 4)


@pytest.fixture
def make(tmp_path: Path) -> Callable[..., Intake]:
    def intake(pose: FramePose | None = HERE) -> Intake:
        sensor = Sensor(FRAME, FieldOfView.point(), 0.9, 0.9, 0.2, 0.8, 30.0)
        journal = Journal(tmp_path / "j.sqlite")
        return Intake(Ground(), sensor, journal, Moments(Clock()), lambda _: pose, lambda *_: None)  # type: ignore[arg-type]

    return intake


@pytest.fixture
def flying(make: Callable[..., Intake]) -> Callable[..., Intake]:
    """An intake beside an aircraft that crosses a column of row 3 every second, and has been doing so for 20 s."""

    def intake() -> Intake:
        taker = make()
        now = taker.clock.now()

        def pose_at(moment: float) -> FramePose | None:
            return over(3, round(20 + moment - now)) if now - 20.4 < moment <= now + 0.5 else None

        taker.pose_at = pose_at
        taker.moments.time_of_boot = lambda boot_s: now - 20.0 + boot_s if boot_s >= 0 else None
        return taker

    return intake


def frame(name: str, *, hit: bool = False, usable: bool = True) -> Report:
    detections = (Detection(lat=HERE.lat, lon=HERE.lon),) if hit else ()
    return Report(id=name, captured_at=time.time(), usable=usable, detections=detections)


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


def test_detectors_of_two_aircraft_that_count_alike_are_not_taken_for_one(
    make: Callable[..., Intake],
) -> None:
    sensor = Sensor(FRAME, FieldOfView.point(), 0.9, 0.9, 0.2, 0.8, 30.0)
    first = make()
    second = Intake(Ground(), sensor, first.journal, Moments(Clock()), lambda _: HERE, lambda *_: None)  # type: ignore[arg-type]
    intakes = [first, second]
    for name, intake in zip(("north", "south"), intakes, strict=True):
        intake.search.aircraft = name

    async def send() -> list[str]:
        receipts = [await intake.submit(frame("cam0-1")) for intake in (*intakes, *intakes)]
        return [receipt.status for receipt in receipts]

    assert asyncio.run(send()) == ["accepted", "accepted", "duplicate", "duplicate"]


def test_two_detectors_of_an_aircraft_that_count_alike_are_not_taken_for_one(
    make: Callable[..., Intake],
) -> None:
    intake = make()
    both = [frame("1").model_copy(update={"source": source}) for source in ("rgb", "thermal")]

    async def send() -> list[str]:
        return [(await intake.submit(each)).status for each in (*both, *both)]

    assert asyncio.run(send()) == ["accepted", "accepted", "duplicate", "duplicate"]
    assert intake.counts.refused == 0


def test_a_detector_that_counts_from_one_again_is_told_that_its_frames_are_lost(
    make: Callable[..., Intake],
) -> None:
    """Its id was known, and so was a hit thrown away: the page said that the detector was silent."""
    intake = make()

    async def send() -> list[Receipt]:
        first = [frame(str(number)) for number in range(3)]
        later = [each.model_copy(update={"captured_at": each.captured_at + 0.5}) for each in first]
        return await intake.submit_all([*first, *first, *later])

    receipts = asyncio.run(send())
    assert [each.status for each in receipts] == ["accepted"] * 3 + ["duplicate"] * 6
    assert [each.reason for each in receipts[3:]] == [""] * 3 + [ANOTHER_FRAME] * 3
    assert "every frame its own id" in intake.counts.silence(time.time(), 10.0)


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
    assert "no position of the aircraft is known and trusted for captured_at" in receipt.reason


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
    report = Report.model_validate({"id": "a", "captured_at": time.time(), **more})
    receipt = asyncio.run(intake.submit(report))
    assert receipt.status == "refused"
    assert words in receipt.reason
    assert intake.search.belief.digest() == before
    assert list(read_rows(intake.journal.path, "report")) == []


# ---- when it was captured


def ago(intake: Intake, name: str, seconds: float, **more: Any) -> Report:
    return Report(id=name, captured_at=intake.clock.now() - seconds, **more)


def test_a_late_report_is_applied_to_the_pose_it_was_captured_at(flying: Callable[..., Intake]) -> None:
    intake = flying()
    for name, seconds in (("now", 0.0), ("late", 8.0), ("later", 15.0)):
        assert asyncio.run(intake.submit(ago(intake, name, seconds))).looks == 1
    cells = [row.body["observation"]["cells"] for row in read_rows(intake.journal.path, "report")]
    assert cells == [[[3, 20]], [[3, 12]], [[3, 5]]]


def test_time_since_boot_is_translated(flying: Callable[..., Intake]) -> None:
    intake = flying()
    receipts = asyncio.run(
        intake.submit_all([Report(id=f"{s}", captured_at=s, clock="boot") for s in (7.0, -1.0)])
    )
    assert [receipt.status for receipt in receipts] == ["accepted", "refused"]
    assert "-1.000 s since boot" in receipts[1].reason
    (row,) = read_rows(intake.journal.path, "report")
    assert row.body["observation"]["cells"] == [[3, 7]]


@pytest.mark.parametrize(
    ("seconds", "words"),
    [(500.0, "500.0 s ago, and the telemetry is kept for 120 s"), (-30.0, "30.0 s in the future")],
)
@pytest.mark.parametrize("pose", [None, {"lat": 47.05, "lon": 8.3, "height_m": 30.0, "heading_deg": 0.0}])
def test_a_report_of_another_time_is_refused_with_the_reason(
    flying: Callable[..., Intake], seconds: float, words: str, pose: Any
) -> None:
    intake = flying()
    receipt = asyncio.run(intake.submit(ago(intake, "a", seconds, pose=pose)))
    assert receipt.status == "refused"
    assert words in receipt.reason
    assert intake.refused == 1


def test_what_waits_together_is_taken_in_in_the_order_of_capture(flying: Callable[..., Intake]) -> None:
    intake = flying()
    reports = [ago(intake, f"{seconds}", seconds) for seconds in (3.0, 9.0, 1.0, 6.0)]
    receipts = asyncio.run(intake.submit_all(reports))
    assert [receipt.id for receipt in receipts] == ["3.0", "9.0", "1.0", "6.0"]
    written = [row.body["report"]["id"] for row in read_rows(intake.journal.path, "report")]
    assert written == ["9.0", "6.0", "3.0", "1.0"]


def test_a_large_batch_is_written_whole_and_a_report_beside_it_does_not_wait_for_its_end(
    flying: Callable[..., Intake],
) -> None:
    intake = flying()
    order: list[str] = []

    async def send(name: str, reports: list[Report]) -> None:
        await intake.submit_all(reports)
        order.append(name)

    async def both() -> None:
        many = [ago(intake, f"{number}", 3.0 - number / 500) for number in range(500)]
        async with asyncio.TaskGroup() as group:
            group.create_task(send("batch", many))
            await asyncio.sleep(0)
            group.create_task(send("one", [ago(intake, "one", 4.0)]))

    asyncio.run(both())
    assert order == ["one", "batch"]
    assert len(list(read_rows(intake.journal.path, "report"))) == 501
    assert intake.accepted == 501


def test_a_flood_is_refused_in_words_and_not_kept(
    flying: Callable[..., Intake], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("service.evidence.intake.MOST_WAITING", 10)
    intake = flying()

    async def flood() -> list[str]:
        batches = await asyncio.gather(
            *(intake.submit_all([ago(intake, f"{b}-{i}", 1.0) for i in range(10)]) for b in range(3))
        )
        return [receipt.status for batch in batches for receipt in batch]

    assert asyncio.run(flood()) == ["accepted"] * 10 + ["refused"] * 20


def test_who_sent_what_broke_the_intake_hears_of_it_and_the_next_report_is_taken_in(
    flying: Callable[..., Intake],
) -> None:
    intake = flying()
    told, intake.told = intake.told, lambda *_: 1 / 0  # type: ignore[assignment]
    with pytest.raises(ZeroDivisionError):
        asyncio.run(intake.submit(ago(intake, "a", 1.0)))
    intake.told = told
    assert asyncio.run(intake.submit(ago(intake, "b", 2.0))).status == "accepted"


# ---- what one report must not cost the others


class Faulty:
    """A sensor that cannot work some reports out."""

    def __init__(self, sensor: Sensor, *faults: Exception) -> None:
        self._sensor, self._faults = sensor, dict(zip("xyz", faults, strict=False))

    def footprint(self, pose: FramePose) -> Any:
        return self._sensor.footprint(pose)

    def read(self, pose: FramePose, report: Report) -> Any:
        if report.id in self._faults:
            raise self._faults[report.id]
        return self._sensor.read(pose, report)


def test_a_report_that_cannot_be_worked_out_is_refused_alone(make: Callable[..., Intake]) -> None:
    intake = make()
    faults = (ZeroDivisionError("division by zero"), IndexError("axis 0"), ValueError("NaN"))
    intake.sensor = Faulty(intake.sensor, *faults)  # type: ignore[arg-type]
    reports = [frame("x"), frame("a", hit=True), frame("y"), frame("z")]
    receipts = {each.id: each for each in asyncio.run(intake.submit_all(reports))}
    assert [receipts[name].status for name in "axyz"] == ["accepted", "refused", "refused", "refused"]
    assert receipts["a"].hits == 1
    assert "cannot be worked out (ZeroDivisionError: division by zero)" in receipts["x"].reason
    assert [row.body["report"]["id"] for row in read_rows(intake.journal.path, "report")] == ["a"]


def test_after_any_fault_the_same_reports_count_when_they_are_sent_again(
    make: Callable[..., Intake], monkeypatch: pytest.MonkeyPatch
) -> None:
    intake, append_all = make(), Journal.append_all

    async def broken(self: Journal, rows: Any) -> list[bool]:
        raise RuntimeError("unexpected")

    monkeypatch.setattr(Journal, "append_all", broken)
    with pytest.raises(RuntimeError, match="unexpected"):
        asyncio.run(intake.submit(frame("a", hit=True)))
    monkeypatch.setattr(Journal, "append_all", append_all)
    receipt = asyncio.run(intake.submit(frame("a", hit=True)))
    assert (receipt.status, receipt.hits) == ("accepted", 1)


def test_one_batch_does_not_pass_the_limit_of_what_waits(
    make: Callable[..., Intake], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("service.evidence.intake.MOST_WAITING", 3)
    intake = make()
    old = Report(id="old", captured_at=1.0)
    receipts = asyncio.run(intake.submit_all([old, *(frame(f"{n}") for n in range(5))]))
    assert [each.status for each in receipts] == ["refused", *["accepted"] * 3, *["refused"] * 2]
    assert "more slowly" in receipts[-1].reason


def test_others_have_their_turns_while_a_costly_frame_is_worked_out(
    make: Callable[..., Intake], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Hundreds of detections in a camera's image take a second: the flight does not wait for them."""
    intake = make()
    read = intake.sensor.read

    def slowly(pose: FramePose, report: Report) -> Any:
        until = time.perf_counter() + 0.5
        while time.perf_counter() < until:
            pass
        return read(pose, report)

    monkeypatch.setattr(Sensor, "read", lambda self, pose, report: slowly(pose, report))

    async def beside() -> tuple[float, float]:
        """The longest that others waited, and how long the report took."""
        loop, longest = asyncio.get_running_loop(), 0.0
        began = last = loop.time()
        submitting = asyncio.create_task(intake.submit(frame("a")))
        while not submitting.done():
            await asyncio.sleep(0.001)
            longest, last = max(longest, loop.time() - last), loop.time()
        return longest, loop.time() - began

    longest, took = asyncio.run(beside())
    assert longest < took / 2
