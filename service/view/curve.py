"""POS over the time spent searching."""

from __future__ import annotations

LONGEST_GAP_S = 60.0
LEAST_RISE = 0.0005


class PosCurve:
    """The curve of POS: (seconds, POS) at each rise worth drawing, the first at 0.

    Seconds count while reports come: a gap longer than a minute, or back in time, is a service that was away.
    """

    def __init__(self) -> None:
        self.points: list[tuple[float, float]] = [(0.0, 0.0)]
        self.elapsed_s = 0.0
        self._last: float | None = None

    def when(self, pos: float) -> float | None:
        """Seconds spent searching until POS was this much; None when it never was."""
        return next((seconds for seconds, reached in self.points if reached >= pos), None)

    def add(self, time: float, pos: float) -> None:
        """Note what POS is at a time (seconds since the epoch)."""
        if self._last is not None and 0.0 < time - self._last <= LONGEST_GAP_S:
            self.elapsed_s += time - self._last
        self._last = time
        if pos - self.points[-1][1] >= LEAST_RISE:
            self.points.append((round(self.elapsed_s, 1), round(pos, 5)))
