"""The speed that was asked for, and whether the aircraft keeps to it.

ArduCopter resets a speed that is sent before the first waypoint when GUIDED enters position control, so it is sent
after the first waypoint that is taken since the mode was entered, again after each such entry; and so a speed that was
refused or lost, while nothing could be sent, is made up for. It is sent again when the telemetry shows for a while that
the aircraft is faster, or that it cruises, level and steadily, at less: an autopilot that goes back to a speed of its
own costs a search a third of its time without a word. If that does not help, it is said.
"""

from __future__ import annotations

import math

_OFF_MPS, _OFF_SHARE = 1.0, 0.15  # more than gusts and overshoot make of it
_FASTER_FOR_S, _SLOWER_FOR_S = 4.0, 6.0
_AGAIN_S = 8.0
_STEADY_MPS = 0.4  # who speeds up, brakes or turns changes by more in that time
_UNDER_WAY_MPS = 1.0
_LEVEL_MPS = 0.3  # a long way up or down makes the way across slow


class Cruise:
    """The speed of one vehicle."""

    def __init__(self) -> None:
        self.wanted_mps: float | None = None
        """What was asked for; None: nothing was."""
        self._due = False
        self._fast_since = self._slow_since = math.inf
        self._steady_mps = 0.0  # what the speed is steady at
        self._sent_again_at = math.inf
        self._told = False

    def want(self, speed_mps: float) -> None:
        """This speed was just asked for, and sent if it could be."""
        self.wanted_mps = speed_mps
        self.start_over()

    def start_over(self) -> None:
        """It has entered the guided mode, or taken off: what it knew of a speed may be forgotten."""
        self._due = self.wanted_mps is not None
        self._fast_since = self._slow_since = self._sent_again_at = math.inf
        self._told = False

    def forget(self) -> None:
        """Nobody asks for a speed any longer."""
        self.wanted_mps, self._due = None, False

    def on_taken(self) -> float | None:
        """It flies to a waypoint of ours: the speed to send now, if it has not been since the mode was entered."""
        due, self._due = self._due, False
        return self.wanted_mps if due else None

    def on_speed(self, speed_mps: float, now: float, *, climb_mps: float = 0.0) -> tuple[float | None, str]:
        """Its speed over ground while it flies to our waypoints: (a speed to send again, what to say).

        `climb_mps`: up or down.
        """
        wanted = self.wanted_mps
        if wanted is None or self._due or not self._off(speed_mps, wanted, now, climb_mps):
            return None, ""
        if not math.isfinite(self._sent_again_at):
            self._sent_again_at = now
            return wanted, ""
        if self._told or now - self._sent_again_at < _AGAIN_S:
            return None, ""
        self._told = True
        return None, f"flies {speed_mps:.1f} m/s, asked for {wanted:g}"

    def _off(self, speed_mps: float, wanted: float, now: float, climb_mps: float) -> bool:
        """Whether it has been faster, or slower and steady, for long enough."""
        most = max(_OFF_MPS, _OFF_SHARE * wanted)
        self._fast_since = min(self._fast_since, now) if speed_mps > wanted + most else math.inf
        slow = abs(climb_mps) < _LEVEL_MPS and _UNDER_WAY_MPS < speed_mps < wanted - most
        if not (slow and abs(speed_mps - self._steady_mps) <= _STEADY_MPS):
            self._slow_since, self._steady_mps = now if slow else math.inf, speed_mps
        return now - self._fast_since >= _FASTER_FOR_S or now - self._slow_since >= _SLOWER_FOR_S
