"""A detection that cannot be where its frame looks never turns the frame into a look in vain."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from roisearch import FieldOfView
from service.clock import Clock
from service.evidence.intake import Intake
from service.evidence.mask import Sensor
from service.evidence.moments import Moments
from service.evidence.observe import FramePose, Unreadable
from service.evidence.plausible import check_box
from service.evidence.reports import Report
from service.journal import Journal
from tests.service.reporting import FRAME, Ground

LAT, LON = (float(x) for x in FRAME.to_latlon([[3, 4]])[0])
HERE = FramePose(LAT, LON, 30.0, 0.0, 100.0)
NORTH_200_M = 200.0 / 111_195.0


@pytest.fixture
def make(tmp_path: Path) -> Callable[..., Intake]:
    def intake(pose: FramePose | None = HERE, **more: Any) -> Intake:
        sensor = Sensor(FRAME, FieldOfView.point(), 0.9, 0.9, 0.2, 0.8, 30.0, **more)
        journal = Journal(tmp_path / "j.sqlite")
        return Intake(Ground(), sensor, journal, Moments(Clock()), lambda _: pose, lambda *_: None)  # type: ignore[arg-type]

    return intake


def sent(intake: Intake, *detections: dict[str, Any], **more: Any) -> Any:
    report = {
        "id": f"r{time.perf_counter_ns()}",
        "captured_at": time.time(),
        "detections": detections,
        **more,
    }
    return asyncio.run(intake.submit(Report.model_validate(report)))


MISPLACED = [
    ({"lat": 0.0, "lon": 0.0}, "0/0 is what a camera without a position tells"),
    ({"lat": LON, "lon": LAT}, "are lat and lon swapped?"),
    ({"lat": LAT, "lon": -LON}, "has lon lost its sign"),
    ({"lat": -LAT, "lon": LON}, "has lat lost its sign"),
    ({"lat": LAT + NORTH_200_M, "lon": LON}, "lies 184 m from what its frame shows"),
    ({"lat": 90.0, "lon": 180.0}, "is it in WGS84 degrees"),
    ({"lat": LAT + NORTH_200_M, "lon": LON, "accuracy_m": 5.0}, "the heading and the camera's mounting"),
]


@pytest.mark.parametrize(("where", "words"), MISPLACED)
@pytest.mark.parametrize("beside", [[], [{"lat": LAT, "lon": LON}]])
def test_a_report_with_a_misplaced_detection_is_refused_whole_with_a_guess(
    make: Callable[..., Intake], where: dict[str, float], words: str, beside: list[dict[str, float]]
) -> None:
    intake = make()
    before = intake.search.belief.digest()
    receipt = sent(intake, where, *beside)
    assert (receipt.status, receipt.looks, receipt.hits) == ("refused", 0, 0)
    assert words in receipt.reason
    assert intake.search.belief.digest() == before
    assert words in intake.counts.last_refusal


@pytest.mark.parametrize("height_m", [12.0, 30.0])
@pytest.mark.parametrize("col", [4.0, 4.45])
def test_it_is_refused_from_wherever_the_frame_was_no_look_too(
    make: Callable[..., Intake], height_m: float, col: float
) -> None:
    lat, lon = (float(x) for x in FRAME.to_latlon([[3, col]])[0])
    assert sent(make(FramePose(lat, lon, height_m, 0.0, 100.0)), {"lat": 0.0, "lon": 0.0}).status == "refused"


def test_a_detection_in_the_footprint_or_beside_it_is_a_hit(make: Callable[..., Intake]) -> None:
    intake = make()
    for row, col in ((3.4, 4.4), (2.0, 4.0), (4.4, 4.9)):
        lat, lon = FRAME.to_latlon([[row, col]])[0].tolist()
        assert sent(intake, {"lat": lat, "lon": lon}).status == "accepted"
    assert intake.search.belief.probability()[3, 4] > 1 / 600


@pytest.mark.parametrize(
    ("pose", "more", "words"),
    [
        (FramePose(LAT, LON, 12.0, 0.0, 1.0), {}, "the aircraft was 9 m too low at 12 m"),
        (FramePose(LAT, LON, 92.0, 0.0, 1.0), {}, "the aircraft was 47 m too high at 92 m"),
        (FramePose(47.06, LON, 30.0, 0.0, 1.0), {}, "not over the grid"),
        (HERE, {"usable": False}, "usable is false"),
    ],
)
def test_a_receipt_says_why_its_frame_was_no_look(
    make: Callable[..., Intake], pose: FramePose, more: dict[str, Any], words: str
) -> None:
    intake = make(pose)
    receipt = sent(intake, **more)
    assert (receipt.status, receipt.looks) == ("accepted", 0)
    assert words in receipt.reason
    assert words in intake.counts.without_look


def test_a_second_frame_of_the_same_pass_shows_nothing_new(make: Callable[..., Intake]) -> None:
    intake = make()
    assert sent(intake).reason == ""
    receipt = sent(intake)
    assert (receipt.looks, receipt.reason.split(":")[0]) == (0, "shows nothing new")


@pytest.mark.parametrize(
    ("box", "words"),
    [
        ((0.4, 0.5, 0.45, 0.6), '"box_unit": "share"'),
        ((2000.0, 10.0, 2400.0, 60.0), "outside the image of 1920 x 1080"),
        ((10.0, 1200.0, 60.0, 1400.0), "sensor.image_width_px"),
        ((-500.0, 10.0, -300.0, 60.0), "outside the image"),
    ],
)
def test_a_box_that_is_no_box_of_pixels_in_the_image_is_refused(
    box: tuple[float, float, float, float], words: str
) -> None:
    with pytest.raises(Unreadable, match=words.replace("(", r"\(")):
        check_box(box, 1920, 1080)
    check_box((-3.0, -2.0, 40.0, 50.0), 1920, 1080)  # clipped at the border


def test_a_reports_own_pose_far_from_the_telemetry_is_refused(make: Callable[..., Intake]) -> None:
    there = {"lat": LAT + NORTH_200_M, "lon": LON, "height_m": 30.0, "heading_deg": 0.0}
    intake = make()
    assert "pose lies 200 m from where the telemetry" in sent(intake, pose=there).reason
    above_sea = {"lat": LAT, "lon": LON, "height_m": 480.0, "heading_deg": 0.0}
    assert "450 m above where the telemetry" in sent(intake, pose=above_sea).reason


@pytest.mark.parametrize(("up_m", "told_m", "status"), [(0.4, 30.0, "refused"), (30.0, 41.0, "accepted")])
def test_a_look_from_the_ground_is_no_look_from_above_it(
    make: Callable[..., Intake], up_m: float, told_m: float, status: str
) -> None:
    pose = {"lat": LAT, "lon": LON, "height_m": told_m, "heading_deg": 0.0}
    receipt = sent(make(FramePose(LAT, LON, up_m, 0.0, 100.0)), pose=pose)
    assert receipt.status == status
    assert ("m above where the telemetry has the aircraft" in receipt.reason) == (status == "refused")


def test_a_pose_of_its_own_is_believed_only_where_it_can_be_compared(make: Callable[..., Intake]) -> None:
    pose = {"lat": LAT, "lon": LON, "height_m": 30.0, "heading_deg": 0.0}
    intake = make(None)
    before = intake.search.belief.digest()
    receipt = sent(intake, pose=pose)
    assert (receipt.status, receipt.looks) == ("refused", 0)
    assert "no position of the aircraft is known and trusted" in receipt.reason
    assert intake.search.belief.digest() == before
    intake.placed = lambda: False  # an aircraft that tells none at all
    assert sent(intake, pose=pose).looks == 1


def test_a_sighting_in_a_frame_that_shows_nothing_is_told_to_who_sent_it(make: Callable[..., Intake]) -> None:
    intake = make()
    receipt = sent(intake, {"lat": LAT, "lon": LON}, usable=False)
    assert (receipt.status, receipt.hits) == ("accepted", 0)
    assert "its detections do not count" in receipt.reason
    assert "its detections" not in sent(intake, usable=False).reason


def test_only_the_classes_of_the_settings_are_hits(make: Callable[..., Intake]) -> None:
    intake, place = make(classes=frozenset({"person", "7"})), {"lat": LAT, "lon": LON}
    dog = sent(intake, {"class": "dog", **place})
    assert (dog.status, dog.hits) == ("accepted", 0)
    assert "dog: no class of the target" in dog.reason
    assert sent(intake, {"class": 7, **place}).hits == 1
    number = sent(intake, {"class": 3, **place})
    assert number.status == "refused"
    assert 'name the target\'s numbers there too, such as "0"' in number.reason


def test_without_classes_in_the_settings_whatever_is_detected_is_the_target(
    make: Callable[..., Intake],
) -> None:
    assert sent(make(), {"class": 3, "lat": LAT, "lon": LON}).hits == 1


def test_refusals_one_after_the_other_are_told_as_such_and_not_as_silence(
    make: Callable[..., Intake],
) -> None:
    intake = make()
    now = intake.clock.now
    assert intake.counts.silence(now(), 10.0) == "the detector is silent"
    for _ in range(3):
        sent(intake, {"lat": LON, "lon": LAT})
    assert intake.counts.silence(now(), 10.0).startswith(
        "reports are refused: detector: a detection at 8.296545"
    )
    assert intake.counts.silence(now() + 61.0, 10.0) == "the detector is silent"
