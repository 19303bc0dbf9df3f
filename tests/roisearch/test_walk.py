"""A target that walks: mass neither made nor lost, the same bits whichever way time passed, and Bayes' rule between."""

from __future__ import annotations

import math
import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from roisearch import Belief, Walk
from roisearch.walk import SHARE, Ways
from roisearch.watch import LOOKED
from tests.roisearch import naive


@st.composite
def on_ground(draw: st.DrawFn) -> tuple[Belief, Ways]:
    """A belief with a few looks taken, and its walk on its map: up to 9 x 9 cells, closed and slow ones among them."""
    rows, cols = draw(st.integers(1, 9)), draw(st.integers(1, 9))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    prior = rng.random((rows, cols)) ** 4
    searchable = rng.random((rows, cols)) > 0.2
    searchable[np.unravel_index(prior.argmax(), prior.shape)] = True
    mobility = np.maximum(rng.uniform(-0.3, 1.0, (rows, cols)), 0.0) if draw(st.booleans()) else None
    walk = Walk(0.5, 20.0, stops_per_hour=draw(st.sampled_from([0.0, 0.3, 50.0])), mobility=mobility)
    belief = Belief(prior, searchable=searchable, outside=draw(st.sampled_from([0.0, 0.2])), walk=walk)
    for cell in np.argwhere(searchable)[: draw(st.integers(0, 5))]:
        belief.observe([cell], False, 0.8, 0.95)
    return belief, walk.ways((rows, cols), searchable)


def walkers() -> st.SearchStrategy[Belief]:
    return on_ground().map(lambda both: both[0])


micros = st.integers(0, 300_000_000)


@given(walkers(), micros)
@settings(max_examples=60, deadline=None)
def test_mass_is_neither_made_nor_lost(belief: Belief, time: int) -> None:
    total, outside = belief.total, belief.outside
    belief.drift(time / 1e6)
    assert belief.probability().sum() + belief.outside == pytest.approx(1.0, abs=1e-12)
    assert belief.total == pytest.approx(total, rel=1e-12)
    assert belief.outside == pytest.approx(outside, rel=1e-12)
    assert (belief.weights >= 0.0).all()
    assert (belief.walking() <= belief.probability()).all()


@given(on_ground(), micros)
@settings(max_examples=40, deadline=None)
def test_closed_cells_keep_what_they_have_and_get_nothing(both: tuple[Belief, Ways], time: int) -> None:
    belief, ways = both
    closed = (ways.into[1:-1, 1:-1] == 0.0).ravel()
    before = belief.weights[closed].copy()
    belief.drift(time / 1e6)
    np.testing.assert_allclose(belief.weights[closed], before, rtol=1e-12, atol=0.0)


@given(walkers(), micros, micros)
@settings(max_examples=60, deadline=None)
def test_two_drifts_are_one_as_long_as_both_to_rounding(belief: Belief, first: int, second: int) -> None:
    whole = belief.copy()
    ticks = belief.drift(first / 1e6) + belief.drift(second / 1e6)
    assert whole.drift((first + second) / 1e6) == ticks
    np.testing.assert_allclose(belief.weights, whole.weights, rtol=1e-11, atol=1e-18)
    np.testing.assert_allclose(belief.walking(), whole.walking(), rtol=1e-11, atol=1e-18)


@given(walkers(), st.lists(micros, max_size=4))
@settings(max_examples=30, deadline=None)
def test_the_same_drifts_and_looks_give_the_same_bits(belief: Belief, times: list[int]) -> None:
    twin = belief.copy()
    for each in (belief, twin):
        for time in times:
            each.drift(time / 1e6)
            each.observe([(0, 0)], False, 0.7, 0.9)
    assert belief.digest() == twin.digest()
    assert pickle.loads(pickle.dumps(belief.probability())).tobytes() == twin.probability().tobytes()


@given(on_ground(), st.integers(0, 20))
@settings(max_examples=40, deadline=None)
def test_the_kernel_is_its_plain_twin(both: tuple[Belief, Ways], ticks: int) -> None:
    (belief, ways), (rows, cols) = both, both[0].shape
    into = ways.into[1 : rows + 1, 1 : cols + 1]
    before = belief.weights.reshape(rows, cols).copy()
    assert belief.drift(ticks * ways.walk.tick_us / 1e6) == ticks
    walks, stopped = naive.walked(before, into, ways.stops, ticks)
    np.testing.assert_allclose(belief.weights.reshape(rows, cols), walks + stopped, rtol=1e-9, atol=1e-15)
    np.testing.assert_allclose(belief.walking() * belief.total, walks, rtol=1e-9, atol=1e-15)


