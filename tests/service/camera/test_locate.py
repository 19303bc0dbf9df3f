"""Where a pixel lies on the ground, how sure that is, and what it says about the cells."""

from __future__ import annotations

import math
import time

import numpy as np
import pyproj
import pytest

from roisearch import Belief, FieldOfView
from service.area import GridFrame
from service.camera import Errors, Flat, Pinhole, Sight, Spot, locate_pixel, rotation, sight_from, spread
from service.camera.locate import shares
from service.camera.sensor import CameraSensor, Mount
from service.config import Settings
from service.evidence.calibration import Calibration
from service.evidence.mask import Sensor
from service.evidence.observe import FramePose, Unreadable, observe
from service.evidence.passes import Passes
from service.evidence.reports import Gimbal, Report
from service.evidence.sensors import camera_sensor, cell_size, field_of_view

CAMERA = Pinhole.of_angles(1920, 1080, 70.0)
ERRORS = Errors(attitude_deg=1.5, position_m=2.0, height_m=2.0)
SETTINGS = Settings.model_validate(
    {
        "flight": {"altitude_m": 60},
        "sensor": {
            "profile": "camera",
            "horizontal_fov_deg": 70,
            "vertical_fov_deg": 43,
            "camera_pitch_deg": -60,
        },
    }
)
FRAME = GridFrame(47.05, 8.30, 20.0, cell_size(SETTINGS), 30, 30, -400.0, 400.0)
SENSOR = camera_sensor(SETTINGS, FRAME)


def sight(pitch: float) -> Sight:
    return sight_from(CAMERA, (0.0, 0.0, 60.0), rotation(0.0, pitch, 0.0))


def pose(row: float, col: float, **angles: float) -> FramePose:
    lat, lon = FRAME.to_latlon([[row, col]])[0]
    return FramePose(float(lat), float(lon), 60.0, 20.0, 0.0, **angles)


def report(*detections: dict[str, object], **more: object) -> Report:
    return Report.model_validate({"id": "a", "captured_at": 0.0, "detections": list(detections), **more})


def test_straight_down_the_error_is_the_same_both_ways() -> None:
    spot = locate_pixel(sight(-90.0), (960, 540), (2.0, 2.0), Flat(), ERRORS, 300.0)
    assert spot is not None
    per_pixel = 60.0 / CAMERA.fx
    wanted = 2.0**2 + (60.0 * math.tan(math.radians(1.5))) ** 2 + (2.0 * per_pixel) ** 2
    assert spot.covariance == pytest.approx(np.diag([wanted, wanted]), rel=1e-3, abs=1e-6)


def test_the_covariance_is_that_of_random_errors() -> None:
    rng = np.random.default_rng(3)
    seen = sight(-50.0)
    spot = locate_pixel(seen, (1400, 300), (3.0, 3.0), Flat(), ERRORS, 300.0)
    assert spot is not None
    ends = []
    for _ in range(4000):
        turned = rotation(*np.degrees(rng.normal(0.0, np.radians(1.5), 3)))
        moved = seen.position + np.array([*rng.normal(0.0, 2.0, 2), rng.normal(0.0, 2.0)])
        ray = Sight(CAMERA, moved, turned.T @ seen.axes).rays([rng.normal((1400, 300), 3.0)])
        ends.append((moved + Flat().meet(moved, ray, 1e4)[0] * ray[0])[:2])
    assert np.cov(np.array(ends).T) == pytest.approx(spot.covariance, rel=0.12, abs=1.5)
    assert np.mean(ends, axis=0) == pytest.approx(spot.point, abs=1.0)


def test_a_pixel_that_an_error_would_lift_over_the_horizon_is_nowhere() -> None:
    assert locate_pixel(sight(-1.0), (960, 540), (1.0, 1.0), Flat(), ERRORS, 1e5) is None
    assert locate_pixel(sight(20.0), (960, 540), (1.0, 1.0), Flat(), ERRORS, 300.0) is None
    assert locate_pixel(sight(-15.0), (960, 540), (1.0, 1.0), Flat(), ERRORS, 200.0) is None


def test_the_cells_of_a_spot_have_the_gaussians_mass() -> None:
    chances = spread(Spot(np.array([250.0, 255.0]), np.diag([100.0, 25.0])), 10.0)
    assert sum(chances.values()) == pytest.approx(1.0)
    phi = 0.5 * (1.0 + math.erf(1.0 / math.sqrt(2.0)))  # of one sigma
    row = sum(p for (r, _), p in chances.items() if r == 25)
    assert row == pytest.approx(2.0 * phi - 1.0, abs=0.02)
    exact = spread(Spot(np.array([255.0, 255.0]), np.zeros((2, 2))), 10.0)
    assert exact == {(25, 25): 1.0}


