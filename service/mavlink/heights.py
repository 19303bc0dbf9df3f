"""Heights over the ground that a flight began from, though home or the sea level move while it is in the air.

A position has two altitudes, above the sea and above home. When what lies between them changes at once, one of the two
has jumped and the other went on as the climb says: if it is the one above home, somebody has moved home, and neither
the aircraft nor the ground below it has moved with it; else the altitude of all things was corrected, home's too.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

_STEP_M = 1.0  # home does not drift in the air; less is rounding


@dataclass(frozen=True, slots=True)
class _Altitudes:
    sea_m: float
    home_m: float
    down_mps: float
    time: float


class ToldAltitudes:
    """The two altitudes of one vehicle, as they were told last."""

    def __init__(self) -> None:
        self.lifted_m = 0.0
        """How much higher home is than the place it was at when the flight began, in metres."""
        self.sea_m = 0.0
        """How far all altitudes above the sea have been corrected upwards since the link was opened, in metres."""
        self._last: _Altitudes | None = None

    def begin(self) -> None:
        """It stands on the ground, or has rebooted: home is where it says."""
        self.lifted_m, self._last = 0.0, None

    def read(self, sea_m: float, home_m: float, down_mps: float, now: float) -> float:
        """Take in a position's altitudes above the sea and above home, in metres, and its speed downwards (m/s, NaN:
        not known); returns its height over where home was when the flight began."""
        last, self._last = self._last, _Altitudes(sea_m, home_m, down_mps, now)
        if last is not None:
            step = (sea_m - home_m) - (last.sea_m - last.home_m)
            known = [speed for speed in (last.down_mps, down_mps) if math.isfinite(speed)]
            climbed = -sum(known) / len(known) * (now - last.time) if known else 0.0
            over_home, over_sea = home_m - last.home_m - climbed, sea_m - last.sea_m - climbed
            if abs(step) > _STEP_M and abs(over_home) > abs(over_sea):
                self.lifted_m += step
            elif abs(step) > _STEP_M:
                self.sea_m += step
        return home_m + self.lifted_m
