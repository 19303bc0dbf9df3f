"""The search of a run: which planner it has, and what it learns in flight."""

from __future__ import annotations

import asyncio
import threading
from concurrent.futures import wait
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from roisearch import Decision, Motion, SearchState
from roisearch.directions import DIRECTIONS, direction_between
from roisearch.motion_fit import Flown
from roisearch.planners.base import Planner
from roisearch.planners.lookahead.planner import LookaheadPlanner
from roisearch.planners.tour.planner import TourPlanner
from service.config import MOCK_SPEEDUP, PlannerName, Settings
from service.evidence.observe import Observation
from service.geometry import Cell
from service.known import Judgement, Known
from service.mission.energy import Left
from service.motion import MotionLimits
from service.search import GETS_READY_S, Search
from tests.service.mission.flown import CELL_M, GRID


def search(profile: str = "point", **changes: Any) -> Search:
    """A search of the soak's field."""
    settings = {"sensor": {"cell_m": CELL_M, "profile": profile}, "search": changes}
    return Search(GRID, Settings.model_validate(settings))


def test_the_default_counts_seconds_where_one_cell_is_seen_and_steps_where_several_are() -> None:
    point, donut = search(iterations=3, looks_ahead=500), search("donut")
    assert isinstance(point.planner, TourPlanner)
    assert (point.planner.settings.iterations, point.planner.settings.looks) == (3, 500)
    assert point.currency() == "in seconds of flight, to eight neighbours"
    assert isinstance(donut.planner, LookaheadPlanner)
    assert donut.currency() == "in steps, to four neighbours, as the sensor sees several cells at once"


@pytest.mark.parametrize("name", PlannerName.__args__)  # type: ignore[attr-defined]
def test_every_planner_that_can_be_set_decides(name: str) -> None:
    built = search(planner=name)
    decision = asyncio.run(built.decide(SearchState(GRID.start, "north-east", 5.0), ()))
    assert direction_between(GRID.start, decision.path[0]) in DIRECTIONS


