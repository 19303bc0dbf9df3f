"""Whether an autopilot knows the one command that sends it anywhere: asked before it is armed, with what moves nothing.

Asked is an autopilot whose answers are true (ArduCopter; PX4 answers UNSUPPORTED and flies), while it stands disarmed
and in our control, since somebody has ordered a take-off, for a DO_REPOSITION to latitude 95 without the flag that
takes the mode. Who knows the command denies that, as ArduCopter 4.7 was seen to; who does not answers UNSUPPORTED, and
would hover over the launch point for ever.
"""

from __future__ import annotations

import math

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.mavlink.autopilots.base import Autopilot
from service.mavlink.events import Target
from service.mavlink.telemetry import Telemetry

NOWHERE = Target(95.0, 0.0, 0.0)
_AGAIN_S, _MOST = 2.0, 5
_ENOUGH = 2  # so often asked in vain, who never answers this is armed all the same


class RepositionProbe:
    """Asks one vehicle until it has answered, a few times at most."""

    def __init__(self) -> None:
        self._asked, self._asked_at = 0, -math.inf
        self._answer: int | None = None

    def due(self, autopilot: Autopilot, t: Telemetry, now: float) -> bool:
        """Whether to ask now; it counts as asked then."""
        stands = t.in_control and not t.armed and t.landed_state == "on_ground" and not t.link_lost
        open_still = self._answer is None and self._asked < _MOST
        if not (autopilot.answers_reposition and stands and open_still and now - self._asked_at >= _AGAIN_S):
            return False
        self._asked, self._asked_at = self._asked + 1, now
        return True

    def settled(self, autopilot: Autopilot) -> bool:
        """Nothing more is to be waited for."""
        return not autopilot.answers_reposition or self._answer is not None or self._asked >= _ENOUGH

    def on_answer(self, result: int) -> None:
        """DO_REPOSITION was answered while it was asked for."""
        if self._asked and self._answer is None:
            self._answer = result

    def missing(self) -> list[str]:
        """That it does not know the command, as a sentence's end, or nothing."""
        if self._answer != mavlink.MAV_RESULT_UNSUPPORTED:
            return []
        return [
            "it does not know DO_REPOSITION, by which it would be sent to its waypoints (it answers UNSUPPORTED)"
        ]
