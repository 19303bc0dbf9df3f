"""How far a long command is and how long the rest takes: bars in a terminal, a line a minute where output is kept."""

from __future__ import annotations

import time
from collections.abc import Callable

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

LINE_EVERY_S = 60.0
_AT_ONCE_S = 1.0
"""What is done as soon as that was kept of an earlier try, and says nothing about the rest."""
_MEASURED_OVER_S = 6 * 3600.0
"""Rich reckons the time left from what was done lately, by default in half a minute: many a job takes longer."""


def bars(console: Console) -> Progress:
    """Progress bars with counts, the time that has passed and the time that is left; nothing but in a terminal."""
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        console=console,
        disable=not console.is_terminal,
        speed_estimate_period=_MEASURED_OVER_S,
    )


class Rest:
    """Tells the time that is left as a line, each minute: where there is no terminal, or everywhere without bars."""

    def __init__(
        self,
        console: Console,
        total: int,
        *,
        beside_bars: bool = True,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._console, self._total, self._clock = console, total, clock
        self._silent = beside_bars and console.is_terminal
        self._done, self._kept, self._began = 0, 0, clock()
        self._told = self._began

    def advance(self) -> None:
        """One more is done."""
        self._done += 1
        now = self._clock()
        self._kept += now - self._began < _AT_ONCE_S
        if not self._silent and self._done < self._total and now >= self._told + LINE_EVERY_S:
            self._told = now
            self._console.print(rest(self._done, self._total, now - self._began, self._kept), highlight=False)


def rest(done: int, total: int, seconds: float, kept: int = 0) -> str:
    """What is done, how long that took, and how long the rest takes at the pace of what was not kept from before."""
    left = seconds / (done - kept) * (total - done)
    return f"{done} of {total} done in {span(seconds)}, about {span(left)} left"


def span(seconds: float) -> str:
    """A time as people say it: `45 s`, `12 min`, `3 h 20 min`."""
    if seconds < 100.0:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60.0)
    return f"{minutes} min" if minutes < 100 else f"{minutes // 60} h {minutes % 60} min"
