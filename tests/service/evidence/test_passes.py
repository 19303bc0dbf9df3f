"""One look per cell per pass, whatever the order in which the frames arrive."""

from __future__ import annotations

import math
import random
from itertools import groupby

import pytest
from hypothesis import given
from hypothesis import strategies as st

from service.evidence.passes import SILENT_S, CellLook, Change, Passes, as_likelihoods

HERE, THERE = (3, 4), (3, 5)
P_TN = 0.8
MISS = CellLook(True, 0.9, P_TN)
PARTLY = CellLook(False, 0.9, P_TN)


def hit(ratio: float, counts: bool = True) -> CellLook:
    return CellLook(counts, 0.9, P_TN, ratio)


def factor(changes: list[Change]) -> float:
    """What the changes multiply the odds by, as the belief does it."""
    return math.prod(
        change.p_tp / (1.0 - change.p_tn) if change.hit else (1.0 - change.p_tp) / change.p_tn
        for change in changes
    )


def looks(changes: list[Change]) -> int:
    return sum(change.first and change.p_tn < 1.0 for change in changes)


# ---- against a plain twin

Frames = list[tuple[float, CellLook | None]]
FRAME = st.none() | st.builds(
    CellLook,
    counts=st.booleans(),
    p_tp=st.sampled_from([0.3, 0.6, 0.9]),
    p_tn=st.just(P_TN),
    ratio=st.none() | st.sampled_from([0.05, 0.7, 4.5, 90.0]),
)
FRAMES = st.lists(FRAME, max_size=40).map(lambda frames: [(float(t), each) for t, each in enumerate(frames)])


def plain(frames: Frames) -> tuple[int, float]:
    """Looks and factor of one cell's frames in their order: each run that shows the cell is worth its best frame."""
    count, worth = 0, 1.0
    for shown, run in groupby(frames, key=lambda frame: frame[1] is not None):
        said = [look for _, look in run if look is not None and (look.counts or look.ratio is not None)]
        if shown and said:
            hits = [look.ratio for look in said if look.ratio is not None]
            count += 1
            worth *= max(hits) if hits else min((1.0 - look.p_tp) / P_TN for look in said)
    return count, worth


def through(passes: Passes, frames: Frames, source: str = "camera") -> list[Change]:
    changes = []
    for moment, look in frames:
        changes += passes.take(source, moment, {} if look is None else {HERE: look})
    return changes


@given(FRAMES)
def test_in_order_every_pass_is_one_look_worth_its_best_frame(frames: Frames) -> None:
    changes = through(Passes(), frames)
    count, worth = plain(frames)
    assert looks(changes) == count
    assert factor(changes) == pytest.approx(worth, rel=1e-9)


@given(FRAMES, st.randoms(use_true_random=False))
def test_in_any_order_there_is_never_more_than_one_look_per_pass(
    frames: Frames, shuffling: random.Random
) -> None:
    shuffled = frames.copy()
    shuffling.shuffle(shuffled)
    assert looks(through(Passes(), shuffled)) <= plain(frames)[0]


@given(FRAMES.filter(lambda frames: all(look for _, look in frames)), st.randoms(use_true_random=False))
def test_the_frames_of_one_pass_are_worth_the_same_in_any_order(
    frames: Frames, shuffling: random.Random
) -> None:
    shuffled = frames.copy()
    shuffling.shuffle(shuffled)
    assert factor(through(Passes(), shuffled)) == pytest.approx(plain(frames)[1], rel=1e-9)


# ---- late frames


def test_a_late_frame_of_an_earlier_pass_is_no_new_pass() -> None:
    passes = Passes()
    seen = [(1.0, MISS), (2.0, MISS), (3.0, None), (4.0, None)]
    assert looks(through(passes, seen)) == 1
    assert through(passes, [(1.5, MISS), (0.5, MISS), (2.5, MISS)]) == []


def test_a_late_hit_turns_the_pass_that_it_was_taken_in() -> None:
    passes = Passes()
    through(passes, [(1.0, MISS), (3.0, None), (5.0, MISS), (7.0, None)])
    late = through(passes, [(1.2, hit(4.5))])
    assert [change.first for change in late] == [False]
    assert factor(late) == pytest.approx(4.5 / MISS.worth)
    assert through(passes, [(1.3, hit(4.5))]) == []
    assert len(through(passes, [(5.1, hit(4.5))])) == 1, "the second pass is another"


