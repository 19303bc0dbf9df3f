"""Where the nose points is not always known: then the course is taken, or masks that need no heading, or nothing."""

from __future__ import annotations

import math

import numpy as np
import pytest

from roisearch import FieldOfView
from service.camera import Detectability, Errors, Flat, Pinhole
from service.camera.sensor import CameraSensor, Mount
from service.evidence.mask import Sensor
from service.evidence.observe import FramePose, heading_or_course
from service.evidence.receipts import said_of
from service.evidence.reports import Report
from tests.service.reporting import FRAME

LAT, LON = (float(x) for x in FRAME.to_latlon([[8, 9]])[0])
NOWHERE = FramePose(LAT, LON, 30.0, math.nan, 1.0)
FRAME_1 = Report.model_validate({"id": "a", "captured_at": 1.0})


def mask(fov: FieldOfView) -> Sensor:
    return Sensor(FRAME, fov, 0.9, 0.9, 0.2, 0.8, 30.0)


CAMERA = CameraSensor(
    FRAME, Flat(), Pinhole.of_angles(1920, 1080, 90.0), Mount(-60.0), Detectability(0.9, 0.9, 8.0, 17.0, 0.2),
    0.9, 0.8, 300.0, 10.0, Errors(1.5, 2.0, 2.0),
)  # fmt: skip


@pytest.mark.parametrize(
    ("north", "east", "course"), [(5.0, 0.0, 0.0), (0.0, 5.0, 90.0), (-3.0, -3.0, 225.0)]
)
def test_an_aircraft_that_moves_is_taken_to_point_where_it_flies(
    north: float, east: float, course: float
) -> None:
    assert heading_or_course(math.nan, north, east) == pytest.approx(course)
    assert heading_or_course(17.0, north, east) == 17.0


@pytest.mark.parametrize("speed", [0.0, 1.0, math.nan])
def test_one_that_stands_or_whose_speed_is_unknown_points_nowhere_known(speed: float) -> None:
    assert math.isnan(heading_or_course(math.nan, speed, 0.0))


def test_masks_that_are_the_same_from_every_side_need_no_heading() -> None:
    assert mask(FieldOfView.point()).footprint(NOWHERE).cells.tolist() == [[8, 9]]
    ring = mask(FieldOfView.donut()).footprint(NOWHERE)
    assert len(ring.cells) == 8
    assert ring.counts.all()
    lopsided = np.zeros((3, 3))
    lopsided[0, 1] = lopsided[1, 1] = 1.0  # its own cell, and the one ahead
    assert mask(FieldOfView.from_mask(lopsided)).footprint(NOWHERE).cells.tolist() == [[8, 9]]


def test_what_looks_ahead_sees_nothing_and_the_receipt_says_why() -> None:
    for sensor, words in (
        (mask(FieldOfView.wide_angle()), "this sensor looks ahead"),
        (CAMERA, "turns with it"),
    ):
        assert not sensor.footprint(NOWHERE).counts.any()
        reading = sensor.read(NOWHERE, FRAME_1)
        assert not reading.hits
        assert words in said_of(FRAME_1, reading, 0, 0)


def test_a_gimbal_that_knows_north_needs_no_heading() -> None:
    told = {
        "id": "a",
        "captured_at": 1.0,
        "gimbal": {"pitch_deg": -60.0, "yaw_deg": 90.0, "relative_to": "earth"},
    }
    assert CAMERA.read(NOWHERE, Report.model_validate(told)).footprint.counts.any()


def test_an_outline_of_the_sender_needs_no_heading() -> None:
    corners = FRAME.to_latlon([[6.5, 7.5], [6.5, 10.5], [9.5, 10.5], [9.5, 7.5]]).tolist()
    told = {"id": "a", "captured_at": 1.0, "footprint": corners, "detections": [{"lat": LAT, "lon": LON}]}
    reading = CAMERA.read(NOWHERE, Report.model_validate(told))
    assert reading.footprint.counts.any()
    assert (8, 9) in reading.hits
