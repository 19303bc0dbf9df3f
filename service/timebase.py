"""How the service's clock is tied to the computer's, in the journal, so that a run goes on in one time.

The service's clock follows the monotonic one; the computer's may be set: by a receiver that gets its first fix, by
NTP, by a battery that is empty. A row of the journal says where both stood, and another one each time that the
computer's has stepped. A run that is gone on with takes its time up from there: by the monotonic clock when the
computer has been on since, else by its date, and never behind what the journal has seen, since passes over ground and
ages of values live on this clock.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from service.clock import Clock
from service.errors import BadInput
from service.journal import read_last

ROW = "clock"
_BOOT_ID = Path("/proc/sys/kernel/random/boot_id")
_KINDS = (ROW, "report", "transition", "decision", "verdict", "order")


@dataclass(frozen=True)
class Tie:
    """The clocks at one moment: the service's, the computer's and its monotonic one, since which start of the computer
    the latter counts, and by how much the computer's has stepped since the last such row (0: it has not)."""

    service: float
    wall: float
    monotonic: float
    boot: str
    step_s: float = 0.0

    @classmethod
    def now(cls, clock: Clock, step_s: float = 0.0) -> Tie:
        """How they stand."""
        return cls(clock.now(), clock.wall(), time.monotonic(), boot_id(), step_s)

    def body(self) -> dict[str, Any]:
        """What the journal keeps of it."""
        return asdict(self)


def boot_id() -> str:
    """What tells one start of this computer from another; empty where that is not told."""
    with contextlib.suppress(OSError):
        return _BOOT_ID.read_text(encoding="ascii").strip()
    return ""


def time_after(tie: Tie | None, last: float, here: Tie) -> float:
    """The service time at which a run goes on: `tie` is its last one, `last` the time of its last row, `here` how the
    clocks stand now (its service time does not matter)."""
    if tie is not None and tie.boot and tie.boot == here.boot and here.monotonic >= tie.monotonic:
        return max(tie.service + here.monotonic - tie.monotonic, last)
    return max(here.wall, last)


def clock_for(journal: Path, speedup: float, pace: Callable[[], float] | None = None) -> Clock:
    """The clock of a run: a new one, or one that goes on from what its journal has seen; `pace` as for `Clock`."""
    if not journal.exists():
        return Clock(speedup, pace=pace)
    rows = {kind: row for kind in _KINDS for row in read_last(journal, kind, 1)}
    if not rows:
        return Clock(speedup, pace=pace)
    here = Tie(0.0, time.time(), time.monotonic(), boot_id())
    tie = None
    if speedup == 1.0 and (row := rows.get(ROW)) is not None:
        try:
            tie = Tie(**row.body)
        except TypeError as error:
            raise BadInput(
                f"{journal}: row {row.seq} is no {ROW} that this version knows ({error})"
            ) from error
    begin = time_after(tie, max(row.time for row in rows.values()), here)
    return Clock(speedup, begin=begin, pace=pace)
