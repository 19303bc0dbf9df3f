"""The vehicle's clock beside the service's, for the journal: at the first position, and whenever it has stepped."""

from __future__ import annotations

import math
from collections.abc import Iterator

from service.mission.effects import WriteRow
from service.mission.phase import Wish
from service.mission.standing import Look
from service.rows import VehicleClockRow

_STEP_S = 2.0  # of either clock; a link delays its messages by less, or the position is as old anyway
_SURE_S = 1.0  # for so long it has to be
_PAUSE_S = 10.0  # between two rows


class VehicleClock:
    """By how much the service's clock is ahead of the vehicle's time since boot, as journalled last."""

    def __init__(self) -> None:
        self._ahead_s = math.nan
        self._other_since = math.inf
        self._written_at = -math.inf

    def tick(self, look: Look) -> Iterator[Wish]:
        """See how they stand; a row when that is news. One delayed message is none."""
        t, now = look.seen.telemetry, look.now
        if t.boot_time_s is None or not t.position_known:
            return
        ahead = t.position_time - t.boot_time_s
        step = ahead - self._ahead_s if math.isfinite(self._ahead_s) else 0.0
        known = math.isfinite(self._ahead_s) and abs(step) <= _STEP_S * max(1.0, look.terms.speedup / 2.0)
        if known:
            self._other_since = math.inf
            return
        self._other_since = min(self._other_since, now)
        if now - self._other_since >= _SURE_S and now - self._written_at >= _PAUSE_S:
            self._ahead_s, self._other_since, self._written_at = ahead, math.inf, now
            yield WriteRow(VehicleClockRow(t.position_time, t.boot_time_s, step))
