"""What looks that contradict each other count for in planning."""

from __future__ import annotations

import numpy as np
import pytest

from roisearch import Belief
from roisearch.planners.looks import Evidence

ALARMING, RELIABLE = 0.9, 0.98


@pytest.mark.parametrize(
    ("looks", "p_tn", "pairs"),
    [
        ([], ALARMING, 0),
        ([False, False, False], ALARMING, 0),
        ([True], ALARMING, 0),
        ([True, False], ALARMING, 1),
        ([False, True], ALARMING, 1),
        ([True, False, True], ALARMING, 0),  # the hits outweigh the miss
        ([True, False, True, False], ALARMING, 2),
        ([True, False, False], ALARMING, 1),
        ([True, False], RELIABLE, 0),  # a hit of this detector says more than a miss
        ([True, False, False], RELIABLE, 1),
    ],
)
def test_only_hits_that_misses_outweigh_are_discounted(looks: list[bool], p_tn: float, pairs: int) -> None:
    belief = Belief(np.ones((2, 3)))
    evidence = Evidence(belief.weights)
    there, here = np.array([4]), np.array([0])
    for hit in looks:
        belief.observe([(1, 1)], hit, 0.9, p_tn)
        evidence.note(np.array([0, 4]), belief.weights[[0, 4]])
    assert evidence.discount(there, 0.2) == pytest.approx(0.2**pairs)
    assert evidence.discount(there, 1.0) == 1.0
    assert evidence.discount(here, 0.2) == 1.0


def test_a_miss_that_rules_a_cell_out_leaves_it_at_nothing() -> None:
    evidence = Evidence(np.ones(3))
    for weight in (9.0, 0.0, 0.0):
        evidence.note(np.array([2]), np.array([weight]))
    assert evidence.discount(np.array([2]), 0.2) == pytest.approx(0.2)
