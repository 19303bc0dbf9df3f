"""How long a command takes is told where its output is kept, too, and where one job takes minutes."""

from __future__ import annotations

import io

import pytest
from rich.console import Console

from sim.progress import LINE_EVERY_S, Rest, bars, span


class Hours:
    """A clock that is moved by hand."""

    now = 1000.0

    def __call__(self) -> float:
        return self.now


def told(*, terminal: bool, beside_bars: bool, jobs: int, seconds: float, kept: int = 0) -> list[str]:
    """What is said while jobs are done that take so long each, but those that are kept from before."""
    out, clock = io.StringIO(), Hours()
    rest = Rest(
        Console(file=out, force_terminal=terminal, width=80), jobs, beside_bars=beside_bars, clock=clock
    )
    for number in range(jobs):
        clock.now += seconds if number >= kept else 1e-3
        rest.advance()
    return out.getvalue().splitlines()


def test_a_log_tells_the_time_that_is_left_once_a_minute_and_not_at_the_end() -> None:
    lines = told(terminal=False, beside_bars=True, jobs=250, seconds=6.0)
    assert len(lines) == 250 * 6.0 / LINE_EVERY_S - 1
    assert lines[0] == "10 of 250 done in 60 s, about 24 min left"
    assert lines[-1] == "240 of 250 done in 24 min, about 60 s left"


def test_what_was_kept_of_an_earlier_try_does_not_make_the_rest_look_short() -> None:
    lines = told(terminal=False, beside_bars=True, jobs=120, seconds=60.0, kept=20)
    assert lines[0] == "21 of 120 done in 60 s, about 99 min left"


def test_beside_bars_nothing_is_said_twice() -> None:
    assert told(terminal=True, beside_bars=True, jobs=3, seconds=1000.0) == []
    assert len(told(terminal=True, beside_bars=False, jobs=3, seconds=1000.0)) == 2


def test_bars_reckon_the_time_left_of_jobs_that_take_minutes() -> None:
    clock = Hours()
    progress = bars(Console(file=io.StringIO(), force_terminal=True))
    progress.get_time = clock
    task = progress.add_task("flights", total=10)
    for _ in range(3):
        clock.now += 300.0
        progress.advance(task)
    assert progress.tasks[0].time_remaining == pytest.approx(7 * 300.0, rel=0.4)


@pytest.mark.parametrize(
    ("seconds", "words"),
    [(45.0, "45 s"), (720.0, "12 min"), (12_000.0, "3 h 20 min"), (7170.0, "2 h 0 min")],
)
def test_a_time_in_words(seconds: float, words: str) -> None:
    assert span(seconds) == words