def test_a_box_says_the_same_as_its_own_projection_onto_the_ground() -> None:
    here = pose(15, 15)
    spot = SENSOR.spot(SENSOR.sight(here), report({"box": [900, 500, 920, 540]}).detections[0])
    assert spot is not None
    lat, lon = FRAME.from_metres(spot.point[None])[0]
    by_box = SENSOR.read(here, report({"box": [908, 518, 912, 522]})).hits
    by_place = SENSOR.read(here, report({"lat": lat, "lon": lon})).hits
    assert by_box == pytest.approx(by_place, rel=0.05)


def test_an_exact_detection_is_a_hit_of_its_cell_and_a_miss_elsewhere() -> None:
    footprint = SENSOR.footprint(pose(15, 15))
    row, col = footprint.cells[footprint.counts][0].tolist()
    i = next(i for i, cell in enumerate(footprint.cells.tolist()) if cell == [row, col])
    lat, lon = FRAME.to_latlon([[row, col]])[0]
    hits = SENSOR.read(pose(15, 15), report({"lat": lat, "lon": lon, "accuracy_m": 0.5})).hits
    assert hits == {(row, col): pytest.approx(footprint.p_tp[i] / (1.0 - footprint.p_tn[i]))}


def test_a_detection_that_the_image_cannot_show_is_refused_with_the_distance() -> None:
    lat, lon = FRAME.to_latlon([[28, 28]])[0]
    for told in ({"lat": lat, "lon": lon, "accuracy_m": 3.0}, {"lat": lat, "lon": lon}):
        with pytest.raises(
            Unreadable, match=r"lies 496 m from what its frame shows; are captured_at, the heading"
        ):
            SENSOR.read(pose(15, 15), report(told))


def test_a_hit_spread_over_cells_is_bayes_rule() -> None:
    """Against the definition: sum over the cell that the hit is really of, for every place of the target."""
    here = pose(15, 15)
    reading = SENSOR.read(here, report({"box": [1200, 500, 1300, 640]}))
    footprint = reading.footprint
    looked = footprint.counts
    cells = [(row, col) for row, col in footprint.cells[looked].tolist()]
    p_tp, p_tn = footprint.p_tp[looked], footprint.p_tn[looked]
    spot = SENSOR.spot(SENSOR.sight(here), report({"box": [1200, 500, 1300, 640]}).detections[0])
    assert spot is not None
    chances = spread(spot, FRAME.cell_m)
    assert len(chances) > 2
    prior = np.random.default_rng(1).random(FRAME.shape)
    prior /= prior.sum()

    def likelihood(target: tuple[int, int]) -> float:
        total = 0.0
        for really in cells:
            p = chances.get(really, 0.0)
            for i, cell in enumerate(cells):
                chance = p_tp[i] if cell == target else 1.0 - p_tn[i]
                p *= chance if cell == really else 1.0 - chance
            total += p
        return total

    exact = prior * np.array([[likelihood((r, c)) for c in range(30)] for r in range(30)])
    exact /= exact.sum()
    belief = Belief(prior)
    o = observe(Passes(), "camera", 0.0, reading)
    assert o is not None
    belief.observe(o.cells, o.hits, o.p_tp, o.p_tn)
    assert belief.probability() == pytest.approx(exact, rel=1e-9)


def test_shares_weigh_where_a_false_alarm_is_likely() -> None:
    cells = np.array([[0, 0], [0, 1]])
    share, inside = shares({(0, 0): 0.5, (0, 1): 0.25, (9, 9): 0.25}, cells, np.array([0.9, 0.8]))
    assert inside == pytest.approx(0.75)
    assert share == pytest.approx(np.array([0.5 / 9.0, 0.25 / 4.0]) / (0.5 / 9.0 + 0.25 / 4.0))


def test_a_gimbal_and_intrinsics_of_the_report_go_before_the_settings() -> None:
    down = SENSOR.read(pose(15, 15), report(gimbal={"pitch_deg": -90.0, "relative_to": "earth"})).footprint
    assert [15, 15] in down.cells[down.counts].tolist()
    ahead = SENSOR.footprint(pose(15, 15))
    assert [15, 15] not in ahead.cells[ahead.counts].tolist()
    narrow = {"width": 1920, "height": 1080, "horizontal_fov_deg": 20.0}
    assert len(SENSOR.read(pose(15, 15), report(intrinsics=narrow)).footprint.cells) < len(ahead.cells)


