"""When the next waypoint goes out, and how far it reaches."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from service.mission.navigator import HEADING, Navigator, heading_between, straight_part


def navigator(speed_mps: float = 8.0) -> Navigator:
    n = Navigator(cell_m=25.0, speed_mps=speed_mps, deceleration_mps2=2.0, corner_m=5.0)
    n.begin((10, 10), "east")
    return n


def test_a_path_straight_on_is_sent_before_the_aircraft_brakes() -> None:
    n = navigator()
    n.decide([(10, 11), (10, 12), (9, 12)])
    assert n.due(remaining_m=20.0, speed_mps=8.0) == (10, 11)
    assert n.waypoint == (10, 11)


def test_the_next_decision_is_made_before_a_fast_aircraft_would_brake() -> None:
    n = navigator(speed_mps=8.0)
    assert n.wants_decision(remaining_m=n.lead_m, thinking_s=0.0)
    assert n.wants_decision(remaining_m=n.lead_m + 12.0, thinking_s=1.0)
    assert not n.wants_decision(remaining_m=n.lead_m + 12.0, thinking_s=0.0)


def test_a_turn_waits_until_the_corner() -> None:
    n = navigator()
    n.decide([(9, 10), (8, 10)])
    assert n.due(remaining_m=20.0, speed_mps=8.0) is None
    assert n.due(remaining_m=4.9, speed_mps=6.0) in {(9, 10), (8, 10)}
    assert n.heading == "north"


def test_cells_in_one_line_become_one_target_when_the_aircraft_is_fast() -> None:
    n = navigator(speed_mps=14.0)
    n.decide([(10, 11), (10, 12), (10, 13), (10, 14), (11, 14)])
    assert n.due(remaining_m=2.0, speed_mps=14.0) == (10, 13)
    assert n.ahead == ((10, 10), (10, 11), (10, 12), (10, 13))
    n.entered((10, 12))
    assert n.ahead == ((10, 12), (10, 13))


def test_a_hit_makes_the_next_decision_due_at_once_wherever_the_waypoint_is() -> None:
    n = navigator()
    n.decide([(10, 11)])
    n.interrupt((10, 8), "east")
    assert not n.decided
    assert n.wants_decision(remaining_m=500.0, thinking_s=0.0)
    n.decide([(10, 7)])
    assert n.due(remaining_m=500.0, speed_mps=8.0) == (10, 7)


def test_a_hovering_aircraft_is_given_its_turn() -> None:
    n = navigator()
    n.decide([(9, 10)])
    assert n.due(remaining_m=6.0, speed_mps=0.1) == (9, 10)


def test_a_path_that_jumps_is_refused() -> None:
    with pytest.raises(ValueError, match="not neighbours"):
        straight_part((0, 0), [(0, 1), (0, 3)])


@given(
    st.lists(st.sampled_from(sorted(HEADING)), min_size=1, max_size=30), st.floats(0, 20), st.floats(0, 60)
)
def test_what_is_sent_is_always_a_straight_beginning_of_the_path(
    steps: list[tuple[int, int]], speed: float, remaining: float
) -> None:
    path, here = [], (50, 50)
    for row, col in steps:
        here = (here[0] + row, here[1] + col)
        path.append(here)
    n = Navigator(cell_m=25.0, speed_mps=8.0, deceleration_mps2=1.5, corner_m=5.0)
    n.interrupt((50, 50), "north")
    n.decide(path)
    target = n.due(remaining, speed)
    assert target in path
    sent = list(n.ahead[1:])
    assert sent == path[: len(sent)]
    assert {heading_between(a, b) for a, b in zip([(50, 50), *sent], sent, strict=False)} == {n.heading}