def test_a_late_frame_between_two_that_do_not_show_the_cell_is_a_look() -> None:
    passes = Passes()
    through(passes, [(1.0, None), (3.0, None), (5.0, None)])
    assert looks(through(passes, [(2.0, MISS)])) == 1
    assert looks(through(passes, [(4.0, MISS)])) == 1
    assert looks(through(passes, [(6.0, MISS)])) == 1


def test_a_late_frame_before_one_that_shows_the_cell_badly_is_of_the_same_pass() -> None:
    passes = Passes()
    through(passes, [(1.0, None), (3.0, PARTLY)])
    assert looks(through(passes, [(2.0, MISS), (4.0, MISS)])) == 1


# ---- several sources


def test_two_cameras_that_look_elsewhere_do_not_end_each_others_passes() -> None:
    passes, changes = Passes(), []
    for moment in range(60):
        changes += passes.take("front", moment / 2.0, {HERE: MISS})
        changes += passes.take("back", moment / 2.0 + 0.25, {THERE: MISS})
    assert looks(changes) == 2


def test_two_cameras_on_one_cell_share_its_pass_until_neither_shows_it() -> None:
    passes = Passes()
    assert looks(passes.take("a", 1.0, {HERE: MISS})) == 1
    assert looks(passes.take("b", 1.1, {HERE: MISS})) == 0
    passes.take("a", 2.0, {})
    assert HERE in passes
    assert looks(passes.take("b", 2.1, {HERE: MISS})) == 0
    passes.take("b", 3.0, {})
    assert HERE not in passes
    assert looks(passes.take("a", 4.0, {HERE: MISS})) == 1


def test_a_pass_goes_on_when_a_second_camera_is_heard_a_little_late() -> None:
    passes = Passes()
    passes.take("a", 1.0, {HERE: MISS})
    passes.take("a", 2.0, {})
    assert looks(passes.take("b", 1.9, {HERE: MISS})) == 0
    assert looks(passes.take("b", 2.5, {HERE: MISS})) == 0
    passes.take("b", 3.0, {})
    assert looks(passes.take("b", 3.5, {HERE: MISS})) == 1


def test_a_source_that_falls_silent_does_not_keep_a_cell_from_being_looked_at() -> None:
    passes = Passes()
    passes.take("dead", 0.0, {HERE: MISS})
    for moment in range(1, int(4 * SILENT_S)):
        passes.take("alive", float(moment), {})
    assert looks(passes.take("alive", 4 * SILENT_S, {HERE: MISS})) == 1


def test_what_no_report_can_change_any_more_is_forgotten() -> None:
    passes = Passes(keep_s=10.0)
    for moment in range(2000):
        passes.take("camera", float(moment), {(moment, 0): MISS})
    # what is kept in memory: that is all this is about, and no verdict shows it
    assert len(passes._cells) < 20
    assert len(passes._sources["camera"].times) < 20  # likewise kept in memory


# ---- what the belief is told


@given(st.floats(1e-6, 1e6), st.floats(0.01, 0.99))
def test_a_likelihood_ratio_is_told_to_the_belief_exactly(ratio: float, p_tp: float) -> None:
    told_tp, told_tn = as_likelihoods(ratio, p_tp)
    assert 0.0 < told_tp <= 1.0
    assert 0.0 < told_tn <= 1.0
    assert told_tp / (1.0 - told_tn) == pytest.approx(ratio, rel=1e-6)


def test_a_frame_that_was_not_written_can_come_again() -> None:
    passes = Passes()
    first = through(passes, [(1.0, MISS)])
    passes.settle()
    turned = through(passes, [(1.5, hit(4.5))])
    passes.undo()
    assert through(passes, [(1.5, hit(4.5))]) == turned
    passes.undo()
    assert through(passes, [(1.6, MISS)]) == []
    again = Passes()
    assert through(again, [(1.0, MISS)]) == first
    again.undo()
    assert through(again, [(1.0, MISS)]) == first
