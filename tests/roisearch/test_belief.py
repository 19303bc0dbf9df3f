"""The belief is Bayes' rule, exactly, whatever the order and however long the search."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from roisearch import Belief
from tests.roisearch import naive

PRIOR = np.array([[1.0, 2.0, 3.0, 0.0], [4.0, 5.0, 6.0, 1.0], [1.0, 1.0, 9.0, 2.0]])
looks = st.tuples(
    st.tuples(st.integers(0, 2), st.integers(0, 3)),
    st.booleans(),
    st.floats(0.05, 0.95),
    st.floats(0.05, 0.95),
)


def observed(belief: Belief, seen: list[tuple[tuple[int, int], bool, float, float]]) -> Belief:
    for cell, hit, p_tp, p_tn in seen:
        belief.observe([cell], [hit], p_tp, p_tn)
    return belief


@given(st.lists(looks, max_size=40), st.floats(0.0, 0.9))
@settings(max_examples=60, deadline=None)
def test_observations_follow_bayes_rule(seen: list, outside: float) -> None:
    belief = observed(Belief(PRIOR, outside=outside), seen)
    expected, out = naive.posterior(PRIOR, outside, seen)
    np.testing.assert_allclose(belief.probability(), expected, rtol=1e-9, atol=1e-300)
    assert belief.outside == pytest.approx(out, rel=1e-9, abs=1e-300)


@given(st.lists(looks, max_size=60), st.floats(0.0, 0.9))
@settings(max_examples=60, deadline=None)
def test_mass_sums_to_one(seen: list, outside: float) -> None:
    belief = observed(Belief(PRIOR, outside=outside), seen)
    assert belief.probability().sum() + belief.outside == pytest.approx(1.0, abs=1e-12)


@given(st.lists(looks, max_size=30))
@settings(max_examples=30, deadline=None)
def test_the_same_looks_in_the_same_order_give_the_same_bits(seen: list) -> None:
    first, second = observed(Belief(PRIOR), seen), observed(Belief(PRIOR), seen)
    assert first.digest() == second.digest()
    assert first.total == second.total


def test_one_observation_of_many_cells_equals_many_of_one() -> None:
    together, apart = Belief(PRIOR), Belief(PRIOR)
    together.observe([(0, 0), (1, 2), (2, 3)], [False, True, False], [0.9, 0.8, 0.7], [0.6, 0.9, 0.95])
    apart.observe([(0, 0)], [False], 0.9, 0.6)
    apart.observe([(1, 2)], [True], 0.8, 0.9)
    apart.observe([(2, 3)], [False], 0.7, 0.95)
    assert together.digest() == apart.digest()


@pytest.mark.parametrize("hit", [True, np.True_, np.array(True), 1, [True]])
@pytest.mark.parametrize("p_tp", [1, 1.0, np.float32(1.0), np.array(1.0), [1.0]])
def test_one_value_for_all_looks_may_be_any_number(hit: object, p_tp: object) -> None:
    one, plain = Belief(PRIOR), Belief(PRIOR)
    one.observe([(0, 0), (1, 2)], hit, p_tp, np.float64(0.75))
    plain.observe([(0, 0), (1, 2)], [True, True], [1.0, 1.0], [0.75, 0.75])
    assert one.digest() == plain.digest()


def test_ten_thousand_misses_do_not_lose_the_total() -> None:
    belief = Belief(np.ones((20, 20)))
    for step in range(10_000):
        belief.observe([(step % 20, step // 20 % 20)], [False], 0.9, 0.9)
    assert belief.probability().sum() == pytest.approx(1.0, abs=1e-12)
    np.testing.assert_allclose(belief.probability(), 1 / 400, rtol=1e-9)


def test_misses_move_mass_outside() -> None:
    belief = Belief(PRIOR, outside=0.1)
    before = belief.outside
    belief.observe([(1, 1)], [False], 0.9, 0.9)
    assert belief.outside > before


def test_a_hit_without_false_alarms_leaves_no_other_place() -> None:
    belief = Belief(PRIOR, outside=0.1)
    belief.observe([(1, 1), (1, 2)], [True, False], 0.9, 1.0)
    assert belief.mass_at([(1, 1)])[0] == 1.0
    assert belief.outside == 0.0


def test_an_impossible_observation_is_refused_and_changes_nothing() -> None:
    belief = Belief(np.ones((1, 2)))
    belief.observe([(0, 0)], [False], 1.0, 0.9)
    before = belief.digest()
    with pytest.raises(ValueError, match="no target anywhere"):
        belief.observe([(0, 1)], [False], 1.0, 0.9)
    assert belief.digest() == before


@pytest.mark.parametrize(
    ("cells", "p_tp", "p_tn", "words"),
    [
        ([(3, 0)], 0.9, 0.9, r"cell \(3, 0\) is outside"),
        ([(0, 0)], 1.2, 0.9, "p_tp"),
        ([(0, 0)], 0.9, 0.0, "p_tn"),
    ],
)
def test_bad_looks_are_refused_by_name(cells: list, p_tp: float, p_tn: float, words: str) -> None:
    belief = Belief(PRIOR)
    before = belief.digest()
    with pytest.raises(ValueError, match=words):
        belief.observe(cells, [False], p_tp, p_tn)
    assert belief.digest() == before


@pytest.mark.parametrize(
    "prior", [np.zeros((2, 2)), np.array([[1.0, np.nan]]), np.array([[1.0, -1.0]]), np.ones(3)]
)
def test_bad_priors_are_refused(prior: np.ndarray) -> None:
    with pytest.raises(ValueError, match="prior"):
        Belief(prior)


def test_unsearchable_cells_hold_nothing_even_after_a_hit() -> None:
    belief = Belief(PRIOR, searchable=PRIOR > 1.5)
    belief.observe([(0, 0)], [True], 0.9, 0.9)
    assert belief.mass_at([(0, 0)])[0] == 0.0


def test_a_copy_is_independent() -> None:
    belief = Belief(PRIOR)
    twin = belief.copy()
    twin.observe([(0, 0)], [False], 0.9, 0.9)
    assert belief.digest() == Belief(PRIOR).digest() != twin.digest()


def test_entropy_of_a_uniform_belief_is_the_logarithm_of_its_cells() -> None:
    assert Belief(np.ones((8, 8))).entropy() == pytest.approx(6.0)
