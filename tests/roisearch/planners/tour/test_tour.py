"""A tour's price is what flying it costs, annealing only gains, and the planner flies it anywhere."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from roisearch import Belief, FieldOfView, Motion, SearchState, make_planner
from roisearch.directions import direction_between, direction_index, moves_allowed
from roisearch.planners.lanes import lawnmowers
from roisearch.planners.tour.anneal import propose, rearrange
from roisearch.planners.tour.desk import Desk, prices_of
from roisearch.planners.tour.planner import TourPlanner
from roisearch.planners.tour.settings import TourSettings
from roisearch.planners.tour.starts import PLAIN, swept
from roisearch.planners.tour.tour import price
from roisearch.planners.ways import Ways

MOTION = Motion(cell_m=25.0)
QUICK = TourSettings(looks=300, first=5, proposals=2000)
SIDE = 8
HILLY = Motion(cell_m=25.0, climb_mps=2.0, descent_mps=1.0)
GROUNDS = st.one_of(
    st.none(),
    st.lists(st.floats(-60.0, 60.0), min_size=SIDE * SIDE, max_size=SIDE * SIDE).map(np.array),
)


def desk_with(
    looks: list[tuple[int, float]],
    rest: float = 0.3,
    motion: Motion = MOTION,
    heights: NDArray[np.float64] | None = None,
) -> Desk:
    allowed = np.ascontiguousarray(moves_allowed(np.ones((SIDE, SIDE), dtype=bool)).ravel())
    desk = Desk(80, SIDE * SIDE, prices_of(motion, allowed, SIDE, True, heights))
    desk.stand((3, 3), 2)
    for cell, worth in looks:
        desk.append(cell, worth)
    desk.prices.rest[0] = rest
    desk.settle()
    return desk


def slow_cost(desk: Desk) -> float:
    """The plain twin: walk the tour, and add up worth times time."""
    prices, tour = desk.prices, desk.tour
    points = [(int(tour.row[n]), int(tour.col[n])) for n in tour.order[: desk.size + 1]]
    steps = [(b[0] - a[0], b[1] - a[1]) for a, b in itertools.pairwise(points)]
    bearings = [int(tour.size[1])]
    for down, right in steps:
        sixteenths = round(math.atan2(right, -down) / (math.pi / 8)) % 16
        bearings.append(16 if (down, right) == (0, 0) else sixteenths)
    bends = []
    for before, after in itertools.pairwise(bearings):
        apart = (after - before) % 16
        twice = -2.0 * float(prices.corner[8]) if before == after else 0.0
        bends.append(twice if 16 in (before, after) else float(prices.corner[min(apart, 16 - apart)]))
    bends.append(0.0)
    now, total = 0.5 * bends[0], 0.0
    for k, (down, right) in enumerate(steps, start=1):
        now += slow_climb(desk, points[k - 1], points[k])
        down, right = abs(down), abs(right)
        both = min(down, right)
        length = both * prices.axis[1] + (max(down, right) - both) * prices.axis[0]
        if both and down != right:
            length += prices.jump
        if down == right == 0:
            length = 2 * prices.axis[0] + 2 * prices.corner[8]
        now += 0.5 * bends[k - 1] + length + 0.5 * bends[k]
        total += float(tour.worth[tour.order[k]]) * now
    return total + float(prices.rest[0]) * now


def slow_climb(desk: Desk, here: tuple[int, int], there: tuple[int, int]) -> float:
    """What heights add to a leg: each step, the diagonal ones first, takes what its climb or descent takes at least."""
    heights, more = desk.prices.climb.heights, 0.0
    while heights.size and here != there:
        down, right = (int(np.sign(b - a)) for a, b in zip(here, there, strict=True))
        ahead = here[0] + down, here[1] + right
        rise = float(heights[ahead[0] * SIDE + ahead[1]] - heights[here[0] * SIDE + here[1]])
        upright = rise / HILLY.climb_mps if rise > 0.0 else -rise / (HILLY.descent_mps or 1.0)
        step = 25.0 * math.hypot(down, right) / HILLY.speed_mps
        more, here = more + max(0.0, upright - step), ahead
    return more


LOOKS = st.lists(st.tuples(st.integers(0, SIDE * SIDE - 1), st.floats(0.001, 1.0)), min_size=2, max_size=24)


def test_two_more_looks_at_a_cell_cost_what_the_motion_says() -> None:
    ahead = [(3, 4 + k) for k in range(3)]
    once = desk_with([(3 * SIDE + col, 1.0) for _, col in ahead], rest=0.0)
    cells = [(3, 4), (3, 4), (3, 4), *ahead[1:]]
    thrice = desk_with([(row * SIDE + col, 1.0) for row, col in cells], rest=0.0)
    flown = [(3, 4), (3, 5), (3, 4), (3, 3), (3, 4), *ahead[1:]]
    arrivals = [MOTION.arrivals(path, (3, 3), "east", MOTION.speed_mps)[-1] for path in (flown, ahead)]
    priced = [float(desk.tour.time[desk.size]) for desk in (thrice, once)]
    assert priced[0] - priced[1] == pytest.approx(arrivals[0] - arrivals[1], rel=0.02)


def test_of_tours_annealed_from_several_starts_the_best_is_kept() -> None:
    desk = desk_with([(3 * SIDE + col, 1.0) for col in (4, 5, 6, 7)])
    nodes = desk.tour.order[1:5].copy()
    near, far, mixed = desk.cost, nodes[::-1].copy(), nodes[[1, 0, 3, 2]]
    random = np.ones(1, dtype=np.uint64)
    for starts in ([far, nodes, mixed], [nodes, mixed, far], [mixed, far, nodes]):
        desk.anneal_best(starts, 0, (1.0, 0.1), random)
        assert desk.cost == pytest.approx(near)
        np.testing.assert_array_equal(desk.tour.order[1:5], nodes)
    desk.anneal_best([far, mixed], 4000, (1.0, 0.1), random)
    assert desk.cost == pytest.approx(near)


def test_the_first_plan_takes_no_more_spells_than_there_is_time_for(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = itertools.count()
    spent: list[int] = []

    def slow(self: Desk, first: int, last: int, proposals: int, *others: object) -> float:
        spent.append(proposals)
        for _ in range(9 * proposals // QUICK.proposals):
            next(clock)
        return 0.0

    monkeypatch.setattr(Desk, "anneal", slow)
    monkeypatch.setattr("time.perf_counter", lambda: float(next(clock)))
    prior = np.ones((9, 9))
    planner = TourPlanner(
        TourSettings(looks=300, first=10_000, proposals=2000), fov=FieldOfView.point(0.9), motion=MOTION
    )
    planner.plan(Belief(prior), SearchState((0, 0)), np.random.default_rng(0), deadline_s=1000.0)
    assert (
        50 <= sum(spent) / QUICK.proposals <= 110
    )  # a spell takes ten ticks of this clock, or a little less


def test_the_starts_are_tried_the_best_first() -> None:
    desk = desk_with([(row * SIDE + col, 1.0) for row in range(SIDE) for col in (5, 0, 2)])
    costs = []
    for order in (orders := desk.arrange(np.inf)):
        desk.tour.order[1 : desk.size + 1] = order
        desk.settle()
        costs.append(desk.cost)
    assert len(orders) > 8
    assert costs == sorted(costs)
    assert costs[0] < costs[-1]


@settings(deadline=None, max_examples=60)
@given(LOOKS, GROUNDS)
def test_the_cost_is_that_of_the_slow_twin(
    looks: list[tuple[int, float]], heights: NDArray[np.float64] | None
) -> None:
    desk = desk_with(looks, motion=HILLY, heights=heights)
    assert desk.cost == pytest.approx(slow_cost(desk), rel=1e-9)


@settings(deadline=None, max_examples=120)
@given(LOOKS, GROUNDS, st.integers(0, 2**63), st.data())
def test_a_change_costs_what_was_said_before(
    looks: list[tuple[int, float]], heights: NDArray[np.float64] | None, seed: int, data: st.DataObject
) -> None:
    desk = desk_with(looks, motion=HILLY, heights=heights)
    size, random = desk.size, np.array([seed], dtype=np.uint64)
    pieces, room = np.zeros((4, 2), dtype=np.int64), np.zeros(100, dtype=np.int64)
    for _ in range(8):
        here, there = data.draw(st.integers(1, size)), data.draw(st.integers(1, size))
        if here == there:
            continue
        lead, count, top = propose(here, there, random, pieces, size)
        if count == 0:
            continue
        kept = count
        if top < size:
            pieces[count] = top + 1, size
            kept += 1
        said = price(lead, pieces, kept, desk.tour, desk.prices)
        before = sorted(desk.tour.order[: size + 1].tolist())
        rearrange(lead, pieces, count, room, desk.tour)
        assert sorted(desk.tour.order[: size + 1].tolist()) == before
        desk.settle()
        assert said == pytest.approx(desk.cost, rel=1e-9)
        assert desk.cost == pytest.approx(slow_cost(desk), rel=1e-9)


@settings(deadline=None, max_examples=25)
@given(LOOKS, GROUNDS, st.integers(0, 2**63))
def test_annealing_gains_what_it_says_and_never_loses(
    looks: list[tuple[int, float]], heights: NDArray[np.float64] | None, seed: int
) -> None:
    desk = desk_with(looks, motion=HILLY, heights=heights)
    before, cells = desk.cost, sorted(desk.cells().tolist())
    gained = desk.anneal(1, desk.size, 3000, (1.0, 0.01), np.array([seed], dtype=np.uint64))
    assert gained >= 0.0
    assert before - desk.cost == pytest.approx(gained, abs=1e-9 * before)
    assert sorted(desk.cells().tolist()) == cells
    assert desk.cost == pytest.approx(slow_cost(desk), rel=1e-9)


@settings(deadline=None, max_examples=40)
@given(LOOKS, st.integers(0, SIDE * SIDE - 1))
def test_a_look_is_put_in_where_it_costs_least(looks: list[tuple[int, float]], cell: int) -> None:
    desk = desk_with(looks)
    desk.insert(cell, 0.2)
    best = desk.cost
    place = int(desk.tour.place[desk.tour.order[1 : desk.size + 1]].max())
    assert place == desk.size
    for other in range(desk.size):
        twin = desk_with(looks)
        order = twin.tour.order[1 : twin.size + 1].tolist()
        twin.append(cell, 0.2)
        node = int(twin.tour.order[twin.size])
        twin.tour.order[1 : twin.size + 1] = [*order[:other], node, *order[other:]]
        twin.settle()
        assert best <= twin.cost + 1e-9 * best


def test_flat_ground_costs_no_array_more() -> None:
    flat, hilly = desk_with([(3, 1.0)]).tour, desk_with([(3, 1.0)], heights=np.zeros(SIDE * SIDE)).tour
    assert flat.back is flat.time
    assert flat.moment_back is flat.moment
    assert hilly.back is not hilly.time


def test_one_height_everywhere_is_flat_ground() -> None:
    looks = [(k * 7 % 64, 0.1 + k / 10) for k in range(20)]
    costs = []
    for heights in (None, np.full(SIDE * SIDE, 40.0)):
        desk = desk_with(looks, heights=heights)
        desk.anneal(1, desk.size, 3000, (1.0, 0.01), np.array([4], dtype=np.uint64))
        costs.append((desk.cost, desk.cells().tolist()))
    assert costs[0] == costs[1]


def test_what_lies_up_a_slope_waits_for_what_is_level() -> None:
    prior = np.zeros((3, 21))
    prior[1, 3], prior[1, 17] = 0.5, 0.5  # as far to either side
    slope = np.broadcast_to(np.maximum(0.0, np.arange(21.0) - 10.0) * 20.0, (3, 21))
    for heights, first in ((slope, 3), (slope[:, ::-1], 17)):
        planner = TourPlanner(QUICK, fov=FieldOfView.point(0.9), motion=HILLY, heights=heights)
        planner.plan(Belief(prior), SearchState((1, 10), "north"), np.random.default_rng(0))
        entered = [col for _, col in planner.ahead(40)]
        assert entered.index(first) < entered.index(20 - first)


def test_heights_of_another_map_and_none_at_all_are_refused() -> None:
    planner = TourPlanner(QUICK, fov=FieldOfView.point(0.9), motion=HILLY, heights=np.zeros((2, 2)))
    with pytest.raises(ValueError, match=r"heights has the shape \(2, 2\)"):
        planner.plan(Belief(np.ones((3, 3))), SearchState((0, 0)), np.random.default_rng(0))
    with pytest.raises(ValueError, match="must be finite"):
        prices_of(HILLY, np.zeros(4, dtype=np.uint8), 2, True, np.array([0.0, 1.0, np.nan, 2.0]))


def planner_on(prior: NDArray[np.float64], flyable: NDArray[np.bool_] | None = None) -> TourPlanner:
    return TourPlanner(QUICK, fov=FieldOfView.point(0.9, 0.95), motion=MOTION, flyable=flyable)


def hill(rows: int, cols: int) -> NDArray[np.float64]:
    away = (np.arange(rows)[:, None] - rows / 2) ** 2 + (np.arange(cols)[None, :] - cols / 3) ** 2
    return np.asarray(np.exp(-away / 20.0) + 1e-3)


def test_every_path_is_flyable_and_cuts_no_corner_whatever_is_reported() -> None:
    flyable = np.ones((14, 15), dtype=bool)
    flyable[3:11, 7] = flyable[10, 2:8] = False
    belief, rng = Belief(hill(14, 15)), np.random.default_rng(3)
    planner, allowed = planner_on(hill(14, 15), flyable), moves_allowed(flyable)
    state, seen = SearchState((0, 0), "east"), set()
    for step in range(400):
        decision = planner.plan(belief, state, rng)
        here = state.cell
        for cell in decision.path:
            assert allowed[here] >> direction_index(direction_between(here, cell)) & 1
            here = cell
        cell = decision.path[0]
        if step % 97 == 50:  # blown away
            cell = next((r, c) for r, c in np.argwhere(flyable).tolist() if (r, c) == (12, 12))
            state = SearchState((12, 12), "north", 3.0)
        else:
            state = SearchState(cell, direction_between(state.cell, cell), 8.0)
        seen.add(cell)
        belief.observe([cell], bool(rng.random() > 0.95), 0.9, 0.95)
    assert len(seen) > 0.8 * flyable.sum()  # what is left is worth less than a second look at the hill


def test_no_worse_than_any_lawnmower_by_its_own_reckoning() -> None:
    prior = np.ones((9, 12))
    planner = planner_on(prior)
    planner.plan(Belief(prior), SearchState((0, 0), "east"), np.random.default_rng(0))
    desk = planner._desk  # the whole tour and its own price for it: a decision tells only the first cells
    cells, cost = desk.cells(), desk.cost
    nodes = desk.tour.order[1 : desk.size + 1].copy()
    for order in lawnmowers(prior > 0.0, prior > 0.0):
        place = np.empty(order.size, dtype=np.int64)
        place[order] = np.arange(order.size)
        looks = np.lexsort((place[cells], -desk.tour.worth[nodes]))
        desk.tour.order[1 : desk.size + 1] = nodes[looks]
        desk.settle()
        assert cost <= desk.cost + 1e-9


def test_a_strong_report_brings_it_back_at_once_and_a_weak_one_later() -> None:
    for p_tn, soon in ((0.999, True), (0.6, False)):
        belief = Belief(np.ones((12, 12)))
        planner = TourPlanner(QUICK, fov=FieldOfView.point(0.9, p_tn), motion=MOTION)
        state, rng = SearchState((0, 0), "east"), np.random.default_rng(1)
        for _ in range(5):
            cell = planner.plan(belief, state, rng).path[0]
            state = SearchState(cell, direction_between(state.cell, cell), 8.0)
            belief.observe([cell], False, 0.9, p_tn)
        belief.observe([cell], True, 0.9, p_tn)
        path = planner.plan(belief, state, rng).path
        assert (cell in path[:3]) == soon


def test_the_same_seed_gives_the_same_path() -> None:
    paths = [
        planner_on(hill(14, 15))
        .plan(Belief(hill(14, 15)), SearchState((0, 0)), np.random.default_rng(5))
        .path
        for _ in range(2)
    ]
    assert paths[0] == paths[1]


def test_a_copied_belief_with_what_is_expected_to_be_seen_is_no_surprise() -> None:
    belief, rng = Belief(hill(14, 15)), np.random.default_rng(0)
    planner, state = planner_on(hill(14, 15)), SearchState((0, 0), "east")
    first = planner.plan(belief, state, rng).path
    ahead = belief.copy()
    ahead.observe(list(first[:4]), False, 0.9, 0.95)
    state = SearchState(first[3], direction_between(first[2], first[3]), 8.0)
    size = planner._desk.size  # how many looks are planned: a decision tells only the first cells
    planner.plan(ahead, state, rng)
    # neither rebuilt nor doubled, and at the right place: the next path would be alike either way
    assert planner._desk.size <= size - len(set(first[:4])) + 4
    # the same again, of where it thinks it is
    assert planner._at == first[3][0] * 15 + first[3][1]


def test_a_motion_makes_the_default_plan_in_seconds_where_it_can() -> None:
    point = FieldOfView.point()
    assert isinstance(make_planner("puct-regions-lite", fov=point, motion=MOTION), TourPlanner)
    for fov, motion in ((FieldOfView.donut(), MOTION), (point, Motion.steps()), (point, None)):
        assert not isinstance(make_planner("puct-regions-lite", fov=fov, motion=motion), TourPlanner)
    with pytest.raises(ValueError, match="no option 'horizon'"):
        make_planner("puct-regions-lite", fov=point, motion=MOTION, horizon=3)
    with pytest.raises(ValueError, match="window"):
        TourSettings(window=1)


@pytest.mark.filterwarnings("error")
def test_what_is_hardly_worth_a_look_comes_last_in_a_lawnmower_of_levels() -> None:
    """Where a target walks, next to nothing is left in some cells: levels beyond any number came first."""
    cells = np.arange(12)
    worth = np.array([1.0, 0.5, 0.2, 0.0, 5e-324, 1e-310, 1e-290, 1e-31, 1e-29, 0.1, 0.02, 0.01])
    for order in list(swept(cells, worth, 4, 0))[PLAIN:]:
        assert sorted(order.tolist()) == cells.tolist()
        assert set(order[-6:].tolist()) == {3, 4, 5, 6, 7, 8}


@pytest.mark.parametrize(("deadline_s", "hasty"), [(None, False), (60.0, False), (0.01, True)])
def test_a_tour_says_when_there_was_no_time_to_make_a_good_one(deadline_s: float | None, hasty: bool) -> None:
    planner = TourPlanner(TourSettings(looks=300), fov=FieldOfView.point(0.9, 0.95), motion=MOTION)
    rng, belief = np.random.default_rng(0), Belief(hill(14, 15))
    planner.plan(belief, SearchState((0, 0), "east"), rng, deadline_s=deadline_s)
    assert planner.hasty is hasty
    planner.plan(belief, SearchState((0, 0), "east"), rng)
    assert planner.hasty is hasty  # the same plan


def test_a_tour_begins_where_the_aircraft_is_when_it_is_far_from_where_it_was() -> None:
    belief, rng = Belief(np.ones((40, 40))), np.random.default_rng(2)
    planner = planner_on(np.ones((40, 40)))
    planner.plan(belief, SearchState((0, 0), "east"), rng)
    planner.plan(belief, SearchState((39, 39), "north"), rng)
    assert all(max(cell) > 35 for cell in planner.ahead(30))


@pytest.mark.parametrize(("seen", "share"), [(0.0, 0.5), (0.0, 0.99), (0.05, 0.7)])
def test_what_no_look_will_find_does_not_hurry_the_tour(seen: float, share: float) -> None:
    """A wood, a ridge's far side: its mass was charged at the tour's end, and the likely cells were no longer first."""
    visibility = np.ones((14, 28))
    visibility[:, 14:] = seen
    here = np.zeros((14, 28))
    here[:, :14] = hill(14, 14) + 0.002
    here /= here.sum()
    wood = np.zeros((14, 28))
    wood[:, 14:] = 1.0 / 196
    times = []
    for prior in (here, (1.0 - share) * here + share * wood):
        fov = FieldOfView.point(0.9, 0.9)
        planner = TourPlanner(TourSettings(first=100), fov=fov, motion=MOTION, visibility=visibility)
        belief, state, rng = Belief(prior), SearchState((0, 0), "south"), np.random.default_rng(1)
        path = []
        while len(path) < 120:
            path += planner.plan(belief, state, rng).path[:16]
            for cell in path[-16:]:
                belief.observe([cell], False, 0.1 + 0.8 * visibility[cell], 0.9)
            state = SearchState(path[-1], direction_between(path[-2], path[-1]), MOTION.speed_mps)
        arrivals = MOTION.arrivals(path, (0, 0), "south").tolist()
        entered = dict(reversed([*zip(path, arrivals, strict=True)]))
        likely = [cell for cell in np.ndindex(14, 14) if here[cell] > np.median(here[:, :14])]
        times.append(float(np.mean([entered.get(cell, 400.0) for cell in likely])))
    assert times[1] < 1.25 * times[0]


def test_news_of_many_cells_are_taken_in_at_once_where_there_is_no_leisure(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A withdrawn "searched" held a decision of 38 ms up for 0.8 s, and no better tour was made beside the flight."""
    searched = np.argwhere(np.indices((30, 30))[0] < 6)
    belief, rng, state = Belief(np.ones((30, 30))), np.random.default_rng(0), SearchState((20, 20))
    belief.observe(searched, np.zeros(len(searched), dtype=bool), 0.9, 1.0)
    planner = TourPlanner(TourSettings(looks=1200, first=1), fov=FieldOfView.point(0.9, 0.9), motion=MOTION)
    planner.plan(belief, state, rng)
    assert not planner.hasty
    monkeypatch.setattr(Desk, "insert", lambda *_: pytest.fail("one by one"))
    withdrawn = Belief(np.ones((30, 30)))
    decision = planner.plan(withdrawn, state, rng, deadline_s=0.038)
    assert decision.path
    assert planner.hasty
    # what the looks are worth to it is told nowhere else
    desk = planner._desk
    for row, col in searched.tolist():
        first, *_ = desk.looks_at(row * 30 + col)
        assert desk.tour.worth[first] == pytest.approx(0.9 * withdrawn.weights[row * 30 + col])


def test_a_way_around_is_looked_for_once(monkeypatch: pytest.MonkeyPatch) -> None:
    wall = np.ones((9, 9), dtype=bool)
    wall[1:8, 4] = False
    ways = Ways(wall, diagonal=True)
    found = ways.way(4 * 9 + 2, 4 * 9 + 6)
    # that it is not looked for again shows in nothing but the time
    monkeypatch.setattr(Ways, "_search", lambda *_: pytest.fail("again"))
    again = ways.way(4 * 9 + 2, 4 * 9 + 6)
    assert again == found
    again.clear()
    assert ways.way(4 * 9 + 2, 4 * 9 + 6) == found
