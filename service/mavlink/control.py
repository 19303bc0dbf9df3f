"""Whose aircraft it is: the rule that the pilot always wins, in one small place.

Control is taken, never assumed: by an order to enter the guided mode (`take`). It is lost with the first mode
that the heartbeat shows and that we did not ask for, with a disarm in or after flight, and with a reboot;
only an order takes it again. While it is lost, nothing that moves the aircraft is sent, even if the mode
happens to be the guided one.

A mode counts as asked for (`commanded`) when

* we sent a command whose goal it is within the last few seconds (`expect`), or
* it follows by itself from a mode that we had commanded (PX4 holds at the top of its take-off).

Any mode that is not asked for cancels what we still expected: a command of ours that the pilot has overtaken
must not make a later change look like ours.
"""

from __future__ import annotations

import math

from service.mavlink.autopilots.base import Autopilot
from service.mavlink.modes import mode_title
from service.mavlink.telemetry import Telemetry

_CLIMB_SHARE = 0.1
_CLIMB_SLACK_M = 1.5


class Control:
    """The state of that rule for one vehicle."""

    def __init__(self) -> None:
        self.held = False
        self.reason = "control has not been taken"
        self._expected: dict[str, float] = {}
        self._commanded_mode: str | None = None
        self._climb_m = math.inf
        self._expected_armed: tuple[bool, float] | None = None

    def take(self, mode: str) -> None:
        """Control is ours from now on, in this mode."""
        self.held = True
        self.reason = ""
        self._commanded_mode = mode

    def lose(self, reason: str) -> None:
        """Control is not ours any longer, and nothing we asked for is expected any longer."""
        if self.held or not self.reason:
            self.reason = reason
        self.held = False
        self._expected.clear()
        self._commanded_mode = None

    def expect(self, mode: str, until: float) -> None:
        """We have just asked for a mode; a change to it until then is ours."""
        self._expected[mode] = max(until, self._expected.pop(mode, until))

    def asked_for(self, now: float) -> str:
        """The mode that we have asked for last and that no heartbeat has shown yet; empty when there is none."""
        return next((mode for mode, until in reversed(self._expected.items()) if now <= until), "")

    def expect_armed(self, armed: bool, until: float) -> None:
        """We have just asked to arm."""
        self._expected_armed = (armed, until)

    def climb_to(self, height_m: float) -> None:
        """We have just asked for a take-off to this height above home."""
        self._climb_m = height_m

    def on_mode(self, autopilot: Autopilot, previous: str, t: Telemetry, now: float) -> bool:
        """The heartbeat shows another mode; returns whether we asked for it, and gives up control if not.

        A pilot who stops our climb by choosing the very mode that would follow it is told from its end by the
        height.
        """
        mode = t.mode
        climbed = t.alt_home_m >= self._climb_m - max(_CLIMB_SHARE * self._climb_m, _CLIMB_SLACK_M)
        asked = now <= self._expected.get(mode, now - 1.0)
        if asked or (
            self._commanded_mode == previous
            and autopilot.follows(previous, mode, armed=t.armed, climbed=climbed)
        ):
            self._carried_out(mode if asked else "")
            self._commanded_mode = mode
            return True
        self.lose(f"the mode was changed to {mode_title(mode)} and not by us")
        return False

    def _carried_out(self, mode: str) -> None:
        """What was asked for is done in its order: a mode that was asked for after the one that shows may come yet."""
        while mode in self._expected:
            del self._expected[next(iter(self._expected))]

    def on_armed(self, armed: bool, now: float) -> bool:
        """The heartbeat shows the motors armed or disarmed; returns whether we asked for it."""
        expected, self._expected_armed = self._expected_armed, None
        commanded = expected is not None and expected[0] == armed and now <= expected[1]
        if not armed:
            self.lose("the aircraft has disarmed")
        return commanded
