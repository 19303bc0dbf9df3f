"""The default planner as its callers see it: any field of view, shape, obstacles, hits, deadlines."""

from __future__ import annotations

import time

import numpy as np
import pytest

from roisearch import Belief, FieldOfView, SearchState, make_planner
from roisearch.fov import HEADINGS, MOVES
from roisearch.planners.lookahead.planner import LookaheadPlanner
from roisearch.planners.lookahead.settings import LookaheadSettings
from roisearch.planners.lookahead.sweeps import ANYWHERE
from roisearch.planners.lookahead.thinking import Kept
from roisearch.watch import LOOKED
from sim.ruler import Ruler, detection_curve
from sim.scenario import paper_prior

FOVS = {"point": FieldOfView.point(), "donut": FieldOfView.donut(), "wide": FieldOfView.wide_angle()}

QUICK = LookaheadSettings(iterations=2, horizon=500)


def hill(shape: tuple[int, int], centre: tuple[float, float], width: float) -> np.ndarray:
    row, col = np.indices(shape)
    return np.exp(-((row - centre[0]) ** 2 + (col - centre[1]) ** 2) / (2 * width**2))


def after(state: SearchState, cell: tuple[int, int]) -> SearchState:
    move = MOVES.index((cell[0] - state.cell[0], cell[1] - state.cell[1]))
    return SearchState(cell, HEADINGS[move])


def fly(
    planner: LookaheadPlanner, belief: Belief, fov: FieldOfView, state: SearchState, steps: int
) -> list[SearchState]:
    """Fly so many steps, seeing nothing; where it was."""
    rng = np.random.default_rng(0)
    states = [state]
    for _ in range(steps):
        state = after(state, planner.plan(belief, state, rng).path[0])
        belief.observe(fov.cells(state.cell, state.heading, belief.shape), False, 0.9, 1.0)
        states.append(state)
    return states


def test_it_is_the_default_of_lite_and_the_papers_preset_is_not() -> None:
    assert isinstance(make_planner("puct-regions-lite", fov=FOVS["point"]), LookaheadPlanner)
    for preset in ("paper", "reference"):
        assert not isinstance(
            make_planner("puct-regions-lite", fov=FOVS["point"], preset=preset), LookaheadPlanner
        )


@pytest.mark.parametrize(
    "options", [{"iterations": -1}, {"rollout": 60}, {"keep": 1.0}, {"horizon": 3}, {"contradicted": 2}]
)
def test_options_out_of_range_are_refused(options: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=r"keep|iterations|rollout|horizon|contradicted"):
        make_planner("puct-regions-lite", fov=FOVS["point"], **options)


@pytest.mark.parametrize("name", FOVS)
def test_it_finds_nearly_all_mass_of_a_hill(name: str) -> None:
    fov = FOVS[name]
    belief = Belief(hill((30, 34), (20, 22), 3.0), outside=0.2)
    planner = LookaheadPlanner(LookaheadSettings(iterations=1, horizon=300), fov=fov)
    fly(planner, belief, fov, SearchState((2, 2)), 700)
    assert belief.outside > 0.9


