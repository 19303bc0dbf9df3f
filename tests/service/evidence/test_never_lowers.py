"""A true detection never lowers its own cell, whatever shape its report has; it may be refused or count for nothing."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from roisearch import Belief, FieldOfView
from service.camera import Detectability, Errors, Flat, Pinhole
from service.camera.sensor import CameraSensor, Mount
from service.evidence.mask import Sensor
from service.evidence.observe import FramePose, Unreadable, observe
from service.evidence.passes import Passes
from service.evidence.reports import Report
from tests.service.reporting import FRAME

PROFILES: dict[str, Any] = {
    "point": Sensor(FRAME, FieldOfView.point(), 0.9, 0.9, 0.2, 0.8, 30.0),
    "donut": Sensor(FRAME, FieldOfView.donut(), 0.7, 0.6, 0.2, 0.8, 30.0),
    "wide": Sensor(FRAME, FieldOfView.from_mask(np.ones((5, 5))), 0.9, 0.9, 0.2, 0.8, 30.0),
    "ahead": Sensor(FRAME, FieldOfView.wide_angle(), 0.9, 0.9, 0.2, 0.8, 30.0, sigma_m=3.0),
    "camera": CameraSensor(
        FRAME, Flat(), Pinhole.of_angles(1920, 1080, 90.0), Mount(-60.0), Detectability(0.9, 0.9, 8.0, 17.0, 0.2),
        0.9, 0.8, 300.0, 10.0, Errors(1.5, 2.0, 2.0),
    ),
}  # fmt: skip
SHARES = st.floats(0.0, 1.0)


def told(profile: Any, pose: FramePose, target: np.ndarray, shape: dict[str, Any]) -> dict[str, Any] | None:
    """The detection of a target at (row, col), in pixels or in degrees; None where no image shows it."""
    lat, lon = FRAME.to_latlon([target - 0.5])[0].tolist()
    if not shape["box"] or not isinstance(profile, CameraSensor):
        more = {"accuracy_m": shape["accuracy_m"]} if shape["accuracy_m"] else {}
        return {"lat": lat, "lon": lon, **more}
    sight = profile.sight(pose)
    there = np.array([[*FRAME.to_metres([[lat, lon]])[0], 0.0]])
    if not sight.in_image(there)[0]:
        return None
    x, y = sight.project(there)[0][0].tolist()
    return {"box": [x - 9.0, y - 12.0, x + 9.0, y + 12.0]}


@given(
    name=st.sampled_from(sorted(PROFILES)),
    place=st.tuples(st.floats(6.0, 14.0), st.floats(8.0, 22.0)),
    off=st.tuples(st.floats(-4.0, 4.0), st.floats(-4.0, 4.0)),
    pose=st.tuples(st.floats(5.0, 80.0), st.one_of(st.floats(0.0, 360.0), st.just(math.nan))),
    shape=st.fixed_dictionaries(
        {"box": st.booleans(), "accuracy_m": st.one_of(st.none(), st.floats(0.5, 10_000.0))}
    ),
    others=st.lists(st.tuples(SHARES, SHARES), max_size=3),
    before=st.booleans(),
)
def test_a_true_detection_never_lowers_its_own_cell(
    name: str,
    place: tuple[float, float],
    off: tuple[float, float],
    pose: tuple[float, float],
    shape: dict[str, Any],
    others: list[tuple[float, float]],
    before: bool,
) -> None:
    profile, target = PROFILES[name], np.array(place) + np.array(off)
    assume(np.abs(target - np.round(target)).min() > 1e-6)  # on a border either cell is its own, by rounding
    lat, lon = FRAME.to_latlon([np.array(place) - 0.5])[0].tolist()
    here = FramePose(lat, lon, pose[0], pose[1], 1.0)
    assume(math.isfinite(here.heading_deg) or not shape["box"])
    seen = told(profile, here, target, shape)
    assume(seen is not None)
    row, col = np.floor(target).astype(int).tolist()
    beside = [
        {"lat": float(a), "lon": float(b)}
        for a, b in (FRAME.to_latlon([np.array(place) + np.array(each) * 2.0 - 1.5])[0] for each in others)
    ]
    belief, passes = Belief(np.ones(FRAME.shape)), Passes()

    def look(time: float, detections: list[Any]) -> None:
        report = Report.model_validate({"id": f"{time}", "captured_at": time, "detections": detections})
        try:
            observation = observe(passes, "cam", time, profile.read(here, report))
        except Unreadable:
            return
        if observation is not None:
            belief.observe(observation.cells, observation.hits, observation.p_tp, observation.p_tn)

    if before:
        look(1.0, [])
    prior = belief.weights.reshape(FRAME.shape)[row, col]
    look(2.0, [seen, *beside])
    assert belief.weights.reshape(FRAME.shape)[row, col] >= prior * (1.0 - 1e-9)


@pytest.mark.parametrize("accuracy_m", [30.0, 300.0, 10_000.0])
def test_a_detection_that_is_surer_to_be_in_view_than_where_lowers_no_cell_it_points_at(
    accuracy_m: float,
) -> None:
    lat, lon = FRAME.to_latlon([[10.0, 10.0]])[0].tolist()
    seen = {"lat": lat, "lon": lon, "accuracy_m": accuracy_m}
    report = Report.model_validate({"id": "a", "captured_at": 1.0, "detections": [seen]})
    assert PROFILES["wide"].read(FramePose(lat, lon, 30.0, 0.0, 1.0), report).hits[10, 10] >= 1.0