def test_attitude_turns_a_fixed_camera_and_not_a_stabilised_one() -> None:
    banked = pose(15, 15, roll_deg=25.0, pitch_deg=-5.0)
    assert np.array_equal(SENSOR.footprint(banked).cells, SENSOR.footprint(pose(15, 15)).cells)
    fixed = CameraSensor(**{**vars(SENSOR), "mount": Mount(-60.0, stabilised=False)})
    left, level = fixed.footprint(banked), fixed.footprint(pose(15, 15))
    assert left.cells[left.counts][:, 1].mean() < level.cells[level.counts][:, 1].mean() - 0.5


def test_a_camera_that_leans_with_the_aircraft_sees_nothing_while_nobody_knows_how_that_leans() -> None:
    """At 60 m the ground in view lay up to 20 m from where it was booked."""
    untold = pose(15, 15, roll_deg=math.nan, pitch_deg=math.nan)
    fixed = CameraSensor(**{**vars(SENSOR), "mount": Mount(-60.0, stabilised=False)})
    for seen in (
        fixed.footprint(untold),
        fixed.read(untold, report()).footprint,
        SENSOR.read(untold, report(gimbal={"pitch_deg": -60.0, "relative_to": "vehicle"})).footprint,
    ):
        assert not seen.counts.any()
        assert "leaned is not known" in seen.why_not
    assert SENSOR.footprint(untold).counts.any()
    assert SENSOR.read(
        untold, report(gimbal={"pitch_deg": -90.0, "relative_to": "earth"})
    ).footprint.counts.any()


def test_a_drawn_footprint_covers_what_it_covers() -> None:
    corners = FRAME.to_latlon([[9.5, 9.5], [9.5, 12.0], [11.5, 12.0], [11.5, 9.5]])
    seen = SENSOR.read(pose(15, 15), report(footprint=corners.tolist())).footprint
    got = {(r, c): v for (r, c), v in zip(seen.cells.tolist(), seen.covered.tolist(), strict=True)}
    assert got == pytest.approx(
        {(10, 10): 1.0, (10, 11): 1.0, (10, 12): 0.5, (11, 10): 1.0, (11, 11): 1.0, (11, 12): 0.5}, abs=1e-6
    )
    for crossed in ([[9, 9], [10, 10], [11, 11]], [[9, 9], [11, 11], [9, 11], [11, 9]]):
        with pytest.raises(Unreadable, match="not a polygon"):
            SENSOR.read(pose(15, 15), report(footprint=FRAME.to_latlon(crossed).tolist()))


@pytest.mark.parametrize(
    "corners",
    [
        [[-90, -180], [-90, 180], [90, 180], [90, -180]],
        [[47.0, 8.0], [47.1, 8.1], [47.2, -171.7]],
        [[-47.05, -171.7], [47.05, 8.3], [47.05, 8.301]],
    ],
)
def test_a_drawn_footprint_that_no_camera_sees_is_refused_at_once(corners: list[list[float]]) -> None:
    begun = time.perf_counter()
    with pytest.raises(Unreadable, match=r"more than 3000 m from the camera, 10 times sensor\.max_range_m"):
        SENSOR.read(pose(15, 15), report(footprint=corners))
    assert time.perf_counter() - begun < 1.0


def test_a_drawn_footprint_may_lie_across_the_date_line() -> None:
    frame = GridFrame(-17.0, 180.0, 0.0, FRAME.cell_m, 30, 30, -400.0, 400.0)
    there = CameraSensor(**{**vars(SENSOR), "frame": frame})
    corners = frame.to_latlon([[9.5, 9.5], [9.5, 20.5], [11.5, 20.5], [11.5, 9.5]])
    assert {-1.0, 1.0} == set(np.sign(corners[:, 1]).tolist())
    lat, lon = frame.to_latlon([[15, 15]])[0].tolist()
    begun = time.perf_counter()
    seen = there.read(FramePose(lat, lon, 60.0, 0.0, 0.0), report(footprint=corners.tolist())).footprint
    assert time.perf_counter() - begun < 1.0
    assert len(seen.cells) == 22
    assert seen.covered == pytest.approx(np.ones(22), abs=1e-6)


def test_the_planner_plans_with_the_best_row_of_a_pass() -> None:
    fov = field_of_view(SETTINGS, FRAME.cell_m)
    assert fov.offsets[0].tolist() == [[-1, -1], [-1, 0], [-1, 1]]
    assert fov.offsets[1].tolist() == [[-1, 1], [0, 1], [1, 1]]  # turned with the heading
    assert (fov.p_tp <= 0.9).all()
    assert fov.p_tp.min() > 0.85
    assert len(set(fov.offsets[0][:, 1].tolist())) == fov.offsets.shape[1]


