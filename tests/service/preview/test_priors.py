"""What the preview shows of several priors: each with its share, and that together they are what is searched by."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread

from service.area import build_grid, read_area
from service.preview.priors import added_up, draw_priors

EXPORT = Path(__file__).parents[1] / "area" / "exports" / "caltopo.json"


def test_priors_are_shown_one_by_one_and_added_up() -> None:
    area = read_area(EXPORT)
    grid = build_grid(area, 25.0)
    parts = added_up(area, grid)
    assert [sentence.split()[0] for sentence, _ in parts] == ["33%"] * 3
    assert [part.sum() for _, part in parts] == pytest.approx([1 / 3] * 3)
    assert np.sum([part for _, part in parts], axis=0) == pytest.approx(grid.prior)
    drawn = draw_priors(area, grid)
    assert [sentence for sentence, _ in drawn] == [*(sentence for sentence, _ in parts), "together"]
    assert all(imread(io.BytesIO(png)).shape[1] <= 780 for _, png in drawn), "each is of a phone's width"


def test_priors_that_a_raster_replaced_are_not_shown() -> None:
    area = read_area(EXPORT)
    grid = build_grid(area, 25.0).with_prior(np.ones((11, 13)))
    assert added_up(area, grid) == []
    assert draw_priors(area, grid) == []
