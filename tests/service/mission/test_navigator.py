"""When the next waypoint goes out, and how far it reaches."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from roisearch import Motion
from roisearch.directions import DIRECTIONS, STEPS, direction_between
from roisearch.motion import Leg
from service.mission.navigator import Navigator, straight_part


def navigator(speed_mps: float = 8.0) -> Navigator:
    n = Navigator(Motion(cell_m=25.0, speed_mps=speed_mps, acceleration_mps2=2.0, corner_m=5.0), speed_mps)
    n.begin((10, 10), "east")
    return n


def test_a_path_straight_on_is_sent_before_the_aircraft_brakes() -> None:
    n = navigator()
    n.decide([(10, 11), (10, 12), (9, 12)])
    assert n.due(remaining_m=20.0, speed_mps=8.0) == Leg((10, 10), (10, 11), "east", 1)
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
    assert n.due(remaining_m=4.9, speed_mps=6.0) == Leg((10, 10), (9, 10), "north", 1)
    assert n.heading == "north"


def test_cells_in_one_line_become_one_target_when_the_aircraft_is_fast() -> None:
    n = navigator(speed_mps=14.0)
    n.decide([(10, 11), (10, 12), (10, 13), (10, 14), (11, 14)])
    assert n.due(remaining_m=2.0, speed_mps=14.0) == Leg((10, 10), (10, 13), "east", 3)
    assert n.ahead == ((10, 10), (10, 11), (10, 12), (10, 13))
    n.entered((10, 12))
    assert n.ahead == ((10, 12), (10, 13))


def test_a_leg_ends_where_it_would_pass_a_cell_in_vain() -> None:
    n = navigator(speed_mps=14.0)
    n.decide([(10, 11), (10, 12), (10, 13)], worth=frozenset({(10, 12), (10, 13), (4, 4)}))
    asked = []

    def shows(leg: Leg, passed: Sequence[tuple[int, int]]) -> bool:
        asked.append((leg.end, list(passed)))
        return (10, 12) not in passed

    assert n.due(2.0, 14.0, shows) == Leg((10, 10), (10, 12), "east", 2)
    assert asked == [((10, 13), [(10, 12)]), ((10, 12), [])]


def test_a_leg_is_not_led_on_past_a_waypoint_that_would_not_be_seen_then() -> None:
    n = navigator()
    n.decide([(10, 11)], worth=frozenset({(10, 11)}))
    assert n.due(20.0, 8.0) is not None
    n.decide([(10, 12)])
    n.entered((10, 11))
    assert not n.over(12.0, 8.0)
    assert n.due(12.0, 8.0, lambda leg, passed: (10, 11) not in passed) is None
    assert n.over(4.0, 6.0)
    assert n.due(4.0, 6.0, lambda leg, passed: (10, 11) not in passed) == Leg((10, 11), (10, 12), "east", 1)


def test_only_a_waypoint_that_is_worth_a_look_is_stood_over() -> None:
    n = navigator()
    n.decide([(10, 11)])
    n.due(2.0, 8.0)
    assert not n.over(2.0, 1.0)
    n.decide([(10, 12)], worth=frozenset({(10, 12)}))
    n.due(2.0, 1.0)
    assert n.over(2.0, 1.0)
    n.interrupt((10, 12), "east")
    assert not n.over(2.0, 1.0)


def test_a_hit_makes_the_next_decision_due_at_once_wherever_the_waypoint_is() -> None:
    n = navigator()
    n.decide([(10, 11)])
    n.interrupt((10, 8), "east")
    assert not n.decided
    assert n.wants_decision(remaining_m=500.0, thinking_s=0.0)
    n.decide([(10, 7)])
    assert n.due(remaining_m=500.0, speed_mps=8.0) == Leg((10, 8), (10, 7), "west", 1)


def test_a_hovering_aircraft_is_given_its_turn() -> None:
    n = navigator()
    n.decide([(9, 10)])
    assert n.due(remaining_m=6.0, speed_mps=0.1) == Leg((10, 10), (9, 10), "north", 1)


def test_a_leg_is_aimed_beyond_its_end_in_the_same_cell() -> None:
    n = navigator()
    for leg in (Leg((5, 5), (5, 9), "east", 4), Leg((5, 5), (3, 3), "north-west", 2)):
        row, col = n.aim(leg)
        beyond = (row - leg.end[0], col - leg.end[1])
        assert 25.0 * math.hypot(*beyond) == pytest.approx(0.45 * 25.0)
        assert (round(row), round(col)) == leg.end
    small = Navigator(Motion(cell_m=100.0), 8.0)
    row, col = small.aim(Leg((5, 5), (5, 9), "east", 4))
    assert (row, col) == (5.0, pytest.approx(9.13))  # and not farther than the fence leaves room for


def test_a_corner_that_was_passed_before_the_decision_came_is_turned_at_once() -> None:
    n = navigator()
    for remaining in (14.0, 8.0, 2.0, 4.0, 7.0):
        assert n.due(remaining, 6.0) is None
    n.decide([(9, 10)])
    assert n.due(9.0, 6.0) == Leg((10, 10), (9, 10), "north", 1)
    n.decide([(9, 9)])
    assert n.due(24.0, 6.0) is None  # on its way to the next corner


def test_a_path_that_jumps_is_refused() -> None:
    with pytest.raises(ValueError, match="not neighbours"):
        straight_part((0, 0), [(0, 1), (0, 3)])


def test_a_diagonal_line_becomes_one_leg_and_its_cells_are_longer() -> None:
    n = navigator(speed_mps=14.0)
    n.begin((10, 10), "north-east")
    n.decide([(9, 11), (8, 12), (7, 13), (6, 14), (5, 14)])
    assert n.due(remaining_m=2.0, speed_mps=14.0) == Leg((10, 10), (8, 12), "north-east", 2)
    assert n.heading == "north-east"


def test_a_softer_brake_that_was_learnt_sends_targets_farther_ahead() -> None:
    n = navigator()
    before = n.lead_m
    n.motion = replace(n.motion, braking_mps2=0.5)
    assert n.lead_m == pytest.approx(64.0 + 4.0)
    assert n.wants_decision(remaining_m=before + 10.0, thinking_s=0.0)
    n.decide([(10, 10 + i) for i in range(1, 9)])
    assert n.due(remaining_m=0.0, speed_mps=8.0) == Leg((10, 10), (10, 13), "east", 3)


@given(st.lists(st.sampled_from(STEPS), min_size=1, max_size=30), st.floats(0, 20), st.floats(0, 60))
def test_what_is_sent_is_always_a_straight_beginning_of_the_path(
    steps: list[tuple[int, int]], speed: float, remaining: float
) -> None:
    path, here = [], (50, 50)
    for row, col in steps:
        here = (here[0] + row, here[1] + col)
        path.append(here)
    n = Navigator(Motion(cell_m=25.0), 8.0)
    n.interrupt((50, 50), "north")
    n.decide(path)
    leg = n.due(remaining, speed)
    assert leg is not None
    sent = path[: path.index(leg.end) + 1]
    assert n.ahead == ((50, 50), *sent)
    assert {direction_between(a, b) for a, b in zip([(50, 50), *sent], sent, strict=False)} == {n.heading}
    assert n.heading in DIRECTIONS
    assert leg == Leg((50, 50), n.waypoint, n.heading, len(sent))


def test_a_weaker_braking_that_was_learnt_is_reckoned_with_and_a_harder_one_is_not() -> None:
    n, set_m = navigator(), navigator().lead_m
    n.learn(replace(n.motion, braking_mps2=0.5))
    assert n.lead_m > set_m + 40.0
    n.learn(replace(n.motion, braking_mps2=9.0))
    assert n.lead_m == pytest.approx(set_m)