def test_a_video_of_the_same_ground_clears_it_once_and_no_more_than_its_best_frame() -> None:
    """Thirty frames a second while the aircraft flies on: one look, worth the frame that shows the cell best."""
    belief, passes = Belief(np.ones(FRAME.shape)), Passes()
    before = belief.probability()
    best: dict[tuple[int, int], float] = {}
    for frame in range(300):
        reading = SENSOR.read(pose(20.0 - 0.01 * frame, 15.0), report())
        seen = reading.footprint
        for (row, col), counts, p_tp, p_tn in zip(
            seen.cells.tolist(), seen.counts.tolist(), seen.p_tp, seen.p_tn, strict=True
        ):
            if counts:
                ratio = (1.0 - p_tp) / p_tn
                best[row, col] = min(best.get((row, col), 1.0), ratio)
        o = observe(passes, "camera", frame / 30.0, reading)
        if o is not None:
            belief.observe(o.cells, o.hits, o.p_tp, o.p_tn)
    odds = belief.probability() / before
    odds /= odds[0, 0]  # never in view
    assert len(best) > 12
    for (row, col), ratio in best.items():
        assert odds[row, col] == pytest.approx(ratio, rel=0.03)  # and nothing like ratio ** 300


def test_hovering_gives_another_look_only_after_the_time_that_was_set() -> None:
    for again_s, looks in ((math.inf, 1), (10.0, 3)):
        passes = Passes(again_s=again_s)
        count = 0
        for frame in range(290):
            o = observe(passes, "camera", frame / 10.0, SENSOR.read(pose(15, 15), report()))
            count += 0 if o is None else [14, 15] in o.cells.tolist()
        assert count == looks


def test_an_accuracy_spreads_a_detection_in_every_profile() -> None:
    point = Sensor(FRAME, FieldOfView.from_mask(np.ones((3, 3))), 0.9, 0.9, 0.2, 0.8, 60.0)
    lat, lon = FRAME.to_latlon([[15.0, 15.5]])[0]  # between two cells
    spread_out = point.read(pose(15, 15), report({"lat": lat, "lon": lon, "accuracy_m": 3.0})).hits
    assert spread_out[15, 15] == pytest.approx(spread_out[15, 16], rel=0.03)
    assert spread_out[15, 15] == pytest.approx(0.5 * 9.0 + 0.5 / 9.0, rel=0.03)
    without = point.read(pose(15, 15), report({"lat": lat, "lon": lon})).hits
    assert list(without.values()) == [pytest.approx(9.0)]


def test_a_score_has_the_likelihood_ratio_of_the_calibration() -> None:
    calibrated = CameraSensor(
        **{**vars(SENSOR), "calibration": Calibration((0.2, 0.8), (0.0, math.log(50.0)))}
    )
    footprint = SENSOR.footprint(pose(15, 15))
    row, col = footprint.cells[footprint.counts][0].tolist()
    lat, lon = FRAME.to_latlon([[row, col]])[0]
    seen = {"lat": lat, "lon": lon, "accuracy_m": 0.5, "score": 0.8}
    assert calibrated.read(pose(15, 15), report(seen)).hits == {(row, col): pytest.approx(50.0)}
    roc = Calibration((0.2,), (math.log(4.0),), (0.2, 0.9), ((0.8, 0.8), (0.45, 0.99)))
    calibrated = CameraSensor(**{**vars(SENSOR), "calibration": roc})
    strict = calibrated.read(pose(15, 15), report(threshold=0.9)).footprint
    assert strict.p_tp == pytest.approx(0.5 * footprint.p_tp)
    assert 1.0 - strict.p_tn == pytest.approx(0.1 * (1.0 - footprint.p_tn))


def test_the_middle_of_the_image_lies_where_the_nose_points_on_the_globe() -> None:
    here = FramePose(*(float(x) for x in FRAME.to_latlon([[15, 15]])[0]), 60.0, 70.0, 0.0)
    ahead = report({"box": [958, 538, 962, 542]}, gimbal={"pitch_deg": -45.0})
    (seen,) = SENSOR.read(here, ahead).sightings
    azimuth, _, metres = pyproj.Geod(ellps="WGS84").inv(here.lon, here.lat, seen.lon, seen.lat)
    assert azimuth == pytest.approx(70.0, abs=0.1)
    assert metres == pytest.approx(60.0, abs=0.1)
    east = Gimbal(pitch_deg=-45.0, yaw_deg=90.0, relative_to="earth")
    ahead = report({"box": [958, 538, 962, 542]}, gimbal=east.model_dump())
    (seen,) = SENSOR.read(here, ahead).sightings
    azimuth, _, _ = pyproj.Geod(ellps="WGS84").inv(here.lon, here.lat, seen.lon, seen.lat)
    assert azimuth == pytest.approx(90.0, abs=0.1)