@pytest.mark.parametrize("name", FOVS)
@pytest.mark.parametrize("shape", [(1, 9), (9, 1), (3, 5), (17, 23)])
def test_every_path_is_made_of_flyable_neighbours_on_any_map(name: str, shape: tuple[int, int]) -> None:
    fov, rng = FOVS[name], np.random.default_rng(3)
    belief = Belief(rng.random(shape) ** 4)
    flyable = np.ones(shape, dtype=bool)
    if min(shape) > 2:
        flyable[shape[0] // 2, : shape[1] - 1] = False
    planner = LookaheadPlanner(LookaheadSettings(iterations=2, horizon=200), fov=fov, flyable=flyable)
    state = SearchState((0, 0))
    for step in range(60):
        decision = planner.plan(belief, state, rng)
        at = state.cell
        for cell in decision.path:
            assert abs(cell[0] - at[0]) + abs(cell[1] - at[1]) == 1
            assert flyable[cell]
            at = cell
        state = after(state, decision.path[0])
        seen = fov.cells(state.cell, state.heading, shape)
        if len(seen):
            belief.observe(seen, rng.random(len(seen)) < 0.1 * (step % 3 == 0), 0.9, 0.9)


def test_it_goes_around_a_wall_to_what_is_behind_it() -> None:
    flyable = np.ones((20, 20), dtype=bool)
    flyable[:19, 10] = False
    belief = Belief(hill((20, 20), (2, 14), 1.5))
    planner = LookaheadPlanner(
        LookaheadSettings(iterations=2, horizon=300), fov=FOVS["point"], flyable=flyable
    )
    fly(planner, belief, FOVS["point"], SearchState((2, 8)), 120)
    assert belief.probability()[1:4, 13:16].max() < 0.2


def test_it_looks_again_at_a_cell_with_a_hit() -> None:
    prior = hill((60, 60), (30, 30), 8.0)
    belief, rng = Belief(prior), np.random.default_rng(0)
    planner = LookaheadPlanner(QUICK, fov=FOVS["point"])
    state = SearchState((30, 20))
    for _ in range(20):
        state = after(state, planner.plan(belief, state, rng).path[0])
        belief.observe([state.cell], [False], 0.9, 0.9)
    state = after(state, planner.plan(belief, state, rng).path[0])
    belief.observe([state.cell], [True], 0.9, 0.9)
    hit = state.cell
    visited = []
    for _ in range(3):
        state = after(state, planner.plan(belief, state, rng).path[0])
        belief.observe([state.cell], [False], 0.9, 0.9)
        visited.append(state.cell)
    assert hit in visited


def detected(contradicted: float) -> float:
    """What 300 steps over a hill detect with a tenth of the looks a false alarm, on the mean over the steps."""
    settings = LookaheadSettings(iterations=0, horizon=500, contradicted=contradicted)
    prior = hill((60, 60), (30, 30), 8.0)
    curve = detection_curve(
        LookaheadPlanner(settings, fov=FOVS["point"]),
        prior,
        (30, 29),
        300,
        Ruler(0.9, 0.9),
        np.random.default_rng(1),
    )
    return float(curve.mean())


def test_a_hit_that_a_miss_outweighs_is_not_worth_the_way_back() -> None:
    assert detected(0.2) > 1.01 * detected(1.0)


def test_thinking_goes_on_where_it_stopped_when_the_plan_is_flown() -> None:
    belief, rng = Belief(paper_prior(np.random.default_rng(1000))), np.random.default_rng(0)
    planner = LookaheadPlanner(LookaheadSettings(iterations=8, horizon=800), fov=FOVS["point"])
    state = SearchState((5, 5))
    first = expected = planner.plan(belief, state, rng).value
    for step in range(30):
        flown = 1 + step % 2  # a caller may fly several cells between two plans, and report late or never
        for cell in planner.plan(belief, state, rng).path[:flown]:
            state = after(state, cell)
        decision = planner.plan(belief, state, rng)
        assert decision.value >= expected + flown * (1.0 - 1e-6)  # nothing to be seen out here: time passes
        expected = decision.value
    assert expected > first + 45.0 + 1.0  # and the plan got better


def test_the_same_seed_gives_the_same_search() -> None:
    paths = []
    for _ in range(2):
        belief = Belief(paper_prior(np.random.default_rng(1001)))
        states = fly(
            LookaheadPlanner(QUICK, fov=FOVS["point"]), belief, FOVS["point"], SearchState((5, 5)), 40
        )
        paths.append([state.cell for state in states])
    assert paths[0] == paths[1]


def test_planning_does_not_change_the_belief() -> None:
    belief = Belief(paper_prior(np.random.default_rng(1002)))
    before = belief.digest()
    LookaheadPlanner(QUICK, fov=FOVS["donut"]).plan(belief, SearchState((5, 5)), np.random.default_rng(0))
    assert belief.digest() == before


def test_a_deadline_stops_an_endless_search() -> None:
    belief, rng = Belief(paper_prior(np.random.default_rng(1002))), np.random.default_rng(0)
    planner = LookaheadPlanner(LookaheadSettings(iterations=None), fov=FOVS["point"])
    state = SearchState((5, 5))
    planner.plan(belief, state, rng, deadline_s=0.05)
    short = planner.plan(belief, state, rng, deadline_s=0.02).effort
    long = planner.plan(belief, state, rng, deadline_s=0.4).effort
    assert long.iterations > short.iterations
    assert long.seconds < 4.0
    with pytest.raises(ValueError, match="deadline"):
        planner.plan(belief, state, rng)


def test_copies_of_a_belief_are_planned_for_as_the_belief_itself() -> None:
    """A caller hands over a copy with what it expects to see; the plan and the thinking go on."""
    flights = []
    for copies in (False, True):
        belief, rng = Belief(hill((60, 60), (30, 34), 8.0)), np.random.default_rng(0)
        belief.follow(LOOKED)  # so that copies know all looks
        planner, noise = LookaheadPlanner(QUICK, fov=FOVS["point"]), np.random.default_rng(1)
        state, path = SearchState((30, 20)), []
        for _ in range(120):
            thought = belief.copy() if copies else belief
            state = after(state, planner.plan(thought, state, rng).path[0])
            path.append(state.cell)
            belief.observe([state.cell], bool(noise.random() < 0.1), 0.9, 0.9)
        flights.append(path)
    assert flights[0] == flights[1]


def test_what_was_only_expected_is_taken_back_when_another_copy_does_not_expect_it() -> None:
    belief, rng = Belief(hill((40, 40), (20, 20), 5.0)), np.random.default_rng(0)
    planner = LookaheadPlanner(QUICK, fov=FOVS["point"])
    planner.plan(belief.copy(), SearchState((20, 12)), rng)
    thought = belief.copy()
    thought.observe([(20, 20), (20, 21)], False, 0.9, 0.9)
    planner.plan(thought, SearchState((20, 12)), rng)
    planner.plan(belief.copy(), SearchState((20, 12)), rng)
    assert planner.thinking.desk.chart.mass.reshape(40, 40)[20, 20:22] == pytest.approx(
        belief.weights.reshape(40, 40)[20, 20:22]
    )


def test_another_belief_or_place_is_planned_anew() -> None:
    rng = np.random.default_rng(0)
    planner = LookaheadPlanner(QUICK, fov=FOVS["point"])
    east, west = Belief(hill((40, 40), (20, 35), 2.0)), Belief(hill((40, 40), (20, 5), 2.0))
    middle = SearchState((20, 20))
    assert planner.plan(east, middle, rng).path[0] == (20, 21)
    assert planner.plan(west, middle, rng).path[0] == (20, 19)
    assert planner.plan(east, SearchState((20, 39)), rng).path[0] == (20, 38)


def test_a_second_look_at_a_cell_outside_the_plan_is_taken_in() -> None:
    """Reports of cells elsewhere, as another drone's detector would give them, move the plan."""
    rng = np.random.default_rng(0)
    belief = Belief(hill((40, 40), (20, 35), 2.0) + hill((40, 40), (20, 5), 2.0))
    planner = LookaheadPlanner(QUICK, fov=FOVS["point"])
    state = SearchState((20, 20))
    planner.plan(belief, state, rng)
    there = np.argwhere(np.indices((40, 40))[1] > 20)
    belief.observe(there, False, 0.99, 0.9)
    assert planner.plan(belief, state, rng).path[0] == (20, 19)


def test_the_shortest_plan_never_runs_out() -> None:
    belief, rng = Belief(np.ones((20, 20))), np.random.default_rng(0)
    planner, state = (
        LookaheadPlanner(LookaheadSettings(iterations=1, horizon=64), fov=FOVS["point"]),
        SearchState((0, 0)),
    )
    for _ in range(300):
        decision = planner.plan(belief, state, rng)
        assert decision.value < 0.0, "a move without a plan"
        state = after(state, decision.path[0])
        belief.observe([state.cell], False, 0.9, 1.0)


def test_what_lies_where_nobody_can_look_is_told_also_when_nothing_else_is_left() -> None:
    flyable = np.ones((6, 9), dtype=bool)
    flyable[:, 4] = False
    prior = np.ones((6, 9))
    prior[:, 4] = 0.0
    belief = Belief(prior)
    belief.observe(np.argwhere(np.indices((6, 9))[1] < 4), False, 1.0, 0.9)
    planner = LookaheadPlanner(QUICK, fov=FOVS["point"], flyable=flyable)
    decision = planner.plan(belief, SearchState((0, 0)), np.random.default_rng(0))
    assert decision.unreachable == pytest.approx(1.0)
    assert "cannot look" in decision.remark


def test_there_is_room_to_keep_every_block_of_a_large_map() -> None:
    """A simulation may change all of them, and a look of a wide view many at once."""
    planner = LookaheadPlanner(QUICK, fov=FOVS["wide"])
    planner.plan(Belief(np.ones((1200, 600))), SearchState((5, 5)), np.random.default_rng(0))
    chart = planner.thinking.desk.chart
    assert chart.log.size == chart.stamp.size == len(chart.old) == len(chart.old_peak) == 150 * 75


def test_alternatives_say_what_was_thought_of_each_region() -> None:
    belief = Belief(hill((60, 60), (50, 10), 3.0) + 0.6 * hill((60, 60), (10, 50), 3.0))
    planner = LookaheadPlanner(LookaheadSettings(iterations=200, horizon=600), fov=FOVS["point"])
    started = time.perf_counter()
    decision = planner.plan(belief, SearchState((30, 30)), np.random.default_rng(0))
    assert decision.effort.iterations == 200
    assert decision.effort.seconds <= time.perf_counter() - started
    regions = {alternative.region for alternative in decision.alternatives if alternative.region}
    assert regions == {1, 2}
    best = max(decision.alternatives, key=lambda alternative: alternative.value)
    assert best.value == pytest.approx(decision.value)


def test_thinking_rests_when_the_plan_gets_no_better_and_a_hit_wakes_it() -> None:
    belief, rng = Belief(hill((40, 40), (20, 25), 4.0)), np.random.default_rng(0)
    planner = LookaheadPlanner(
        LookaheadSettings(iterations=200, patience=30, restarts=1, horizon=1500), fov=FOVS["point"]
    )
    state, thought = SearchState((20, 20)), []
    for _ in range(60):
        decision = planner.plan(belief, state, rng)
        thought.append(decision.effort.iterations)
        if thought[-1] == 0:
            break
        state = after(state, decision.path[0])
        belief.observe([state.cell], False, 0.9, 0.9)
    assert thought[0] == 200
    assert thought[-1] == 0
    belief.observe([state.cell], True, 0.9, 0.9)
    assert planner.plan(belief, state, rng).effort.iterations == 200


def test_what_is_left_of_a_searched_map_is_not_thought_about() -> None:
    prior = hill((40, 40), (20, 25), 4.0)
    belief, rng = Belief(prior), np.random.default_rng(0)
    planner = LookaheadPlanner(LookaheadSettings(iterations=5, least=0.5, horizon=300), fov=FOVS["point"])
    state = SearchState((20, 20))
    assert planner.plan(belief, state, rng).effort.iterations == 5
    belief.observe(np.argwhere(prior > 0.1), False, 0.99, 0.9)
    assert planner.plan(belief, state, rng).effort.iterations == 0


def test_a_plan_that_comes_back_to_a_cell_within_a_few_steps_is_flown_on() -> None:
    planner = LookaheadPlanner(LookaheadSettings(iterations=0, horizon=100), fov=FOVS["point"])
    belief, rng = Belief(hill((30, 30), (15, 15), 4.0)), np.random.default_rng(1)
    planner.plan(belief, SearchState((15, 15)), rng)
    kept = planner.kept()
    path = kept.path.copy()
    for step, cell in enumerate([(15, 16), (15, 17), (15, 16), (16, 16), (17, 16)]):
        path[step] = cell[0] * 30 + cell[1]
    path[5:] = path[4] + 30 * (1 - np.arange(95) % 2)
    planner.take_up(Kept(path, kept.action))
    for flown, state in ((3, SearchState((15, 16), "west")), (1, SearchState((16, 16), "south"))):
        belief.observe([divmod(int(cell), 30) for cell in path[:flown]], False, 0.9, 1.0)
        planner.plan(belief, state, rng)
        path = path[flown:]
        left = planner.committed()
        assert (left[: path.size] == np.stack(np.divmod(path, 30), axis=1)).all()


@pytest.mark.parametrize("flown", [4, 0])
def test_a_plan_that_leads_around_to_where_it_began_is_flown_on_once_it_was(flown: int) -> None:
    """Two that searched together stood for ever at such a corner: what they had flown was not noticed."""
    planner = LookaheadPlanner(LookaheadSettings(iterations=0, horizon=100), fov=FOVS["point"])
    belief, rng, here = (
        Belief(hill((30, 30), (15, 15), 4.0)),
        np.random.default_rng(1),
        SearchState((15, 15), "west"),
    )
    planner.plan(belief, here, rng)
    around = [(14, 15), (14, 16), (15, 16), (15, 15), (15, 14), (15, 13)]
    path = np.array([row * 30 + col for row, col in around] + [15 * 30 + 12, 15 * 30 + 13] * 47)
    planner.take_up(Kept(path, np.full(path.size, ANYWHERE)))
    planner.plan(belief, here, rng)
    before = planner.committed()
    if flown:
        belief.observe(around[:4], False, 0.9, 1.0)
    planner.plan(belief, here, rng)
    after_it = planner.committed()
    assert (after_it[0] == before[flown]).all()
