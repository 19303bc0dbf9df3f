"""When a frame was taken, in the service's clock."""

from __future__ import annotations

import logging
from collections.abc import Callable

from service.clock import Clock
from service.evidence.observe import Unreadable
from service.evidence.reports import Report
from service.evidence.timing import AHEAD_S, SourceClocks, StillClocks
from service.timebase import Tie

log = logging.getLogger("roisearch")

HISTORY_S = 120.0  # how far back the telemetry remembers
_SINCE_BOOT_S = 1e8  # seconds that no epoch's time is below, and no autopilot has been on


class Moments:
    """Puts reports at their time of capture, by offsets that it measures and has written into the journal."""

    def __init__(
        self,
        clock: Clock,
        time_of_boot: Callable[[float], float | None] = lambda boot_s: None,
        history_s: float = HISTORY_S,
    ) -> None:
        """`time_of_boot` translates the autopilot's time since boot, `history_s` is how far back the telemetry
        remembers."""
        self.clock, self.time_of_boot, self.history_s = clock, time_of_boot, history_s
        self.last_step = ""
        self._sources = SourceClocks(clock, history_s)
        self._still = StillClocks()
        self._ties = [Tie.now(clock)]

    def measure(self) -> None:
        """Look whether the computer's clock has stepped, and say so; before reports are put at their time."""
        if step := self._sources.measure():
            self.last_step = (
                f"the computer's clock was set {'forward' if step > 0 else 'back'} by {abs(step):.1f} s"
            )
            log.warning("%s; the search keeps its own time, and frames theirs", self.last_step)
            self._ties.append(Tie.now(self.clock, step))

    def unwritten(self) -> list[Tie]:
        """How the clocks stood at the start and at each step, as far as the journal does not know it yet."""
        return list(self._ties)

    def written(self, ties: list[Tie]) -> None:
        """These are in the journal."""
        self._ties = [each for each in self._ties if each not in ties]

    def of(self, report: Report, now: float) -> float:
        """When the frame of a report that arrives now was taken; raises Unreadable when no telemetry can be of then."""
        told = report.captured_s
        if self._still.stands(report.source, told, now):
            raise Unreadable(
                f"captured_at stands still at {told:.3f} in the reports of '{report.source}'; it is the time at which "
                "each frame was taken"
            )
        if report.by_boot:
            return self._of_boot(told)
        captured = told
        if (
            report.clock != "service" and self.clock.speedup == 1.0
        ):  # else there is no other time than the service's
            captured = self._sources.captured(report.source, told, now)
        self._check(captured, told, now)
        return captured

    def _of_boot(self, told: float) -> float:
        found = self.time_of_boot(told)
        if found is None:
            hint = '; for seconds since the epoch say "clock": "unix"' if told > _SINCE_BOOT_S else ""
            raise Unreadable(
                f"captured_at {told:.3f} s since boot is not in the telemetry: no position of the aircraft is known "
                f"for it{hint}"
            )
        return found

    def _check(self, captured: float, told: float, now: float) -> None:
        if captured < now - self.history_s:
            hint = (
                '; for the autopilot\'s time since boot say "clock": "boot"' if told < _SINCE_BOOT_S else ""
            )
            raise Unreadable(
                f"captured_at {told:.3f} is {now - captured:.1f} s ago, and the telemetry is kept for "
                f"{self.history_s:g} s: no position of the aircraft is known for it{hint}"
            )
        if captured > now + AHEAD_S:
            raise Unreadable(
                f"captured_at {told:.3f} is {captured - now:.1f} s in the future of the service's clock, "
                "which GET /api/state tells"
            )
