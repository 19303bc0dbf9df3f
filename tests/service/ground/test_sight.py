"""What a camera that looks ahead sees over a ridge: the plan and the preview know what lies behind it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from service.area import Grid
from service.config import Settings
from service.ground.relief import Relief
from service.ground.sight import seen_share
from service.preview.foresight import foresee
from service.search import Search
from tests.service.mission.flown import GRID

STEP, AROUND = 5.0, 600.0


def settings_of(pitch: float, profile: str = "camera") -> Settings:
    sensor = {"cell_m": 20.0, "profile": profile, "camera_pitch_deg": pitch, "target_size_m": 2.0}
    return Settings.model_validate({"flight": {"altitude_m": 30.0}, "sensor": sensor})


def over(heights: Any) -> Grid:
    made = Relief(np.asarray(heights, dtype=np.float64), STEP, -AROUND, -AROUND, 5.0, 400.0)
    east, south = GRID.frame.to_metres([GRID.launch])[0]
    base = float(made.height_at(np.array([[east, south]]))[0])
    return replace(GRID, relief=replace(made, heights=made.heights - base))


def shaft() -> Grid:
    """A narrow shaft in the ground, from the cell (2, 9) down: to its floor only who stands above it sees."""
    heights = np.zeros((400, 400))
    middle = (np.array([9.5, 2.5]) * 20.0 + AROUND) / STEP
    col, row = (round(float(each)) for each in middle)
    heights[row - 1 : row + 2, col - 1 : col + 2] = -60.0
    return over(heights)


@pytest.mark.parametrize(("pitch", "profile"), [(-90.0, "camera"), (-45.0, "point")])
def test_straight_down_and_through_a_mask_everything_is_seen(pitch: float, profile: str) -> None:
    assert seen_share(shaft(), settings_of(pitch, profile)) is None
    assert Search(shaft(), settings_of(pitch, profile)).visibility is None


def test_on_level_ground_and_without_heights_everything_is_seen() -> None:
    assert seen_share(GRID, settings_of(-45.0)) is None
    assert seen_share(over(np.zeros((400, 400))), settings_of(-45.0)) is None


def test_the_floor_of_a_shaft_is_not_seen_and_what_is_around_it_is() -> None:
    share = seen_share(shaft(), settings_of(-45.0))
    assert share is not None
    assert share[2, 9] == 0.0
    assert share[4, 11] == 1.0


def test_behind_a_wall_a_cell_is_seen_from_the_other_side_alone() -> None:
    heights = np.zeros((400, 400))
    wall = round((100.0 + AROUND) / STEP)
    heights[:, wall - 1 : wall + 1] = 25.0  # along the border between two columns
    share = seen_share(over(heights), settings_of(-30.0))
    assert share is not None
    assert 0.0 < share[2, 4] < 1.0
    assert 0.0 < share[2, 5] < 1.0
    assert share[2, 11] == 1.0


def test_the_plan_and_the_preview_expect_nothing_of_what_is_not_seen() -> None:
    grid, settings = shaft(), settings_of(-45.0)
    search = Search(grid, settings)
    assert search.visibility is not None
    covered = Search(grid.under(np.full(grid.frame.shape, 0.5)), settings)
    assert covered.visibility is not None
    assert covered.visibility[2, 9] == 0.0
    assert covered.visibility[4, 11] == 0.5
    mass = float(search.belief.probability()[2, 9])
    foresee(search, grid.start, most_s=np.inf, until=1.0, most_steps=300, false_alarms=False,
            rng=np.random.default_rng(1))  # fmt: skip
    assert search.record.undetected()[2, 9] == pytest.approx(mass)  # no look at it counted
    assert search.record.undetected()[4, 11] < 0.2 * mass
