"""Ground that an exclusion cuts off: the part where the target may be by now is flown, and what is given up is said."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from service.area import build_grid, parse_area
from service.config import Settings
from service.errors import BadInput
from service.evidence.observe import Observation
from service.known import Withdrawn
from service.news.bearing import FieldNews
from service.news.request import NewsRequest
from service.search import Search
from tests.integration.flight import FIELD

GRID = build_grid(parse_area(json.dumps(FIELD).encode(), source="field"), 10.0)
MIDDLE = 8.3011
EAST = np.zeros(GRID.frame.shape, dtype=bool)
_cells = np.argwhere(GRID.flyable)
EAST[tuple(_cells.T)] = GRID.frame.to_latlon(_cells)[:, 1] > MIDDLE


def told(west: float, east: float, name: str = "wall") -> FieldNews:
    """An exclusion right across the field."""
    ring = [[west, 47.0498], [east, 47.0498], [east, 47.0516], [west, 47.0516], [west, 47.0498]]
    geometry: dict[str, Any] = {"type": "Polygon", "coordinates": [ring]}
    feature = {"type": "Feature", "geometry": geometry, "properties": {"role": "exclude"}}
    return NewsRequest.model_validate(feature).news(GRID, name)


WALL = told(MIDDLE - 5e-5, MIDDLE + 5e-5)


def looks(where: np.ndarray, times: int = 3) -> list[Observation]:
    """Looks in vain at all flyable cells of a part."""
    cells = np.argwhere(where & GRID.flyable)
    seen = np.full(len(cells), 0.9)
    one = Observation(cells, np.zeros(len(cells), dtype=bool), seen, seen, np.ones(len(cells), dtype=bool))
    return [one] * times


def search() -> Search:
    return Search(GRID, Settings.model_validate({"sensor": {"cell_m": 10}}))


def test_of_two_parts_the_one_stays_that_nobody_has_looked_at() -> None:
    fresh, looked = search(), search()
    fresh.take(WALL)
    for each in looks(EAST):
        looked.take(each)
    looked.take(WALL)
    assert (EAST[fresh.grid.flyable]).all()  # where nearly all of the prior is
    assert not EAST[looked.grid.flyable].any()
    (note,) = looked.grid.layout_notes[len(GRID.layout_notes) :]
    assert note.startswith(f"exclusions cut off ground around {looked.grid.cut_off}, where ")
    looked.take(Withdrawn("wall"))
    assert np.array_equal(looked.grid.flyable, GRID.flyable)
    assert looked.left_out == ""


def test_what_is_flown_is_the_same_whenever_it_is_asked_for() -> None:
    """A state that is gone back to has its ground anew, after what was seen since."""
    whole = search()
    whole.take(WALL)
    flown = whole.grid.flyable
    for each in looks(EAST):
        whole.take(each)
    whole.go_back(whole.known.copy())
    assert np.array_equal(whole.grid.flyable, flown)


def test_the_search_does_not_end_by_what_was_seen_of_ground_that_is_given_up() -> None:
    looked = search()
    for each in looks(EAST, 2):
        looked.take(each)
    looked.take(WALL)
    assert not EAST[looked.grid.flyable].any()
    assert looked.record.searched < looked.enough
    assert looked.over() == ""
    for each in looks(~EAST):
        looked.take(each)
    assert looked.over().startswith("searched to POS")
    assert looked.over().endswith(f", without the ground around {looked.grid.cut_off} that is cut off")


def test_of_several_exclusions_none_is_refused_for_a_part_that_another_one_gave_up() -> None:
    whole = search()
    whole.take(WALL)
    assert EAST[whole.grid.flyable].all()
    whole.take(told(MIDDLE, 8.3030, "the east"))
    assert not EAST[whole.grid.flyable].any()
    with pytest.raises(BadInput, match="leaves no cell"):
        whole.take(told(8.2998, MIDDLE, "the west"))
