"""A run that is gone on with goes on in its own time, whatever the computer's clock says by then."""

from __future__ import annotations

import asyncio
import time
from pathlib import Path

import pytest

from service.journal import Journal
from service.timebase import ROW, Tie, clock_for, time_after

TIE = Tie(service=1000.0, wall=5000.0, monotonic=70.0, boot="a")


def here(wall: float, monotonic: float, boot: str) -> Tie:
    return Tie(0.0, wall, monotonic, boot)


@pytest.mark.parametrize("wall", [0.0, 5030.0, 9e9])
def test_on_the_same_start_of_the_computer_the_monotonic_clock_tells(wall: float) -> None:
    assert time_after(TIE, 1010.0, here(wall, 100.0, "a")) == 1030.0


def test_after_another_start_it_is_the_date_but_never_behind_the_journal() -> None:
    assert time_after(TIE, 1010.0, here(5100.0, 3.0, "b")) == 5100.0
    assert time_after(TIE, 1010.0, here(900.0, 3.0, "b")) == 1010.0
    assert time_after(None, 1010.0, here(900.0, 3.0, "")) == 1010.0
    assert time_after(Tie(1000.0, 5000.0, 70.0, ""), 1010.0, here(5100.0, 80.0, "")) == 5100.0


def journal_of(path: Path, ahead_s: float, *, tied: bool) -> Path:
    """A journal whose last report the present clock would see so many seconds in the future."""
    journal = Journal(path)
    now = time.time() + ahead_s

    async def write() -> None:
        if tied:
            await journal.append(
                now, ROW, Tie(now, now, time.monotonic(), Tie.now(clock_for(path, 1.0)).boot).body()
            )
        await journal.append(now, "report", {"report": {"id": "a"}})

    asyncio.run(write())
    journal.close()
    return path


@pytest.mark.parametrize("tied", [False, True])
@pytest.mark.parametrize("ahead_s", [3600.0, 45.0])
def test_a_clock_that_is_behind_the_journal_goes_on_from_the_journals_end(
    tmp_path: Path, ahead_s: float, tied: bool
) -> None:
    clock = clock_for(journal_of(tmp_path / "j.sqlite", ahead_s, tied=tied), 1.0)
    assert clock.now() >= time.time() + ahead_s - 30.0
    assert clock.wall_ahead() == pytest.approx(-ahead_s, abs=30.0)


def test_a_new_run_goes_by_the_computers_clock(tmp_path: Path) -> None:
    Journal(tmp_path / "j.sqlite").close()
    for path in (tmp_path / "j.sqlite", tmp_path / "none.sqlite"):
        assert clock_for(path, 1.0).wall_ahead() == pytest.approx(0.0, abs=0.5)
