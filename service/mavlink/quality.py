"""How much of what the autopilot sends arrives: the gaps in its MAVLink sequence numbers."""

from __future__ import annotations

from collections import deque

_WINDOW = 200
_LATE = 128  # a step this far ahead is really one back: a datagram that was overtaken


class LinkQuality:
    """Counts the messages that came and those that are missing, among the last two hundred or so."""

    def __init__(self) -> None:
        self._last: int | None = None
        self._gaps: deque[int] = deque(maxlen=_WINDOW)

    def note(self, sequence: int) -> None:
        """A message with this sequence number (0 to 255) came."""
        if self._last is not None:
            gap = (sequence - self._last - 1) % 256
            if gap >= _LATE:
                return
            self._gaps.append(gap)
        self._last = sequence

    @property
    def received(self) -> float | None:
        """The part of the messages sent that came, 0 to 1; None before there is anything to count."""
        if not self._gaps:
            return None
        return len(self._gaps) / (len(self._gaps) + sum(self._gaps))
