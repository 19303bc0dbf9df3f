"""POS over time, and how much of a link's traffic arrives."""

from __future__ import annotations

from service.mavlink.quality import LinkQuality
from service.view.curve import PosCurve
from service.view.replay import monotone


def test_the_curve_counts_only_the_time_in_which_reports_came() -> None:
    curve = PosCurve()
    for time, pos in (
        (100.0, 0.01),
        (110.0, 0.02),
        (5000.0, 0.03),
        (5010.0, 0.03001),
        (4000.0, 0.04),
        (4010.0, 0.05),
    ):
        curve.add(time, pos)
    assert curve.points == [(0.0, 0.0), (0.0, 0.01), (10.0, 0.02), (10.0, 0.03), (20.0, 0.04), (30.0, 0.05)]


def test_a_replays_time_never_goes_back() -> None:
    assert monotone([10.0, 11.0, 10.9, 30.0, 5.0, 6.0]) == [10.0, 11.0, 11.0, 30.0, 30.1, 31.1]


def test_missing_messages_count_and_late_ones_do_not() -> None:
    quality = LinkQuality()
    assert quality.received is None
    quality.note(250)
    assert quality.received is None
    for sequence in (251, 252, 254, 253, 255, 0, 1):  # 253 was overtaken, so it counts as lost
        quality.note(sequence)
    assert quality.received == 6 / 7
    still = LinkQuality()
    for _ in range(9):
        still.note(0)
    assert still.received is None  # who does not count cannot be judged
