"""The camera's projection: cases worked by hand, and OpenCV as the outside judge."""

from __future__ import annotations

import math

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from service.camera import Flat, Pinhole, Sight, rotation, sight_from

CAMERA = Pinhole.of_angles(1920, 1080, 70.0)
HEIGHT = 60.0


def sight(yaw: float = 0.0, pitch: float = -90.0, roll: float = 0.0, camera: Pinhole = CAMERA) -> Sight:
    """A camera 60 m over the origin of a grid that points north."""
    return sight_from(camera, (0.0, 0.0, HEIGHT), rotation(yaw, pitch, roll))


def on_ground(seen: Sight, x: float, y: float, reach: float = 1e4) -> tuple[float, float]:
    """Where a pixel meets flat ground, as metres (north, east)."""
    ray = seen.rays([[x, y]])
    far = Flat().meet(seen.position, ray, reach)[0]
    east, south, up = seen.position + far * ray[0]
    assert up == pytest.approx(0.0, abs=1e-6)
    return -float(south), float(east)


def test_straight_down_the_image_is_a_rectangle_with_its_top_to_the_nose() -> None:
    half_width = HEIGHT * math.tan(math.radians(35.0))
    half_height = half_width * 1080 / 1920
    assert on_ground(sight(), 960, 540) == pytest.approx((0.0, 0.0), abs=1e-9)
    assert on_ground(sight(), 1920, 540) == pytest.approx((0.0, half_width))
    assert on_ground(sight(), 960, 0) == pytest.approx((half_height, 0.0), abs=1e-9)
    assert on_ground(sight(yaw=90.0), 960, 0) == pytest.approx((0.0, half_height), abs=1e-9)


def test_at_45_degrees_the_middle_lies_as_far_ahead_as_the_camera_is_high() -> None:
    seen = sight(pitch=-45.0)
    assert on_ground(seen, 960, 540) == pytest.approx((HEIGHT, 0.0))
    upper = math.atan(math.tan(math.radians(35.0)) * 1080 / 1920)
    assert on_ground(seen, 960, 0)[0] == pytest.approx(HEIGHT * math.tan(math.pi / 4 + upper))
    assert on_ground(seen, 960, 1080)[0] == pytest.approx(HEIGHT * math.tan(math.pi / 4 - upper))


def test_banked_to_the_right_a_camera_that_looks_down_sees_the_ground_on_the_left() -> None:
    body = rotation(0.0, 0.0, 20.0)
    seen = sight_from(CAMERA, (0.0, 0.0, HEIGHT), body @ rotation(0.0, -90.0, 0.0))
    north, east = on_ground(seen, 960, 540)
    assert north == pytest.approx(0.0, abs=1e-9)
    assert east == pytest.approx(-HEIGHT * math.tan(math.radians(20.0)))


def test_a_nose_that_is_up_tilts_a_fixed_camera_forward() -> None:
    body = rotation(0.0, 10.0, 0.0)
    seen = sight_from(CAMERA, (0.0, 0.0, HEIGHT), body @ rotation(0.0, -90.0, 0.0))
    assert on_ground(seen, 960, 540)[0] == pytest.approx(HEIGHT * math.tan(math.radians(10.0)))


def test_rays_at_the_horizon_and_above_meet_no_ground() -> None:
    seen = sight(pitch=-10.0)
    rays = seen.rays([[960, 0], [960, 540], [960, 1080]])
    far = Flat().meet(seen.position, rays, 1000.0)
    assert np.isnan(far[0])
    assert far[1] == pytest.approx(HEIGHT / math.sin(math.radians(10.0)))
    assert np.isfinite(far[2])
    assert np.isnan(Flat().meet(seen.position, rays[1:2], 300.0)[0])


def test_what_is_behind_the_camera_has_no_pixel() -> None:
    seen = sight(pitch=0.0)
    pixels, depth = seen.project([[0.0, 50.0, HEIGHT]])  # 50 m south of a camera that looks north
    assert depth[0] < 0.0
    assert np.isnan(pixels).all()
    assert not seen.in_image([[0.0, 50.0, HEIGHT]])[0]


angles = st.tuples(st.floats(0, 360), st.floats(-90, 0), st.floats(-60, 60))


@given(
    angles,
    st.lists(st.tuples(*[st.floats(-200, 200)] * 3), min_size=1, max_size=20),
    st.tuples(st.floats(300, 3000), st.floats(300, 3000), st.floats(100, 1800), st.floats(100, 1000)),
)
@settings(max_examples=60, deadline=None)
def test_the_projection_is_opencvs(
    turn: tuple[float, float, float], points: list[tuple[float, float, float]], lens: tuple[float, ...]
) -> None:
    fx, fy, cx, cy = lens
    seen = sight(*turn, camera=Pinhole(1920, 1080, fx, fy, cx, cy))
    world = np.array(points)
    pixels, depth = seen.project(world)
    ahead = depth > 1.0
    if not ahead.any():
        return
    # OpenCV's camera has x to the right of the image, y down and z ahead; its extrinsics turn the world into that
    ours = seen.axes[[1, 2, 0]]
    handed = ours * np.array(
        [1.0, 1.0, -1.0]
    )  # our third axis is up, which is left-handed with east and south
    rvec, _ = cv2.Rodrigues(handed)
    position = seen.position * np.array([1.0, 1.0, -1.0])
    intrinsics = np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
    judged, _ = cv2.projectPoints(
        world * np.array([1.0, 1.0, -1.0]), rvec, -handed @ position, intrinsics, None
    )
    assert pixels[ahead] == pytest.approx(judged.reshape(-1, 2)[ahead], rel=1e-6, abs=1e-3)


@given(angles, st.floats(0, 1920), st.floats(0, 1080))
@settings(max_examples=60, deadline=None)
def test_a_pixel_on_the_ground_projects_back_to_itself(
    turn: tuple[float, float, float], x: float, y: float
) -> None:
    seen = sight(*turn)
    ray = seen.rays([[x, y]])
    far = Flat().meet(seen.position, ray, 5000.0)[0]
    if np.isfinite(far):
        pixels, _ = seen.project(seen.position + far * ray)
        assert pixels[0] == pytest.approx([x, y], abs=1e-5)
