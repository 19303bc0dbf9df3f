"""Who judges whether aircraft have come too near, and that it can find them guilty."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from sim.autopilot.process import AutopilotProcess
from sim.flights_together import TROUBLES, JointOutcome, Together, told
from sim.separation import Separation, Watching, side_by_side

HOME = (47.05, 8.3)


def state(east_m: float, up: float, landed: str = "IN_AIR") -> dict[str, Any]:
    """What a control socket says of an aircraft so far east of home."""
    ((lat, _), (_, lon)) = side_by_side(HOME, 2, east_m)
    return {"latitude": lat, "longitude": lon, "up": up, "landed": landed, "mode": "GUIDED", "time": 7.0}


@pytest.mark.parametrize(
    ("other", "guilty"),
    [
        (state(19.0, 30.0), True),
        (state(21.0, 30.0), False),
        (state(0.0, 36.0), True),
        (state(0.0, 37.0), False),
        (state(0.0, 0.0, "ON_GROUND"), False),
    ],
)
def test_two_in_the_air_must_be_apart_on_the_ground_or_in_height(other: dict[str, Any], guilty: bool) -> None:
    judge = Separation()
    judge.see({"1": state(0.0, 30.0), "2": other, "3": state(500.0, 30.0)})
    assert bool(judge.violations) == guilty
    if guilty:
        assert judge.violations[0].startswith("aircraft 1 and 2 were ")


def test_one_encounter_is_one_violation_and_the_next_one_another() -> None:
    judge = Separation()
    for metres in (60.0, 15.0, 10.0, 15.0, 60.0, 12.0):
        judge.see({"1": state(0.0, 30.0), "2": state(metres, 30.0)})
    assert len(judge.violations) == 2
    assert judge.nearest_m == pytest.approx(10.0, rel=0.01)
    assert judge.together == 6


@pytest.mark.parametrize(("speed", "guilty"), [(0.2, False), (3.0, True)])
def test_beside_one_that_somebody_else_flies_the_other_has_to_stand_soon(speed: float, guilty: bool) -> None:
    judge = Separation()
    judge.taken = frozenset({"1"})
    for now in (0.0, 5.0, 9.0):
        here = {"time": now, "speed": 5.0}
        judge.see({"1": state(0.0, 30.0) | here, "2": state(15.0, 30.0) | {"time": now, "speed": speed}})
        assert bool(judge.violations) == (guilty and now > 8.0)


@pytest.mark.parametrize("between", [{"up": 60.0}, {"landed": "ON_GROUND"}])
def test_each_encounter_has_a_grace_of_its_own(between: dict[str, Any]) -> None:
    judge = Separation()
    judge.taken = frozenset({"1"})
    for now, apart in ((0.0, {}), (5.0, between), (60.0, {}), (69.0, {})):
        here = {"time": now, "speed": 3.0}
        judge.see({"1": state(0.0, 30.0) | here, "2": state(15.0, 30.0) | here | apart})
        assert bool(judge.violations) == (now > 68.0)


@pytest.mark.parametrize(("then", "guilty"), [(14.5, False), (13.0, True)])
def test_who_is_given_back_too_near_to_another_one_comes_no_nearer(then: float, guilty: bool) -> None:
    judge = Separation()
    judge.taken = frozenset({"1"})
    judge.see({"1": state(0.0, 30.0), "2": state(15.0, 30.0)})
    judge.taken = frozenset()
    judge.see({"1": state(0.0, 30.0), "2": state(then, 30.0)})
    assert bool(judge.violations) == guilty
    judge.see({"1": state(0.0, 30.0), "2": state(50.0, 30.0)})
    judge.see({"1": state(0.0, 30.0), "2": state(15.0, 30.0)})
    assert len(judge.violations) == guilty + 1  # apart once, they stay so


def test_who_has_flown_on_between_two_answers_is_judged_by_where_it_surely_was() -> None:
    """On a busy machine the second is asked late: by then the first has flown from 40 m away to 10 m beyond it."""
    judge = Separation()
    judge.see(
        {"1": state(0.0, 30.0), "2": state(40.0, 30.0)}, {"1": state(50.0, 30.0), "2": state(80.0, 30.0)}
    )
    assert judge.violations == []
    judge.see(
        {"1": state(0.0, 30.0), "2": state(12.0, 30.0)}, {"1": state(18.0, 30.0), "2": state(80.0, 30.0)}
    )
    assert len(judge.violations) == 1
    assert judge.nearest_m == pytest.approx(12.0, rel=0.01)
    judge.see({"1": state(0.0, 20.0), "2": state(5.0, 30.0)}, {"1": state(0.0, 29.0), "2": state(5.0, 30.0)})
    assert len(judge.violations) == 1  # it was still well below


def test_the_truth_is_asked_of_the_mocks_themselves() -> None:
    options = ["--control", "127.0.0.1:0"]
    with (
        AutopilotProcess("px4", options=options) as one,
        AutopilotProcess("ardupilot", options=options) as two,
    ):
        judge = Separation()
        with Watching({"1": str(one.control), "2": str(two.control)}, judge) as watching:
            while not watching.last:
                time.sleep(0.01)
        assert {state["landed"] for state in watching.last.values()} == {"ON_GROUND"}
        assert judge.together == 0


SEARCH = Together(Path("demo.geojson"), 3, 2, True, 10.0, 60.0)


def flown(**changes: Any) -> JointOutcome:
    """A search with several aircraft that went well, but for what is changed."""
    usual = {"code": 0, "report": {"outcome": "found"}, "together": 9, "cut": "3", "error_cells": 0.4}
    return JointOutcome(SEARCH, **{**usual, **changes})


@pytest.mark.parametrize(
    ("changes", "good"),
    [
        ({}, True),
        ({"code": 3}, False),
        ({"violations": ["aircraft 1 and 2 were 3.0 m apart"]}, False),
        ({"together": 0}, False),  # nobody was ever near anybody, because they did not fly
        ({"cut": ""}, False),
        ({"error_cells": 2.0}, False),
        ({"wrong": ["the service has ended while aircraft 1 fly"]}, False),
    ],
)
def test_a_search_together_is_good_when_it_is_found_and_nobody_came_too_near(
    changes: dict[str, Any], good: bool
) -> None:
    one = flown(**changes)
    assert one.good == good
    assert all(each in told(one) for each in [*one.violations, *one.wrong])


def test_every_trouble_befalls_one_by_the_seed_and_is_told() -> None:
    drawn = [replace(SEARCH, seed=seed) for seed in range(1, 21)]
    assert {each.trouble_kind for each in drawn} == set(TROUBLES)
    assert replace(SEARCH, trouble=False).trouble_kind == ""
    assert told(flown()).endswith(f"aircraft 3: {SEARCH.trouble_kind}")
