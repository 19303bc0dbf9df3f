"""Laws of every planner: it flies only where it may, sees everything in the end, and goes back to a hit."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings

from roisearch import PLANNERS, Belief, FieldOfView, SearchState, make_planner
from roisearch.bounds import multi_cell, release
from roisearch.decision import AHEAD
from roisearch.fov import HEADINGS, MOVES
from roisearch.planners.base import Planner
from tests.roisearch.strategies import World, worlds

CAREFUL = ("puct-regions-lite", "puct-regions", "puct", "index", "coverage", "spiral")
"""Those that are meant to search a whole area; greedy and direct policy search only promise the way they look."""


def fly(
    planner: Planner, belief: Belief, fov: FieldOfView, start: tuple[int, int], steps: int
) -> list[tuple[int, int]]:
    """Search without a hit; the cells entered."""
    rng = np.random.default_rng(0)
    cell, heading, entered = start, "north", [start]
    for _ in range(steps):
        near = planner.plan(belief, SearchState(cell, heading), rng).path[0]
        heading = HEADINGS[MOVES.index((near[0] - cell[0], near[1] - cell[1]))]
        cell = near
        entered.append(cell)
        belief.observe(fov.cells(cell, heading, belief.shape), False, 0.9, 0.9)
    return entered


@pytest.mark.parametrize("name", PLANNERS)
@given(world=worlds())
@settings(max_examples=12, deadline=None)
def test_no_planner_leaves_flyable_ground(name: str, world: World) -> None:
    planner = make_planner(name, fov=world.fov, flyable=world.flyable)
    belief = Belief(world.prior)
    rng = np.random.default_rng(1)
    cell, heading = world.start, "north"
    for _ in range(6):
        decision = planner.plan(belief, SearchState(cell, heading), rng)
        before = cell
        for near in decision.path:
            assert abs(near[0] - before[0]) + abs(near[1] - before[1]) == 1
            assert world.flyable[near]
            before = near
        heading = HEADINGS[MOVES.index((decision.path[0][0] - cell[0], decision.path[0][1] - cell[1]))]
        cell = decision.path[0]
        belief.observe(world.fov.cells(cell, heading, belief.shape), False, 0.9, 0.9)


@pytest.mark.parametrize("name", CAREFUL)
@pytest.mark.parametrize("hilly", [False, True])
def test_the_whole_of_an_l_shaped_area_with_a_hole_is_searched(name: str, hilly: bool) -> None:
    flyable = np.ones((15, 20), dtype=bool)
    flyable[:7, 12:] = False
    flyable[9:12, 4:7] = False
    down, right = np.mgrid[0:15, 0:20]
    prior = np.exp(-((down - 11) ** 2 + (right - 14) ** 2) / 8) + 1e-3 if hilly else np.ones((15, 20))
    fov = FieldOfView.point()
    belief = Belief(prior, searchable=flyable, outside=0.05)
    planner = make_planner(name, fov=fov, flyable=flyable)
    entered = fly(planner, belief, fov, (0, 0), 1500)
    looks = np.zeros(flyable.shape, dtype=int)
    np.add.at(looks, tuple(np.array(entered).T), 1)
    assert looks[flyable].min() >= 2  # nothing is forgotten, and a second pass is flown
    assert belief.outside > 0.95


STEPS_TO_COME_BACK = 16


@pytest.mark.parametrize("name", ["puct-regions-lite", "puct-regions", "index"])
@pytest.mark.parametrize("p", [0.9, 0.99])
def test_a_hit_is_looked_at_again_and_again_until_sure(name: str, p: float) -> None:
    down, right = np.mgrid[0:30, 0:30]
    belief = Belief(np.exp(-((down - 8) ** 2 + (right - 9) ** 2) / 40) + 1e-2, outside=0.05)
    fov = FieldOfView.point(p, p)
    planner = make_planner(name, fov=fov)
    entered = fly(planner, belief, fov, (0, 0), 60)
    target, cell, heading = entered[-1], entered[-1], "north"
    for _ in range(2):  # once to take back the miss that `fly` counted there, once for the hit
        belief.observe([target], [True], p, p)
    rng = np.random.default_rng(0)
    looks = 0
    for _ in range(STEPS_TO_COME_BACK):
        near = planner.plan(belief, SearchState(cell, heading), rng).path[0]
        heading = HEADINGS[MOVES.index((near[0] - cell[0], near[1] - cell[1]))]
        cell = near
        looks += cell == target
        belief.observe([cell], [cell == target], p, p)
    assert looks >= 4
    assert belief.mass_at([target])[0] > 0.95


@pytest.mark.parametrize("name", PLANNERS)
def test_ground_that_cannot_be_reached_is_named_and_the_rest_is_searched(name: str) -> None:
    flyable = np.ones((6, 11), dtype=bool)
    flyable[:, 5] = False
    prior = np.zeros((6, 11))
    prior[:, :5], prior[:, 6:] = 1.0, 3.0
    planner = make_planner(name, fov=FieldOfView.point(), flyable=flyable)
    decision = planner.plan(Belief(prior), SearchState((2, 2)), np.random.default_rng(0))
    assert decision.unreachable == pytest.approx(0.75)
    assert "75.00%" in decision.remark
    assert all(col < 5 for _, col in decision.path)


def test_a_cell_that_must_not_be_entered_is_seen_from_beside() -> None:
    flyable = np.ones((9, 9), dtype=bool)
    flyable[4, 4] = False
    prior = np.full((9, 9), 1e-6)
    prior[4, 4] = 1.0
    fov = FieldOfView.donut()
    planner = make_planner("index", fov=fov, flyable=flyable)
    decision = planner.plan(Belief(prior), SearchState((0, 0)), np.random.default_rng(0))
    end = decision.path[-1]
    assert max(abs(end[0] - 4), abs(end[1] - 4)) == 1
    assert decision.unreachable == 0.0


@pytest.mark.parametrize(
    ("cell", "words"), [((0, 3), "not flyable"), ((5, 0), "outside the map"), ((0, 4), "no neighbour")]
)
def test_a_drone_that_cannot_be_there_is_an_error_with_its_cell(cell: tuple[int, int], words: str) -> None:
    flyable = np.array([[1, 1, 1, 0, 1]], dtype=bool)
    planner = make_planner("puct-regions-lite", fov=FieldOfView.point(), flyable=flyable)
    with pytest.raises(ValueError, match=words):
        planner.plan(Belief(np.ones((1, 5))), SearchState(cell), np.random.default_rng(0))


@pytest.mark.parametrize(
    ("name", "options", "words"),
    [
        ("best", {}, "no planner 'best'"),
        ("puct", {"speed": 1}, "no option 'speed'"),
        ("puct", {"preset": "fast"}, "preset"),
        ("puct-regions-lite", {"preset": "trips"}, "default, paper, reference"),
        ("puct-regions-lite", {"rollout": 60}, "no option 'rollout'; it has .* preset='paper'"),
        ("puct", {"backup": "median"}, "backup is one of mean, max"),
        ("index", {"speed": 1}, "speed"),
        ("greedy", {"horizon": 0}, "horizon"),
    ],
)
def test_unknown_names_and_values_are_refused(name: str, options: dict, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        make_planner(name, fov=FieldOfView.point(), **options)


def test_the_paper_preset_has_the_papers_values() -> None:
    planner = make_planner("puct-regions-lite", fov=FieldOfView.point(), preset="paper")
    chosen = planner.settings  # type: ignore[attr-defined]
    assert (chosen.iterations, chosen.rollout, chosen.explore, chosen.factor) == (40, 60, 0.5, 8e-6)
    assert (chosen.option_reward, chosen.fades, chosen.goal) == ("density", False, "peak")


@pytest.mark.parametrize("name", PLANNERS)
def test_the_same_seed_gives_the_same_flight(name: str) -> None:
    down, right = np.mgrid[0:25, 0:25]
    prior = np.exp(-((down - 8) ** 2 + (right - 17) ** 2) / 30) + 1e-4
    fov = FieldOfView.wide_angle()
    flights = [fly(make_planner(name, fov=fov), Belief(prior), fov, (2, 2), 40) for _ in range(2)]
    assert flights[0] == flights[1]


def test_warm_up_tells_its_steps_and_leaves_nothing_to_compile() -> None:
    told: list[tuple[str, int, int]] = []
    planner = make_planner("puct-regions-lite", fov=FieldOfView.point())
    planner.warm_up(lambda step, number, total: told.append((step, number, total)))
    assert [number for _, number, _ in told] == list(range(1, told[-1][2] + 1))


@pytest.mark.parametrize("name", PLANNERS)
@pytest.mark.parametrize("fov", [FieldOfView.point(), FieldOfView.donut(), FieldOfView.wide_angle()])
def test_no_planner_beats_the_bound(name: str, fov: FieldOfView) -> None:
    down, right = np.mgrid[0:24, 0:24]
    prior = np.exp(-((down - 15) ** 2 + (right - 17) ** 2) / 20) + np.exp(
        -((down - 4) ** 2 + (right - 18) ** 2) / 9
    )
    prior /= prior.sum()
    start, steps = (2, 2), 150
    entered = fly(make_planner(name, fov=fov), Belief(prior), fov, start, steps)
    missed = prior.copy()
    found = [0.0]
    for before, cell in pairwise(entered):
        heading = HEADINGS[MOVES.index((cell[0] - before[0], cell[1] - before[1]))]
        gain = 0.0
        for seen in fov.cells(cell, heading, prior.shape).tolist():
            gain += 0.9 * missed[tuple(seen)]
            missed[tuple(seen)] *= 1.0 - 0.9
        found.append(found[-1] + gain)
    point = fov.is_point
    bound = release(prior, start, 0.9, steps) if point else multi_cell(prior, start, fov, 0.9, steps)
    assert (np.array(found) <= bound + 1e-12).all()


@pytest.mark.parametrize("name", ["puct-regions", "index"])
def test_the_path_of_a_far_goal_is_cut_but_the_goal_is_told(name: str) -> None:
    prior = np.full((5, 300), 1e-12)
    prior[2, 290] = 1.0
    planner = make_planner(name, fov=FieldOfView.point(), **({} if name == "index" else {"prior": "index"}))
    decision = planner.plan(Belief(prior), SearchState((2, 3)), np.random.default_rng(0))
    assert decision.goal == (2, 290)
    assert decision.path == tuple((2, col) for col in range(4, 4 + AHEAD))
