"""Cells that are passed again and again without a look: given up, taken up again, and not for a detector's silence."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from service.evidence.overlooked import APART_S, MOST_IN_VAIN, PATIENCE, Overlooked

CLIFF, OPEN = np.array([[2, 3]]), np.array([[0, 1]])


def of_a_good_detector() -> Overlooked:
    """As after a while in which every pass brought a look."""
    overlooked = Overlooked((4, 5))
    for number in range(100):
        overlooked.passed(OPEN, -1000.0 + 9.0 * number)
        overlooked.looked(OPEN)
    return overlooked


def passes(overlooked: Overlooked, count: int, *, seen_elsewhere: bool = True, every_s: float = 30.0) -> int:
    """Pass the cell under the cliff so often, while looks count elsewhere; how many cells are given up."""
    given_up = 0
    for number in range(count):
        given_up += overlooked.passed(CLIFF, number * every_s)
        if seen_elsewhere:
            for _ in range(3):
                overlooked.passed(OPEN, number * every_s + 1.0)
                overlooked.looked(OPEN)
    return given_up


def test_a_cell_that_is_passed_in_vain_again_and_again_is_given_up_once() -> None:
    overlooked = of_a_good_detector()
    assert passes(overlooked, MOST_IN_VAIN) == 0
    assert not overlooked.cells.any()
    assert passes(of_a_good_detector(), MOST_IN_VAIN + 1) == 1
    assert passes(overlooked, 20) == 1
    assert np.argwhere(overlooked.cells).tolist() == CLIFF.tolist()
    assert overlooked.changes == 1


def test_one_look_that_counts_takes_it_up_again() -> None:
    overlooked = of_a_good_detector()
    passes(overlooked, MOST_IN_VAIN + 1)
    assert overlooked.looked(np.vstack([OPEN, CLIFF])) == 1
    assert not overlooked.cells.any()
    assert overlooked.changes == 2
    assert overlooked.looked(CLIFF) == 0
    assert passes(overlooked, MOST_IN_VAIN + 1) == 0, (
        "the count begins anew, and what was seen once can be seen"
    )
    assert passes(overlooked, PATIENCE * MOST_IN_VAIN + 5) == 1


def test_looks_in_between_keep_a_cell() -> None:
    overlooked = of_a_good_detector()
    for _ in range(10):
        assert passes(overlooked, MOST_IN_VAIN - 1) == 0
        overlooked.looked(CLIFF)


def test_while_no_look_counts_anywhere_it_is_not_for_the_cell() -> None:
    overlooked = of_a_good_detector()
    assert passes(overlooked, 50, seen_elsewhere=False) == 0


def test_the_border_of_two_cells_is_no_pass_after_pass() -> None:
    overlooked = of_a_good_detector()
    assert passes(overlooked, 50, every_s=APART_S / 50.0) == 0


@given(seed=st.integers(0, 10_000), every=st.integers(2, 4))
def test_a_detector_that_sends_few_frames_gives_up_few_cells(seed: int, every: int) -> None:
    """Passes bring a look by chance, one of `every`: hardly a cell of a hundred is given up for that."""
    rng, overlooked = np.random.default_rng(seed), Overlooked((10, 10))
    cells = np.argwhere(np.ones((10, 10), dtype=np.bool_))
    now = 0.0
    for _ in range(20):
        for cell in rng.permutation(cells):
            now += APART_S
            overlooked.passed(cell[None], now)
            if rng.random() < 1.0 / every:
                overlooked.looked(cell[None])
    assert overlooked.cells.sum() <= 5
