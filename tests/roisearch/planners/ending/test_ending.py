"""The end of a battery: courses against a slow twin, never too late, and never less than being cut off."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from roisearch import Belief, Decision, FieldOfView, Motion, Planner, SearchState, make_planner
from roisearch.decision import Cell
from roisearch.directions import DIRECTIONS, moves_allowed
from roisearch.endurance import Endurance, straight_home
from roisearch.kernels.orienteering import Field, Outset, judge, lay, room_for
from roisearch.planners.ending import EndingPlanner
from roisearch.planners.ending.settings import EndingSettings
from roisearch.planners.ways import Ways

SHAPE = (20, 24)
MOTION = Motion(cell_m=25.0, speed_mps=8.0, acceleration_mps2=1.5, descent_mps=1.0, slack_m=(3.0, 8.0))
FOV = FieldOfView.point(0.9, 0.99)
HOME = (0, 0)
STEEP = 9.0 * np.abs(np.arange(20.0)[:, None] - 7.0) + 4.0 * np.arange(24.0)
"""Heights: a gorge that rises to the east, in metres."""
HOME_S = straight_home(MOTION, SHAPE, HOME, 40.0)


def hill(row: float, col: float, width: float = 3.0) -> np.ndarray:
    down, right = np.indices(SHAPE)
    return np.exp(-((down - row) ** 2 + (right - col) ** 2) / (2.0 * width**2)) + 1e-3


def slow_worth(
    path: list[Cell],
    state: SearchState,
    belief: Belief,
    endurance: Endurance,
    heights: np.ndarray | None = None,
) -> tuple[float, int]:
    """The plain twin: Motion's arrivals, and Bayes' rule on a copy of the belief, until the first cell that is late."""
    mass, found = belief.probability(), 0.0
    along = None if heights is None else [heights[cell] for cell in (state.cell, *path)]
    times = MOTION.arrivals(path, state.cell, state.heading, state.speed_mps, along)
    for count, (cell, seconds) in enumerate(zip(path, times, strict=True)):
        if seconds + endurance.home_s[cell] > endurance.remaining_s:
            return found, count
        found += 0.9 * float(mass[cell])
        mass[cell] *= 0.1
    return found, len(path)


def planned(planner: Planner, **options: object) -> EndingPlanner:
    return EndingPlanner(planner, fov=FOV, motion=MOTION, settings=EndingSettings(**options))  # type: ignore[arg-type]


def default() -> Planner:
    return make_planner("puct-regions-lite", fov=FOV, motion=MOTION, looks=600)


def course(planner: EndingPlanner, belief: Belief, state: SearchState, left: Endurance) -> list[Cell]:
    """Fly decision after decision, all looks in vain, until nothing can be entered any more."""
    path: list[Cell] = []
    rng, now, remaining, start = np.random.default_rng(1), 0.0, left.remaining_s, state
    while len(path) < 500:
        decision = planner.plan(belief, state, rng, endurance=Endurance(remaining - now, left.home_s))
        for cell in decision.path[:6]:
            down, right = cell[0] - state.cell[0], cell[1] - state.cell[1]
            heading = DIRECTIONS[
                [(-1, 0), (-1, 1), (0, 1), (1, 1), (1, 0), (1, -1), (0, -1), (-1, -1)].index((down, right))
            ]
            path.append(cell)
            state = SearchState(cell, heading, MOTION.speed_mps)
            belief.observe([cell], False, 0.9, 0.99)
        now = float(MOTION.arrivals(path, start.cell, start.heading, start.speed_mps)[-1])
        if now + left.home_s[state.cell] > remaining:
            return path
    raise AssertionError("the battery never ends")


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.integers(0, SHAPE[0] * SHAPE[1] - 1), min_size=1, max_size=8),
    st.integers(0, 7),
    st.floats(0.0, 8.0),
    st.floats(20.0, 400.0),
    st.booleans(),
    st.sampled_from((None, STEEP)),
)
def test_a_course_is_laid_and_judged_as_its_plain_twin_does(
    stops: list[int],
    direction: int,
    speed: float,
    remaining: float,
    diagonal: bool,
    heights: np.ndarray | None,
) -> None:
    motion = MOTION if diagonal else Motion(cell_m=25.0, diagonal=False)
    direction = direction if diagonal else direction // 2 * 2
    belief = Belief(hill(9, 14))
    ways = Ways(np.ones(SHAPE, dtype=bool), diagonal)
    expected: list[int] = []
    at, heading = 5 * SHAPE[1] + 5, direction
    for stop in stops:
        way = ways.way(at, stop, heading)
        for a, b in zip([at, *way], way, strict=False):
            heading = [-24, -23, 1, 25, 24, 23, -1, -25].index(b - a)
        expected, at = expected + way, stop
    allowed = moves_allowed(np.ones(SHAPE, dtype=bool), diagonal).ravel()
    mass = belief.probability().ravel().copy()
    field = Field(
        mass,
        np.full(480, 0.9),
        HOME_S.ravel(),
        allowed,
        np.arange(480),
        SHAPE[1],
        diagonal,
        motion.climb(heights),
    )
    pose, room = Outset(5 * SHAPE[1] + 5, direction, speed, remaining), room_for(600)
    count = lay(pose, np.array(stops), len(stops), field, room)
    assert (room.rows[1 : count + 1] * SHAPE[1] + room.cols[1 : count + 1]).tolist() == expected
    found, entered = judge(pose, count, field, motion.pace, room)
    path = [divmod(cell, SHAPE[1]) for cell in expected]
    if diagonal and path:
        state = SearchState((5, 5), DIRECTIONS[direction], speed)
        worth, cells = slow_worth(path, state, belief, Endurance(remaining, HOME_S), heights)
        assert found == pytest.approx(worth)
        assert entered == cells
    np.testing.assert_array_equal(mass, belief.probability().ravel())  # judging changes nothing


@pytest.mark.parametrize(("row", "col"), [(15.0, 18.0), (5.0, 20.0), (17.0, 4.0)])
def test_by_its_own_reckoning_the_end_finds_no_less_than_being_cut_off(row: float, col: float) -> None:
    left = Endurance(220.0, HOME_S)
    worth = {}
    for name, horizon in (("cut", 0.0), ("planned", 900.0)):
        belief, state = Belief(hill(row, col) + 0.2 * hill(8, 8)), SearchState(HOME, "east")
        path = course(planned(default(), horizon_s=horizon), belief.copy(), state, left)
        worth[name], entered = slow_worth(path, state, belief, left)
        times = MOTION.arrivals(path, HOME, "east")
        assert times[entered - 1] + HOME_S[path[entered - 1]] <= left.remaining_s
    assert worth["planned"] >= worth["cut"]
    assert worth["planned"] > 1.02 * worth["cut"]  # and here it is more


def test_what_lies_beside_the_way_home_is_looked_at_on_it() -> None:
    """From the far corner, with time for a detour, and a hill beside the straight way."""
    belief = Belief(hill(6, 15, 1.5))
    far = SearchState((18, 22), "west", 8.0)
    left = Endurance(float(HOME_S[far.cell]) + 40.0, HOME_S)
    path = course(planned(default()), belief.copy(), far, left)
    found, _ = slow_worth(path, far, belief, left)
    assert found > 0.3


class Fixed:
    """A planner that always goes north."""

    name = "fixed"

    def plan(
        self, belief: Belief, state: SearchState, rng: np.random.Generator, *, deadline_s: float | None = None
    ) -> Decision:
        from roisearch.decision import Effort

        return Decision(((state.cell[0] - 1, state.cell[1]),), "north", 0.0, Effort(0, 0.0))

    def warm_up(self, progress: object = None) -> None:
        """Nothing to compile."""


@pytest.mark.parametrize(
    ("endurance", "prior", "fov"),
    [
        (None, hill(15, 18), FOV),  # nobody knows how long the battery lasts
        (Endurance(5000.0, HOME_S), hill(15, 18), FOV),  # long
        (Endurance(10.0, HOME_S), hill(15, 18), FOV),  # too short for a single cell
        (Endurance(300.0, HOME_S), hill(9, 9, 0.3), FOV),  # a suspect
        (Endurance(300.0, HOME_S), hill(15, 18), FieldOfView.donut()),  # not planned for
    ],
)
def test_elsewhere_the_planner_that_flies_decides(
    endurance: Endurance | None, prior: np.ndarray, fov: FieldOfView
) -> None:
    planner = EndingPlanner(Fixed(), fov=fov, motion=MOTION)
    decision = planner.plan(
        Belief(prior), SearchState((10, 10)), np.random.default_rng(1), endurance=endurance
    )
    assert decision.path == ((9, 10),)


def test_the_course_keeps_to_flyable_ground_and_the_same_seed_gives_the_same() -> None:
    flyable = np.ones(SHAPE, dtype=bool)
    flyable[4:15, 10] = flyable[4, 4:10] = False
    belief, state = Belief(hill(8, 13), searchable=flyable), SearchState((6, 6), "east", 8.0)
    left = Endurance(200.0, HOME_S)
    paths = []
    for _ in range(2):
        default_ = make_planner("puct-regions-lite", fov=FOV, motion=MOTION, flyable=flyable, looks=600)
        planner = EndingPlanner(default_, fov=FOV, motion=MOTION, flyable=flyable)
        paths.append(course(planner, belief.copy(), state, left))
    assert paths[0] == paths[1]
    allowed = moves_allowed(flyable, True)
    before = state.cell
    for cell in paths[0]:
        step = (cell[0] - before[0], cell[1] - before[1])
        direction = [(-1, 0), (-1, 1), (0, 1), (1, 1), (1, 0), (1, -1), (0, -1), (-1, -1)].index(step)
        assert allowed[before] >> direction & 1
        before = cell


def test_a_deadline_that_is_over_costs_the_improvement_and_not_the_decision() -> None:
    planner = planned(default())
    decision = planner.plan(
        Belief(hill(15, 18)), SearchState((0, 0)), np.random.default_rng(1), deadline_s=0.0,
        endurance=Endurance(300.0, HOME_S),
    )  # fmt: skip
    assert decision.path


@pytest.mark.parametrize(
    ("remaining", "home", "said"),
    [(np.nan, HOME_S, "remaining_s"), (1.0, HOME_S - 1e6, "home_s"), (1.0, HOME_S[0], "home_s")],
)
def test_an_endurance_that_cannot_be_is_refused(remaining: float, home: np.ndarray, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        Endurance(remaining, home)


def test_ways_home_of_another_map_are_refused() -> None:
    with pytest.raises(ValueError, match=r"the belief's map is \(20, 24\), home_s is \(3, 3\)"):
        planned(Fixed()).plan(
            Belief(hill(1, 1)),
            SearchState((5, 5)),
            np.random.default_rng(1),
            endurance=Endurance(9.0, np.ones((3, 3))),
        )