def in_the_middle(size: int, **options: float) -> Belief:
    prior = np.zeros((size, size))
    prior[size // 2, size // 2] = 1.0
    return Belief(prior, walk=Walk(0.5, 10.0, **options))


def test_a_walker_spreads_as_a_random_tour_does() -> None:
    belief, seconds = in_the_middle(121), 1200.0
    belief.drift(seconds)
    away = (np.indices((121, 121))[0] - 60) * 10.0
    variance = float((belief.probability() * away**2).sum())
    assert variance == pytest.approx(2.0 * (0.5**2 * 60.0 / 2.0) * seconds, rel=0.01)


def test_who_stops_does_so_at_the_rate_that_was_given() -> None:
    belief = in_the_middle(41, stops_per_hour=2.0)
    belief.drift(1800.0)
    assert belief.walking().sum() == pytest.approx(math.exp(-1.0), rel=0.01)
    belief.drift(100 * 3600.0)
    rest = belief.probability()
    belief.drift(3600.0)
    np.testing.assert_allclose(belief.probability(), rest, atol=1e-12)


def test_nobody_enters_closed_cells_and_paths_are_kept_to() -> None:
    prior, open_cells = np.zeros((9, 9)), np.ones((9, 9), dtype=bool)
    prior[4, 0] = 1.0
    open_cells[:, 4] = False
    open_cells[0, 4] = True  # the one gap in a wall
    mobility = np.full((9, 9), 0.2)
    mobility[4] = 1.0
    belief = Belief(prior, searchable=open_cells, walk=Walk(0.5, 10.0, mobility=mobility))
    belief.drift(300.0)
    assert belief.probability()[1:, 4].sum() == 0.0
    assert 0.0 < belief.probability()[:, 5:].sum() < 0.5
    belief.drift(1e6)
    there = belief.probability()
    np.testing.assert_allclose(
        there[open_cells], (mobility / mobility[open_cells].sum())[open_cells], rtol=1e-6
    )


def test_a_searched_place_fills_up_again_unless_the_target_has_stopped() -> None:
    still, walks = Belief(np.ones((15, 15))), Belief(np.ones((15, 15)), walk=Walk(0.5, 10.0))
    for belief in (still, walks):
        belief.observe([(7, 7)], False, 0.9, 0.99)
        before = float(belief.mass_at([(7, 7)])[0])
        assert (belief.drift(120.0) > 0) is (belief is walks)
        now = float(belief.mass_at([(7, 7)])[0])
        assert now > 3.0 * before if belief is walks else now == before


def test_looks_leave_the_part_that_walks_as_it_is() -> None:
    belief = in_the_middle(9, stops_per_hour=5.0)
    belief.drift(600.0)
    part = belief.walking()[4, 4] / belief.probability()[4, 4]
    belief.observe([(4, 4)], True, 0.9, 0.95)
    assert belief.walking()[4, 4] / belief.probability()[4, 4] == pytest.approx(part, rel=1e-12)


def test_a_hit_is_remembered_as_long_as_it_raises_its_cell_above_what_no_looks_would_leave() -> None:
    belief = Belief(np.ones((9, 9)), walk=Walk(0.5, 10.0))
    looked = belief.follow(LOOKED)
    belief.observe([(4, 4)], True, 0.9, 0.95)
    belief.drift(10.0)
    every = np.arange(81)
    assert np.flatnonzero(looked.raised(every, belief.weights)).tolist() == [
        40
    ]  # its neighbours are higher too
    for _ in range(3):
        belief.observe([(4, 4)], False, 0.9, 0.95)
    assert not looked.raised(every, belief.weights).any()
    copy = belief.copy()
    copy.observe([(4, 4)], True, 0.99, 0.999)
    assert copy.follow(LOOKED).raised(every, copy.weights)[40]


@pytest.mark.parametrize("bad", [-1.0, math.nan, math.inf, 1e9])
def test_time_that_cannot_pass_is_refused(bad: float) -> None:
    belief = in_the_middle(3)
    before = belief.digest()
    with pytest.raises(ValueError, match="seconds"):
        belief.drift(bad)
    assert belief.digest() == before


@pytest.mark.parametrize(
    ("options", "word"),
    [
        ({"speed_mps": 0.0}, "speed_mps"),
        ({"speed_mps": math.nan}, "speed_mps"),
        ({"cell_m": -1.0}, "cell_m"),
        ({"straight_s": math.inf}, "straight_s"),
        ({"stops_per_hour": -0.1}, "stops_per_hour"),
        ({"mobility": [[1.5]]}, "mobility"),
        ({"mobility": [[math.nan]]}, "mobility"),
    ],
)
def test_a_walk_that_cannot_be_is_refused(options: dict[str, object], word: str) -> None:
    good: dict[str, object] = {"speed_mps": 0.5, "cell_m": 10.0}
    with pytest.raises(ValueError, match=word):
        Walk(**{**good, **options})  # type: ignore[arg-type]


def test_a_mobility_of_another_map_is_refused() -> None:
    with pytest.raises(ValueError, match="shape"):
        Belief(np.ones((3, 4)), walk=Walk(0.5, 10.0, mobility=np.ones((4, 3))))


@pytest.mark.parametrize(("speed", "cell"), [(0.01, 200.0), (0.5, 10.0), (3.0, 0.001)])
def test_at_least_half_of_all_stay_for_a_tick(speed: float, cell: float) -> None:
    walk = Walk(speed, cell)
    into: NDArray[np.float64] = walk.ways((3, 3), None).into
    assert walk.tick_us >= 1
    assert 0.0 < into.max() <= 2.0 * SHARE
