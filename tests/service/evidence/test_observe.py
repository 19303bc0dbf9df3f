"""From frames to looks: which cells a pose shows, one look per cell and pass, hits."""

from __future__ import annotations

import itertools
import json
from collections.abc import Collection

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from roisearch import Belief, FieldOfView
from service.area import GridFrame
from service.evidence.mask import Sensor
from service.evidence.observe import Footprint, FramePose, Observation, Reading, grid_heading, observe
from service.evidence.passes import Passes

CLOCK = itertools.count(100.0, 1.0 / 30.0)
FRAME = GridFrame(47.05, 8.30, 0.0, 25.0, 20, 30, -375.0, 250.0)


def sensor(fov: FieldOfView | None = None) -> Sensor:
    return Sensor(
        frame=FRAME,
        fov=fov or FieldOfView.point(),
        p_tp=0.9,
        p_tn=0.8,
        overlap=0.2,
        min_covered=0.8,
        height_m=30.0,
    )


def pose(row: float, col: float, height: float = 30.0, heading: float = 0.0) -> FramePose:
    lat, lon = FRAME.to_latlon([[row, col]])[0]
    return FramePose(float(lat), float(lon), height, heading, 0.0)


def look(
    s: Sensor, passes: Passes, where: FramePose, hits: Collection[tuple[int, int]] = ()
) -> Observation | None:
    """The next frame; a hit has the profile's likelihood ratio."""
    reading = Reading(s.footprint(where), dict.fromkeys(hits, 0.9 / (1.0 - 0.8)))
    return observe(passes, "camera", next(CLOCK), reading)


def test_a_frame_over_a_cells_centre_is_a_look_at_it() -> None:
    footprint = sensor().footprint(pose(3, 4))
    assert footprint.cells.tolist() == [[3, 4]]
    assert footprint.counts.tolist() == [True]
    assert footprint.covered.tolist() == [1.0]


@pytest.mark.parametrize("where", [pose(3, 4.45), pose(3.4, 4.4), pose(3, 4, height=12.0), pose(-3, 4)])
def test_a_frame_between_cells_or_too_low_or_off_the_grid_is_no_look(where: FramePose) -> None:
    assert not sensor().footprint(where).counts.any()


def test_a_forward_field_of_view_turns_with_the_nose_and_with_the_grid() -> None:
    assert grid_heading(90.0, 0.0) == "east"
    assert grid_heading(90.0, 80.0) == "north"
    assert grid_heading(350.0, 0.0) == "north"
    ahead = sensor(FieldOfView.wide_angle()).footprint(pose(10, 10, heading=180.0))
    assert ahead.cells[:, 0].min() > 10


def test_a_video_of_one_cell_clears_it_once() -> None:
    s, passes = sensor(), Passes()
    belief = Belief(np.ones(FRAME.shape))
    before = belief.probability()[3, 4]
    for _ in range(900):  # 30 seconds at 30 frames a second
        observation = look(s, passes, pose(3, 4))
        if observation is not None:
            belief.observe(observation.cells, observation.hits, observation.p_tp, observation.p_tn)
    odds = belief.probability()[3, 4] / before
    assert odds == pytest.approx(0.1 / 0.8, rel=0.01)


def test_a_second_pass_is_a_second_look() -> None:
    s, passes = sensor(), Passes()
    looks = 0
    for where in (pose(3, 4), pose(3, 5), pose(3, 4)):
        observation = look(s, passes, where)
        looks += 0 if observation is None else len(observation.cells)
    assert looks == 3


def test_hovering_at_the_limit_of_a_look_is_one_pass() -> None:
    s, passes = sensor(), Passes()
    looks = [look(s, passes, pose(3, 4 + wobble)) for wobble in (0.2, 0.33, 0.2, 0.36, 0.2)]
    assert not s.footprint(pose(3, 4.36)).counts.any()
    assert sum(look is not None for look in looks) == 1


def test_a_hit_later_in_the_pass_replaces_the_miss() -> None:
    s = sensor()
    late, at_once = Belief(np.ones(FRAME.shape)), Belief(np.ones(FRAME.shape))
    passes = Passes()
    for hits in ((), ((3, 4),), ()):
        o = look(s, passes, pose(3, 4), hits)
        if o is not None:
            late.observe(o.cells, o.hits, o.p_tp, o.p_tn)
    at_once.observe(np.array([[3, 4]]), np.array([True]), 0.9, 0.8)
    assert late.probability() == pytest.approx(at_once.probability(), rel=1e-12)


def test_a_turned_verdict_is_not_another_look() -> None:
    s, passes = sensor(), Passes()
    look(s, passes, pose(3, 4))
    turned = look(s, passes, pose(3, 4), {(3, 4)})
    assert turned is not None
    assert turned.first.tolist() == [False]


def test_an_observation_survives_the_journal_to_the_last_bit() -> None:
    s, passes = sensor(FieldOfView.donut()), Passes()
    observation = look(s, passes, pose(3, 4), {(2, 4)})
    assert observation is not None
    again = Observation.from_dict(json.loads(json.dumps(observation.to_dict())))
    for name in ("cells", "hits", "p_tp", "p_tn", "first"):
        assert np.array_equal(getattr(again, name), getattr(observation, name))


@given(st.lists(st.tuples(st.integers(0, 3), st.booleans(), st.booleans()), max_size=60))
def test_looks_are_at_most_one_per_visit(frames: list[tuple[int, bool, bool]]) -> None:
    passes = Passes()
    looks, visits, last = 0, 0, None
    for col, counts, hit in frames:
        covered = 1.0 if counts else 0.5
        footprint = Footprint.alike(np.array([[0, col]]), covered=covered, counts=counts, p_tp=0.9, p_tn=0.8)
        observation = observe(
            passes, "camera", next(CLOCK), Reading(footprint, {(0, col): 4.5} if hit else {})
        )
        looks += 0 if observation is None else int(observation.first.sum())
        visits += col != last
        last = col
    assert looks <= visits