def test_a_motion_that_was_learnt_is_what_the_planner_reckons_with_from_then_on() -> None:
    built = search()
    built.warm_up()
    first = asyncio.run(built.decide(SearchState(GRID.start), ()))
    slow = Motion(cell_m=CELL_M, speed_mps=5.0, acceleration_mps2=1.0, corner_m=5.0)
    rng, path, here = np.random.default_rng(1), [(0, 0)], 2
    while len(path) < 100:
        down, right = ((-1, 0), (0, 1), (1, 0), (0, -1))[here // 2]
        path += [(path[-1][0] + i * down, path[-1][1] + i * right) for i in range(1, int(rng.integers(2, 6)))]
        here = (here + int(rng.choice([2, 6]))) % 8
    flown = Flown(path[0], "east", path[1:], slow.arrivals(path[1:], path[0], "east", 5.0))
    built.learn([flown]).result(timeout=180.0)
    took = slow.arrivals(path[1:], path[0], "east", 5.0)[-1]
    assert built.as_set.arrivals(path[1:], path[0], "east", 5.0)[-1] < 0.9 * took
    assert built.motion.arrivals(path[1:], path[0], "east", 5.0)[-1] == pytest.approx(took, rel=0.03)
    assert isinstance(built.planner, TourPlanner)
    # what its kernels are handed is told nowhere, and is what counts
    assert built.planner._desk.prices.axis[0] == pytest.approx(CELL_M / built.motion.speed_mps)
    again = asyncio.run(built.decide(SearchState(GRID.start), ()))
    assert direction_between(GRID.start, again.path[0]) in DIRECTIONS
    assert again.value < first.value  # the same search takes longer


def test_what_the_parameters_of_the_aircraft_allow_is_what_the_planner_reckons_with(
    caplog: pytest.LogCaptureFixture,
) -> None:
    built = search()
    built.warm_up()
    before = asyncio.run(built.decide(SearchState(GRID.start), ()))
    built.limit(MotionLimits(100.0, 10.0))
    assert built.motion.speed_mps == 8.0
    assert not caplog.records
    built.limit(MotionLimits(4.0, None))
    after = asyncio.run(built.decide(SearchState(GRID.start), ()))
    assert built.motion.speed_mps == 4.0
    assert after.value < before.value  # the same search takes longer
    assert [record.message for record in caplog.records] == [
        "by its parameters the aircraft flies at most 4 m/s, not flight.speed_mps = 8: the plan reckons with that"
    ]
    built.motion = learnt = Motion(cell_m=CELL_M, speed_mps=3.0)
    built.limit(MotionLimits(2.0, None))
    assert built.motion is learnt  # what it does says more than what it may
    assert built.as_set.speed_mps == 2.0


def test_of_two_limits_that_come_while_the_planner_thinks_the_second_counts() -> None:
    built, done = search(), threading.Event()
    built._thread.submit(done.wait)  # nothing public keeps it thinking for so long
    built.limit(MotionLimits(5.0, None))
    built.limit(MotionLimits(3.0, None))
    done.set()
    asyncio.run(built.decide(SearchState(GRID.start), ()))
    assert built.motion.speed_mps == 3.0
    assert isinstance(built.planner, TourPlanner)
    # what its kernels are handed is told nowhere, and is what counts
    assert built.planner._desk.prices.axis[0] == pytest.approx(CELL_M / 3.0)


def test_the_default_plans_the_end_of_a_battery_and_another_planner_does_not() -> None:
    """With two minutes left and the way home from the far side of the field: what is decided can still be flown."""
    for name, planned in (("puct-regions-lite", True), ("survey", False)):
        built = search(planner=name, deadline_s=5.0)  # a busy machine may think less in a shorter one
        far = (0, GRID.frame.cols - 1)
        long = Left(5000.0, 5000.0, 30.0, 20.0, GRID.launch)
        home_s = float(built.reach.endurance(long).home_s[far])
        left = Left(home_s + 120.0, home_s + 120.0, home_s, 20.0, GRID.launch)
        decision = asyncio.run(built.decide(SearchState(far, "west", 8.0), (), left))
        assert ("the end of the battery" in decision.remark) is planned
        assert (
            built.expected_s is not None and built.expected_s > 10.0
        ) is planned  # seconds, not what it will find
        calm = asyncio.run(built.decide(SearchState(far, "west", 8.0), (), long))
        assert "the end of the battery" not in calm.remark
        if planned:
            times = built.motion.arrivals(decision.path, far, "west", 8.0)
            endurance = built.reach.endurance(left)
            late = [t + endurance.home_s[c] for t, c in zip(times, decision.path, strict=True)]
            assert max(late) <= endurance.remaining_s + 1e-9


def test_a_plan_for_the_next_flight_is_ready_when_the_aircraft_is(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is left may take much longer to plan than the whole area did."""
    given: list[float | None] = []
    plan = TourPlanner.plan

    def asked(*args: Any, **more: Any) -> Decision:
        given.append(more.get("deadline_s"))
        return plan(*args, **more)

    built = search(iterations=0)
    monkeypatch.setattr(TourPlanner, "plan", asked)
    built.replan()
    asyncio.run(built.decide(SearchState(GRID.start), ()))
    assert given[0] == pytest.approx(GETS_READY_S / MOCK_SPEEDUP)


def test_a_plan_for_the_next_flight_is_as_good_as_a_first_one() -> None:
    """Made in the planner's thread: the decision that is asked for next waits for it."""
    built = search(iterations=0)
    built.warm_up()
    rng = np.random.default_rng(1)
    path = built.planner.plan(built.belief, SearchState(GRID.start), rng).path
    built.belief.observe(list(path), False, 0.9, 0.9)  # the flight ends far from where it began
    built.replan()
    decision = asyncio.run(built.decide(SearchState(GRID.start), ()))
    first = search(iterations=0)
    first.belief.observe(list(path), False, 0.9, 0.9)
    first.warm_up()
    fresh = first.planner.plan(first.belief, SearchState(GRID.start), rng)
    assert decision.value == pytest.approx(fresh.value, rel=0.05)


def test_what_is_told_of_a_find_is_worked_out_once_for_each_word(monkeypatch: pytest.MonkeyPatch) -> None:
    """It goes through every cell that was looked at, and the mission asks ten times a second, on the way home too."""
    asked: list[Cell] = []
    it, cells = search(), np.argwhere(GRID.searchable)
    hit = Observation(cells[5:6], *(np.array([value]) for value in (True, 0.99, 0.999, True)))
    why_not = it.known.alarms.why_not
    monkeypatch.setattr(it.known.alarms, "why_not", lambda place: asked.append(place) or why_not(place))
    for _ in range(4):
        it.take(hit)
    first = it.found()
    assert first is not None
    assert all(it.found() is first for _ in range(20))
    assert len(asked) == 1
    it.take(hit)
    second = it.found()
    assert second is not None
    assert second.probability > first.probability
    assert len(asked) == 2
    other = (int(cells[40, 0]), int(cells[40, 1]))
    it.take(
        Judgement(other, Observation(cells[40:41], hit.hits, hit.p_tp, hit.p_tn, hit.first), confirmed=True)
    )
    confirmed = it.found()
    assert confirmed is not None
    assert (confirmed.lat, confirmed.lon) != (second.lat, second.lon)
    it.take(hit)
    again = it.found()
    assert again is not None
    assert again.probability < confirmed.probability


@pytest.mark.parametrize("what", ["there is none yet", "all is worth something else"])
def test_a_plan_that_was_made_in_a_hurry_is_made_again_beside_the_flight(what: str) -> None:
    """A clue or an exclusion leaves a decision's deadline for what took seconds on the ground."""
    built = search(deadline_s=0.02)
    state = SearchState(GRID.start, "north", 8.0)
    if what.startswith("all"):
        built.warm_up()
        asyncio.run(built.decide(state, ()))
        told = Known(GRID, 0.9, 0.9)
        told.belief.observe(
            [(row, col) for row, col in np.argwhere(GRID.searchable) if row % 3], False, 0.7, 0.9
        )
        built.go_back(told)
    hasty = built.planner
    first = asyncio.run(built.decide(state, ()))
    asyncio.run(built.decide(state, ()))  # which waits for nothing
    assert built.drafting.under_way is not None
    built.drafting.under_way.result(timeout=60.0)
    path = first.path[:4]
    then = SearchState(path[-1], direction_between(path[-2], path[-1]), 8.0)
    after = asyncio.run(built.decide(then, path))
    assert built.planner is built.ending.planner is not hasty
    assert direction_between(then.cell, after.path[0]) in DIRECTIONS
    drafted = built.planner
    for _ in range(3):
        asyncio.run(built.decide(then, path))
    assert built.planner is drafted  # it is as good as it gets
    assert built.drafting.under_way is None


def test_a_plan_for_ground_that_is_another_one_by_now_is_not_flown() -> None:
    built = search(deadline_s=0.02)
    asyncio.run(built.decide(SearchState(GRID.start), ()))
    draft = built.drafting.under_way
    assert draft is not None
    draft.result(timeout=60.0)
    flyable = GRID.flyable.copy()
    flyable[0] = False
    built.common.fly_on(replace(GRID, flyable=flyable))
    planner = built.planner
    asyncio.run(built.decide(SearchState(GRID.start), ()))
    assert built.planner is planner


def test_a_plan_beside_the_flight_that_fails_is_said_once_and_the_flight_goes_on(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    built = search(deadline_s=0.02)
    hasty = built.planner

    def fail(*_: object, **__: object) -> Planner:
        raise RuntimeError("out of memory")

    # nothing that is asked for makes a plan fail
    monkeypatch.setattr(built, "_make_planner", fail)
    for _ in range(4):
        decision = asyncio.run(built.decide(SearchState(GRID.start), ()))
        assert decision.path
        if built.drafting.under_way is not None:
            wait([built.drafting.under_way], timeout=60.0)
    assert built.planner is hasty
    assert [each.getMessage() for each in caplog.records if "beside the flight" in each.getMessage()] == [
        "a plan that was made beside the flight has failed, and the search goes on by the hasty one: out of memory"
    ]
