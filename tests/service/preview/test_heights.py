"""Ground and flight from the side, before the flight: in words, as a picture, and as the heights of a plan."""

from __future__ import annotations

import io
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from matplotlib.image import imread

from service.config import Settings
from service.errors import BadInput
from service.export.plan import heights_of
from service.ground.words import FLAT
from service.preview.heights import cover_facts, draw_sides, height_facts
from tests.service.mission.flown import GRID, place
from tests.service.mission.test_heights import ground_of, hill, settings_of

SETTINGS = Settings.model_validate({**settings_of().model_dump(), "ground": {"file": ["dem.tif"]}})


def seen_over(relief: Any, visibility: Any = None) -> Any:
    """As much of a preview as its heights need: a straight path through the field."""
    grid = replace(GRID, relief=relief, visibility=visibility)
    row, col = grid.start
    cells = tuple((row, col + i) for i in range(8))
    path = SimpleNamespace(cells=cells, seconds=np.arange(8) * 5.0)
    return SimpleNamespace(grid=grid, settings=SETTINGS, path=path)


def test_the_preview_says_how_near_to_the_ground_the_search_comes_and_draws_it() -> None:
    seen = seen_over(ground_of(4, 20.0))
    facts = height_facts(seen)
    assert [name for name, _ in facts] == ["ground", "clearance", "clearance"]
    assert "dem.tif" in facts[0][1]
    for _, said in facts[1:]:
        least = float(said.split(": ")[1].split(" m")[0])
        assert least >= SETTINGS.flight.clearance_m
    picture = draw_sides(seen)
    assert picture is not None
    assert imread(io.BytesIO(picture)).std() > 0.05


def test_without_a_ground_file_the_preview_says_that_it_is_taken_as_flat() -> None:
    seen = seen_over(None)
    assert height_facts(seen) == [("ground", FLAT)]
    assert draw_sides(seen) is None
    assert cover_facts(seen) == []


def test_what_cover_hides_is_told() -> None:
    visibility = np.where(np.indices(GRID.frame.shape)[1] < 5, 0.05, 1.0)
    ((name, said),) = cover_facts(seen_over(None, visibility))
    assert name == "cover"
    assert 0.1 < float(said.split(" finds ")[1].split("%")[0]) / 100.0 < 0.9


def test_the_heights_of_a_plan_clear_the_ground_and_lead_to_above_the_launch_point() -> None:
    route = [place(60.0, 20.0), place(220.0, 55.0)]
    run = SimpleNamespace(grid=replace(GRID, relief=hill(28.0, 190.0, 55.0)), settings=SETTINGS, name="a run")
    points, up = heights_of(run, route)  # type: ignore[arg-type]
    assert len(points) == len(up) - 1 > len(route)
    assert points[-1] == pytest.approx(GRID.launch)
    assert max(up) >= 28.0 + SETTINGS.flight.clearance_m
    assert up[0] == pytest.approx(SETTINGS.flight.altitude_m, abs=0.1)
    flat = SimpleNamespace(grid=GRID, settings=SETTINGS, name="a run")
    assert heights_of(flat, route) == (route, [30.0, 30.0, 30.0])  # type: ignore[arg-type]
    unknown = SimpleNamespace(
        grid=replace(GRID, relief=hill(float("nan"), 190.0, 55.0)), settings=SETTINGS, name="a run"
    )
    with pytest.raises(BadInput, match="whose height is not known"):
        heights_of(unknown, route)  # type: ignore[arg-type]
