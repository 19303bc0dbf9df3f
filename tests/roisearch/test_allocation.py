"""Sharing a search out: what the shares are, and that those who start on one hill find it sooner by them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from roisearch import Belief, FieldOfView, Fleet, SearchState, allocation
from roisearch.allocation import shares

MASSES = arrays(
    float, array_shapes(min_dims=2, max_dims=2, max_side=12), elements=st.sampled_from([0.0, 0.5, 1.0, 3.0])
)
RATES = st.lists(st.floats(0.2, 5.0), min_size=1, max_size=5)


@given(MASSES, RATES, st.integers(0, 2**32))
def test_all_mass_is_in_a_share_and_each_has_its_part_but_for_a_cell_at_each_line(
    mass: np.ndarray, rates: list[float], seed: int
) -> None:
    of = shares(mass, rates, np.random.default_rng(seed))
    assert ((of >= 0) == (mass > 0.0)).all()
    parts = np.array([mass[of == number].sum() for number in range(len(rates))])
    lines = np.ceil(np.log2(len(rates))) if len(rates) > 1 else 0.0
    assert np.abs(parts - mass.sum() * np.array(rates) / sum(rates)).max() <= (lines + 1e-9) * max(
        mass.max(), 1.0
    )


def test_of_a_map_with_more_cells_than_are_reckoned_with_the_heaviest_are_shared(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(allocation, "MOST", 10)
    mass = np.arange(36.0).reshape(6, 6)
    of = shares(mass, [1.0, 1.0], np.random.default_rng(1))
    assert sorted(mass[of >= 0]) == list(range(26, 36))


def expected_of_three(monkeypatch: pytest.MonkeyPatch, cuts: int) -> float:
    monkeypatch.setattr(allocation, "CUTS", cuts)
    row, col = np.indices((60, 60))
    belief = Belief(np.exp(-((row - 30) ** 2 + (col - 30) ** 2) / 128.0))
    fleet, rng = Fleet(iterations=2, horizon=400), np.random.default_rng(1)
    states = {str(number): SearchState((30, 30 + number)) for number in range(3)}
    for name in states:
        fleet.join(name, fov=FieldOfView.point(0.9, 1.0))
    fleet.allocate(belief, states, rng, now_s=0.0)
    return -fleet.plan("2", belief, states["2"], rng, now_s=0.0).value


def test_three_on_one_hill_expect_it_sooner_where_each_begins_with_a_share(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    assert expected_of_three(monkeypatch, 16) < 0.97 * expected_of_three(monkeypatch, 0)
