"""The vehicle's time since boot, and what it says when it goes back.

One stamp proves nothing: a message may carry nonsense in that one field. A stamp that does not continue the time line
so far begins another, which counts once several stamps in a row have continued it, and none the old one.
"""

from __future__ import annotations

from dataclasses import dataclass

from service.mavlink.framing import Message

_OVERTAKEN_S = 2.0  # a little back is a datagram that was overtaken by another
_AHEAD_S = 5.0  # the vehicle's clock, the link and ours may differ by so much from stamp to stamp
_WRAP_S = 2.0**32 / 1000.0  # the counter wraps after 49.7 days
_AROUND_WRAP_S = 60.0
_STAMPS = 3


@dataclass(slots=True)
class _Line:
    """A time line: its newest stamp, when that came, and how many continued it."""

    seconds: float
    at: float
    stamps: int = 1

    def goes_on(self, seconds: float, now: float) -> bool:
        """Whether a stamp continues the line; then it is the newest, unless it was overtaken."""
        ahead = seconds - self.seconds
        if not -_OVERTAKEN_S < ahead <= now - self.at + _AHEAD_S:
            return False
        self.stamps += 1
        if ahead > 0.0:
            self.seconds, self.at = seconds, now
        return True


class BootClock:
    """The newest `time_boot_ms` of any message that has one, as far as it is believed."""

    def __init__(self) -> None:
        self._line: _Line | None = None
        self._other: _Line | None = None

    @property
    def seconds(self) -> float | None:
        """Seconds since the vehicle booted; None before it was told."""
        return None if self._line is None else self._line.seconds

    def read(self, message: Message, now: float) -> bool:
        """Take a message's stamp; returns whether the vehicle must have rebooted."""
        stamp_ms = getattr(message, "time_boot_ms", 0)
        if not stamp_ms:
            return False
        seconds = stamp_ms / 1000.0
        if self._line is None:
            self._line = _Line(seconds, now)
        elif self._line.goes_on(seconds, now):
            self._other = None
        elif self._other is None or not self._other.goes_on(seconds, now):
            self._other = _Line(seconds, now)
        elif self._other.stamps >= _STAMPS:
            before, self._line, self._other = self._line, self._other, None
            back = before.seconds - seconds
            return before.stamps >= _STAMPS and _OVERTAKEN_S <= back < _WRAP_S - _AROUND_WRAP_S
        return False
