"""Several searchers on one belief: alone as without a fleet, together by what all of them will have looked at."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from roisearch import Belief, FieldOfView, Fleet, Motion, SearchState, make_planner
from roisearch.directions import direction_between
from roisearch.searcher import looks_along

POINT = FieldOfView.point(0.9, 1.0)


def hills(*middles: tuple[int, int], shape: tuple[int, int] = (40, 40)) -> np.ndarray:
    row, col = np.indices(shape)
    total = np.zeros(shape)
    for down, right in middles:
        total += np.exp(-((row - down) ** 2 + (col - right) ** 2) / 32.0)
    prior: np.ndarray = total / total.sum()
    return prior


def fleet_of(*names: str, fov: FieldOfView = POINT, **options: Any) -> Fleet:
    fleet = Fleet(**{"iterations": 2, "horizon": 300, **options})
    for name in names:
        fleet.join(name, fov=fov)
    return fleet


def test_a_searcher_alone_plans_as_its_planner_does_to_the_last_bit() -> None:
    plain = make_planner("puct-regions-lite", fov=POINT, iterations=2, horizon=300)
    fleet = fleet_of("a")
    cells = []
    for together in (False, True):
        belief, state, rng = Belief(hills((10, 10), (30, 25))), SearchState((2, 2)), np.random.default_rng(1)
        flown = []
        for step in range(120):
            if together:
                decision = fleet.plan("a", belief, state, rng, now_s=float(step))
            else:
                decision = plain.plan(belief, state, rng)
            state = SearchState(decision.path[0], direction_between(state.cell, decision.path[0]))
            belief.observe([state.cell], [step % 40 == 39], 0.9, 0.9)
            flown.append((decision.path, decision.value))
        cells.append(flown)
    assert cells[0] == cells[1]


def test_the_second_searcher_goes_where_the_first_does_not() -> None:
    belief, rng = Belief(hills((20, 8), (20, 32))), np.random.default_rng(1)
    fleet, state = fleet_of("a", "b"), SearchState((20, 19))
    first, second = (fleet.plan(name, belief, state, rng, now_s=0.0) for name in ("a", "b"))
    ends = [decision.path[11][1] for decision in (first, second)]
    assert (ends[0] < 19) != (ends[1] < 19)


def test_what_a_lost_searcher_was_going_to_look_at_comes_back() -> None:
    belief, state = Belief(hills((20, 30))), SearchState((20, 20))
    alone = fleet_of("b").plan("b", belief, state, np.random.default_rng(1), now_s=0.0)
    for lose in (Fleet.leave, Fleet.forget):
        fleet = fleet_of("a", "b")
        fleet.plan("a", belief, state, np.random.default_rng(5), now_s=0.0)
        shared = fleet.plan("b", belief, state, np.random.default_rng(1), now_s=0.0)
        assert shared.value > alone.value  # minus the expected time: two are sooner
        lose(fleet, "a")
        again = fleet.plan("b", belief, state, np.random.default_rng(1), now_s=0.0)
        if lose is Fleet.leave:
            assert again.value == pytest.approx(alone.value, rel=0.05)
        assert again.value < shared.value


def test_expected_time_in_thought_is_that_of_all_looks_merged_each_counted_once() -> None:
    prior = hills((10, 10), (30, 25))
    belief, state, rng = Belief(prior), SearchState((2, 2)), np.random.default_rng(1)
    fleet = fleet_of("a", "b", iterations=0)
    fleet.join("slow", fov=POINT, step_s=2.5)
    for name in ("a", "slow"):
        fleet.plan(name, belief, state, rng, now_s=0.0)
    value = fleet.plan("b", belief, state, rng, now_s=0.0).value
    looks = sorted(
        (float(when), (int(row), int(col)))
        for name in fleet.searchers
        for when, (row, col) in zip(fleet.committed(name).when, fleet.committed(name).cells, strict=True)
        if when <= 300.0
    )
    assert max(when for when, _ in looks) == 300.0
    undetected, found = prior.copy(), np.zeros(302)
    for when, cell in looks:
        found[int(np.ceil(when))] += 0.9 * undetected[cell]
        undetected[cell] *= 0.1
    area = float((1.0 - np.cumsum(found))[:300].sum())
    left = 1.0 - float(found.sum())
    assert left == pytest.approx(float(undetected.sum()))
    assert -value >= area - 1e-9
    assert -value - area < 300.0 * left  # what clearing the rest takes


def test_looks_of_a_wide_field_of_view_are_those_that_it_has_along_the_way() -> None:
    fov, state = FieldOfView.wide_angle(), SearchState((3, 3), "east")
    cells = np.array([[3, 4], [3, 5], [4, 5], [4, 4]])
    looks = looks_along(cells, state, fov, (8, 8))
    for step, (cell, heading) in enumerate(
        zip(cells.tolist(), ("east", "east", "south", "west"), strict=True), start=1
    ):
        seen = {tuple(c) for c in looks.cells[looks.when == step].tolist()}
        assert seen == {tuple(c) for c in fov.cells((cell[0], cell[1]), heading, (8, 8)).tolist()}


def test_different_fields_of_view_starts_and_speeds_search_together() -> None:
    prior = hills((10, 10), (30, 25))
    belief, rng = Belief(prior), np.random.default_rng(1)
    fleet = Fleet(iterations=1, horizon=200)
    views = {"wide": FieldOfView.wide_angle(), "narrow": POINT}
    fleet.join("wide", fov=views["wide"], step_s=2.0)
    fleet.join("narrow", fov=POINT, step_s=1.0)
    states = {"wide": SearchState((0, 39)), "narrow": SearchState((39, 0))}
    for step in range(60):
        for name, every in (("narrow", 1), ("wide", 2)):
            if step % every == 0:
                near = fleet.plan(name, belief, states[name], rng, now_s=float(step)).path[0]
                states[name] = SearchState(near, direction_between(states[name].cell, near))
                cells, p_tp, p_tn = views[name].looks(near, states[name].heading, prior.shape)
                if len(cells):
                    belief.observe(cells, False, p_tp, p_tn)
    assert belief.probability().sum() == pytest.approx(1.0)


def test_a_planner_that_reckons_with_no_others_is_told_by_a_belief_of_its_own() -> None:
    belief, state, rng = Belief(hills((20, 30))), SearchState((20, 20)), np.random.default_rng(1)
    fleet = Fleet("index")
    fleet.join("a", fov=POINT, planner="puct-regions-lite", iterations=0, horizon=300)
    fleet.join("b", fov=POINT)
    before = belief.digest()
    fleet.plan("a", belief, state, rng, now_s=0.0)
    goal = fleet.plan("b", belief, state, rng, now_s=0.0)
    assert belief.digest() == before
    plain = make_planner("index", fov=POINT).plan(belief, state, rng)
    assert goal.value != plain.value


def test_what_cannot_be_is_refused_in_one_sentence() -> None:
    fleet = fleet_of("a")
    with pytest.raises(ValueError, match="'a' already"):
        fleet.join("a", fov=POINT)
    with pytest.raises(ValueError, match="step_s must be above 0"):
        fleet.join("b", fov=POINT, step_s=0.0)
    with pytest.raises(KeyError, match="no searcher 'b'; there is a"):
        fleet.leave("b")
    with pytest.raises(ValueError, match="ahead_s"):
        Fleet(ahead_s=-1.0)


def test_sharing_the_search_out_anew_is_better_for_all_and_never_worse() -> None:
    belief, rng = Belief(hills((8, 30), (30, 8), (33, 33))), np.random.default_rng(1)
    names = ("a", "b", "c")
    fleet = fleet_of(*names, iterations=0)
    states = {name: SearchState((2, 2)) for name in names}
    values = []
    for openings in (0, 0, 16, 1):
        fleet.allocate(belief, states, rng, now_s=0.0, openings=openings)
        values.append(max(fleet.plan(name, belief, states[name], rng, now_s=0.0).value for name in names))
    assert values == sorted(values)
    assert values[2] > values[1] * 0.99  # minus expected times
    before = {name: fleet.committed(name) for name in names}
    fleet.allocate(belief, {"a": states["a"]}, rng, now_s=0.0)  # nobody to share with
    assert all((fleet.committed(name).cells == looks.cells).all() for name, looks in before.items())


@pytest.mark.parametrize(("where", "changes"), [((38, 1), False), ((10, 15), True)])
def test_a_hit_of_another_changes_the_plan_of_those_nearby_only(
    where: tuple[int, int], changes: bool
) -> None:
    belief, rng = Belief(hills((10, 10), (30, 25))), np.random.default_rng(1)
    fleet, state = fleet_of("a", "b", iterations=16), SearchState((10, 12))
    fleet.plan("a", belief, SearchState((39, 0)), rng, now_s=0.0)
    for _ in range(40):  # thought about, until it is not what the rollout's rule does
        fleet.plan("b", belief, state, rng, now_s=0.0)
    plan = fleet.committed("b").cells
    belief.observe([where], True, 0.9, 0.9)
    fleet.plan("b", belief, state, rng, now_s=0.0, deadline_s=0.0)
    again = fleet.committed("b").cells
    assert (again.shape != plan.shape or (again != plan).any()) == changes


def test_a_planner_that_is_made_already_joins_as_it_is_and_may_be_replaced() -> None:
    fleet, planner = Fleet(), make_planner("greedy", fov=POINT)
    fleet.join("a", fov=POINT, planner=planner)
    belief, rng = Belief(hills((20, 8))), np.random.default_rng(1)
    asked: list[str] = []

    class Noting:
        name = "noting"

        def plan(self, *given: Any, **more: Any) -> Any:
            asked.append("plan")
            return planner.plan(*given, **more)

        def warm_up(self, progress: Any = None) -> None:
            pass

    fleet.plan("a", belief, SearchState((20, 19)), rng, now_s=0.0)
    assert asked == []
    fleet.replace("a", Noting())
    assert len(fleet.committed("a").when) > 0  # its looks stay
    fleet.plan("a", belief, SearchState((20, 19)), rng, now_s=1.0)
    assert asked == ["plan"]
    with pytest.raises(ValueError, match="takes no options: horizon"):
        fleet.join("b", fov=POINT, planner=planner, horizon=100)


def test_who_asks_its_planner_itself_is_told_of_the_others_and_commits_to_all_that_the_planner_tells() -> (
    None
):
    motion = Motion(cell_m=20.0)
    fleet, belief, rng = Fleet(ahead_s=120.0), Belief(hills((20, 8), (20, 32))), np.random.default_rng(1)
    state = SearchState((20, 19))
    planners = {name: make_planner("puct-regions-lite", fov=POINT, motion=motion) for name in ("a", "b")}
    for name, planner in planners.items():
        fleet.join(name, fov=POINT, step_s=2.5, planner=planner)
    alone = fleet.beside("a", belief, now_s=0.0)
    assert alone is belief
    decision = planners["a"].plan(alone, state, rng, deadline_s=0.05)
    fleet.commit("a", decision, state, belief.shape, now_s=0.0)
    assert fleet.committed("a").when.max() >= 120.0  # and not for the cells of the decision alone
    beside = fleet.beside("b", belief, now_s=0.0)
    first = fleet.committed("a").cells[0]
    at = int(first[0]) * belief.shape[1] + int(first[1])
    assert beside.weights[at] < belief.weights[at]
    other = decision._replace(path=((0, 0),))  # it flies another way than its planner would
    fleet.commit("a", other, state, belief.shape, now_s=0.0)
    assert fleet.committed("a").cells.tolist() == [[0, 0]]
