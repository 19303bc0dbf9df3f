"""What is kept beside a belief: counts of looks that outlive everything, and sums that can be had anew."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from numpy.typing import NDArray

from roisearch import Belief
from roisearch.forest import Forest
from roisearch.watch import DEEPEST, LONGEST_TRAIL, LOOKED, Mark, Trail, Watch


def contradicted(belief: Belief, cells: NDArray[np.int64]) -> NDArray[np.int64]:
    return belief.follow(LOOKED).contradicted(cells, belief.weights)


@pytest.mark.parametrize(
    ("looks", "p_tn", "pairs"),
    [
        ([], 0.9, 0),
        ([False, False, False], 0.9, 0),
        ([True], 0.9, 0),
        ([True, False], 0.9, 1),
        ([False, True], 0.9, 1),
        ([True, False, True], 0.9, 0),  # the hits outweigh the miss
        ([True, False, True, False], 0.9, 2),
        ([True, False, False], 0.9, 1),
        ([True, False], 0.98, 0),  # a hit of this detector says more than a miss
        ([True, False, False], 0.98, 1),
    ],
)
def test_contradicted_are_hits_that_misses_outweigh(looks: list[bool], p_tn: float, pairs: int) -> None:
    belief = Belief(np.ones((2, 3)))
    belief.follow(LOOKED)
    for hit in looks:
        belief.observe([(1, 1)], hit, 0.9, p_tn)
    assert contradicted(belief, np.array([0, 4])).tolist() == [0, pairs]
    thought = belief.copy()
    thought.observe([(1, 1), (0, 0)], False, 0.9, p_tn)  # what is only expected stays with the copy
    assert contradicted(thought, np.array([0])).tolist() == [0]
    assert contradicted(belief, np.array([0, 4])).tolist() == [0, pairs]


def test_contradicted_outlasts_rescaling_and_a_refused_observation() -> None:
    belief = Belief(np.ones((1, 2)))
    belief.follow(LOOKED)
    for hit in (True, False):
        belief.observe([(0, 1)], hit, 0.9, 0.9)
    for _ in range(700):
        belief.observe([(0, 0), (0, 1)], True, 0.9, 0.3)
    for _ in range(700):
        belief.observe([(0, 0), (0, 1)], False, 1.0 - 0.7 / 0.9 * 0.3, 0.3)
    with pytest.raises(ValueError, match="explain"):
        belief.observe([(0, 0), (0, 1)], False, 1.0, 0.9)
    hits = contradicted(belief, np.array([0, 1]))
    assert hits[1] == hits[0] + 1


def test_counts_of_looks_stay_however_many_sums_are_asked_for() -> None:
    belief = Belief(np.ones((2, 3)))
    counts = belief.follow(LOOKED)
    forests = [Forest(np.zeros((2, 3), dtype=np.int64), 1) for _ in range(7)]
    sums = [belief.follow(forest) for forest in forests]
    assert belief.follow(LOOKED) is counts
    assert belief.follow(forests[-1]) is sums[-1]
    assert belief.follow(forests[0]) is not sums[0]
    belief.observe([(1, 1)], True, 0.9, 0.9)
    assert belief.follow(forests[0]).sums[0] == sums[-1].sums[0]


def test_a_belief_from_another_process_has_the_same_counts() -> None:
    belief = Belief(np.ones((2, 3)))
    belief.follow(LOOKED)
    for hit in (True, False):
        belief.observe([(1, 1)], hit, 0.9, 0.9)
    again = pickle.loads(pickle.dumps(belief))
    again.observe([(0, 1)], True, 0.9, 0.9)
    assert contradicted(again, np.arange(6)).tolist() == [0, 0, 0, 0, 1, 0]
    assert again.follow(LOOKED).raised(np.arange(6), again.weights).tolist() == [False, True] + [False] * 4


def test_changes_are_told_once_and_to_the_copy_of_a_belief_all() -> None:
    belief, watch = Belief(np.ones((2, 3))), Watch()
    assert belief.follow(watch).take() == (True, [])
    belief.observe([(1, 1), (0, 2)], False, 0.9, 0.9)
    copied = belief.copy()
    everything, cells = belief.follow(watch).take()
    assert (everything, np.concatenate(cells).tolist()) == (False, [[1, 1], [0, 2]])
    assert belief.follow(watch).take() == (False, [])
    assert copied.follow(watch).take() == (True, [])


def where(now: Mark, before: Mark) -> list[tuple[int, int]] | None:
    cells = now.apart_from(before)
    return None if cells is None else sorted({(int(row), int(col)) for each in cells for row, col in each})


def test_two_copies_differ_where_either_or_their_original_was_looked_at_between() -> None:
    belief = Belief(np.ones((3, 3)))
    marks = [belief.follow(LOOKED).mark()]
    for at in [(0, 0), (0, 1)]:
        belief.observe([at], False, 0.9, 0.9)
        thought = belief.copy()
        thought.observe([(2, at[1])], False, 0.9, 0.9)  # what is only expected
        marks.append(thought.follow(LOOKED).mark())
    belief.observe([(1, 1)], True, 0.9, 0.9)
    assert where(marks[1], marks[0]) == [(0, 0), (2, 0)]
    assert where(marks[2], marks[1]) == [(0, 1), (2, 0), (2, 1)] == where(marks[1], marks[2])
    assert where(belief.follow(LOOKED).mark(), marks[2]) == [(1, 1), (2, 1)]
    assert where(belief.copy().copy().follow(LOOKED).mark(), marks[2]) == [(1, 1), (2, 1)]
    assert where(Belief(np.ones((3, 3))).follow(LOOKED).mark(), marks[2]) is None


def test_nobody_knows_where_a_rescaled_belief_or_one_with_a_long_past_differs() -> None:
    belief = Belief(np.ones((1, 2)))
    before = belief.follow(LOOKED).mark()
    belief.follow(LOOKED).renew(belief.weights, 2.0)
    assert where(belief.follow(LOOKED).mark(), before) is None
    trail = Trail()
    before = trail.mark()
    for _ in range(DEEPEST + 1):
        trail.add(np.zeros((1, 2), dtype=np.int64))
        trail = trail.copy()
    assert where(trail.mark(), before) is None
    assert LONGEST_TRAIL > 1000
