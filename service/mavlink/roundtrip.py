"""How long the link takes there and back, by TIMESYNC, which every autopilot answers with what it was sent.

What comes over a slow link looks fresh and is old: a heartbeat each second says nothing about when it was sent. Nor do
the vehicle's own time stamps, whose clock may run at another pace (a simulator's does).
"""

from __future__ import annotations

import math

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.mavlink.framing import Message

_PERIOD_S = 1.0
_ASKED = 64  # so many seconds a link may take at most
_KEPT_S = 10.0  # an answer says how slow the link is for so long


class RoundTrip:
    """The questions that are on their way, and what the last answer has shown."""

    def __init__(self) -> None:
        self._asked: dict[int, float] = {}
        self._asked_at = self._answered_at = -math.inf
        self._took_s = 0.0

    def due(self, now: float) -> Message | None:
        """The next question, once it is time for one."""
        if 0.0 <= now - self._asked_at < _PERIOD_S:
            return None
        stamp, self._asked_at = round(now * 1e9), now
        self._asked[stamp] = now
        while len(self._asked) > _ASKED:
            del self._asked[next(iter(self._asked))]
        return mavlink.MAVLink_timesync_message(0, stamp)

    def on_message(self, message: Message, now: float) -> None:
        """TIMESYNC of the autopilot: an answer to one of ours, or a question of its own, which says nothing. Of an
        answer that comes twice, by two ways, the faster one counts."""
        if message.tc1 != 0 and (sent := self._asked.pop(message.ts1, None)) is not None:
            self._took_s, self._answered_at = now - sent, now

    def heard_again(self, now: float) -> None:
        """After a silence: a link that has answered before may be a slow one now, until it answers again."""
        if self._answered_at > -math.inf:
            self._took_s, self._answered_at = math.inf, now

    def forget_asked(self) -> None:
        """We stood still ourselves: what has waited for us since says nothing about the link."""
        self._asked.clear()

    def seconds(self, now: float) -> float | None:
        """There and back, as the last answer has shown; infinite where that has yet to be seen; None without an answer
        lately."""
        return self._took_s if now - self._answered_at <= _KEPT_S else None

    def allowance_s(self, now: float) -> float:
        """So much later than over a fast link what we have caused may show."""
        return min(self.seconds(now) or 0.0, _KEPT_S)
