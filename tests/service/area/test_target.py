"""How the target moves, as an area file says it: taken, or refused with the one sentence that helps."""

from typing import Any

import pytest

from roisearch import Belief
from service.area import build_grid
from service.area.model import TargetMotion
from service.errors import BadInput
from tests.service.area.files import at, box, collection, feature, parse, point, polygon

BOX = box(-200, -200, 200, 200)


def area_with(target: Any) -> Any:
    return parse(feature(polygon(BOX), role="search", target=target))


def test_a_target_stands_still_unless_the_file_says_that_it_walks() -> None:
    assert parse(feature(polygon(BOX))).target is None
    assert build_grid(parse(feature(polygon(BOX))), 20.0).walk is None
    assert area_with({"moves": "still"}).target is None
    assert area_with(None).target is None


def test_a_target_walks_as_the_file_says_on_the_cells_of_the_grid() -> None:
    area = area_with({"moves": "walks", "speed_mps": 0.4, "stops_per_hour": 0.3})
    assert area.target == TargetMotion(0.4, 0.3)
    grid = build_grid(area, 20.0)
    assert grid.walk is not None
    assert (grid.walk.speed_mps, grid.walk.stops_per_hour, grid.walk.cell_m) == (0.4, 0.3, 20.0)
    belief = Belief(grid.prior, searchable=grid.searchable, walk=grid.walk)
    assert belief.drift(3600.0) > 0


def test_several_search_polygons_may_say_it_alike_and_not_differently() -> None:
    def two(first: Any, second: Any) -> Any:
        other = box(300, -200, 500, 200)
        return parse(
            collection(
                feature(polygon(BOX), role="search", target=first),
                feature(polygon(other), role="search", target=second),
            )
        )

    walks, runs = {"moves": "walks", "speed_mps": 0.4}, {"moves": "walks", "speed_mps": 2.0}
    assert two(walks, walks).target == two(walks, None).target == TargetMotion(0.4)
    with pytest.raises(BadInput, match="give it once"):
        two(walks, runs)


@pytest.mark.parametrize(
    ("target", "words"),
    [
        ("walks", 'write {"moves": "walks"'),
        ({}, "write 'still' or 'walks'"),
        ({"moves": "walk"}, "write 'still' or 'walks'"),
        ({"moves": "evades", "speed_mps": 1.0}, "a target that evades is out of scope"),
        ({"moves": "walks"}, "needs speed_mps"),
        ({"moves": "walks", "speed": 0.4}, "did you mean 'speed_mps'?"),
        ({"moves": "walks", "speed_mps": 0.4, "stop_per_hour": 1}, "did you mean 'stops_per_hour'?"),
        ({"moves": "walks", "speed_mps": 0.4, "colour": "red"}, "it has moves, speed_mps"),
        ({"moves": "walks", "speed_mps": 0}, "above 0 and up to 10"),
        ({"moves": "walks", "speed_mps": True}, "above 0 and up to 10"),
        ({"moves": "walks", "speed_mps": "fast"}, "above 0 and up to 10"),
        ({"moves": "walks", "speed_mps": 50}, "above 0 and up to 10"),
        ({"moves": "walks", "speed_mps": 0.4, "stops_per_hour": -0.1}, "at least 0 and up to 1000"),
        ({"moves": "walks", "speed_mps": 0.4, "straight_s": 0}, "above 0 and up to 3600"),
        ({"moves": "still", "speed_mps": 0.4}, "stands still has no other properties"),
    ],
)
def test_what_cannot_be_is_refused_in_one_sentence(target: Any, words: str) -> None:
    with pytest.raises(BadInput) as refused:
        area_with(target)
    message = str(refused.value)
    assert words in message
    assert message.startswith("field.geojson")
    assert "\n" not in message


def test_it_belongs_to_the_search_area() -> None:
    prior = feature(point(at(0, 0)), role="prior", sigma_m=30, target={"moves": "walks", "speed_mps": 1})
    with pytest.raises(BadInput, match="belongs to the search area"):
        parse(collection(feature(polygon(BOX), role="search"), prior))


def test_it_may_be_zero_stops() -> None:
    assert area_with({"moves": "walks", "speed_mps": 0.4, "stops_per_hour": 0}).target == TargetMotion(0.4)
