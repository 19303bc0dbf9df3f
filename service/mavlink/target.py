"""Watches whether the autopilot flies to the target it was given.

The acknowledgement of DO_REPOSITION is no judge (PX4 answers UNSUPPORTED and flies there), so the judge is
POSITION_TARGET_GLOBAL_INT, which both autopilots send and which names the final target at once. One target at
a time:

    start ──► WATCHED ── named ──► TAKEN ── another one named twice ──► (TargetReplaced) ──► idle
                 │  ▲
        not named in time ──► resend, a few times, else (TargetNotTaken) ──► idle
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

from service.mavlink.events import Target

_METRES_PER_DEGREE = 111_194.93
_REFUSAL_S = 0.5
_REPLACED_AFTER = 2


class Step(Enum):
    """What has to happen to the target now."""

    RESEND = "resend"
    GIVE_UP = "give up"


@dataclass(slots=True)
class _Watched:
    target: Target
    first_sent: float
    sent: float
    attempts: int = 1
    taken: bool = False
    refusal: str = ""
    strangers: int = 0


def distance_m(a: Target, b: Target) -> float:
    """Horizontal distance on a sphere, good to 0.3 % over the few kilometres of a leg."""
    north = (b.lat - a.lat) * _METRES_PER_DEGREE
    turn = (b.lon - a.lon + 180.0) % 360.0 - 180.0
    east = turn * _METRES_PER_DEGREE * math.cos(math.radians((a.lat + b.lat) / 2.0))
    return math.hypot(north, east)


class TargetWatch:
    """The one outstanding target."""

    def __init__(self, *, timeout_s: float, attempts: int, tolerance_m: float) -> None:
        self._timeout_s = timeout_s
        self._attempts = attempts
        self._tolerance_m = tolerance_m
        self._watched: _Watched | None = None

    @property
    def target(self) -> Target | None:
        """The last target sent, until it is given up, replaced or cleared."""
        return self._watched.target if self._watched else None

    @property
    def taken(self) -> bool:
        """Whether the autopilot has named it."""
        return self._watched is not None and self._watched.taken

    @property
    def attempts(self) -> int:
        """How often it was sent."""
        return self._watched.attempts if self._watched else 0

    @property
    def refusal(self) -> str:
        """What the autopilot answered, if that was a refusal to be believed."""
        return self._watched.refusal if self._watched else ""

    def start(self, target: Target, now: float) -> None:
        """A new target was sent; the one before is forgotten."""
        self._watched = _Watched(target, first_sent=now, sent=now)

    def sent_again(self, now: float) -> None:
        """The same target was sent again."""
        if self._watched is not None:
            self._watched.attempts += 1
            self._watched.sent = now
            self._watched.refusal = ""

    def clear(self) -> None:
        """Nothing to watch."""
        self._watched = None

    def on_refusal(self, answer: str) -> None:
        """The autopilot refuses; believed only once it has also not named the target."""
        if self._watched is not None and not self._watched.taken:
            self._watched.refusal = answer

    def on_named(self, named: Target | None, now: float) -> tuple[float | None, Target | None]:
        """The autopilot has named its target: (seconds until ours was taken, whose target replaced ours)."""
        watched = self._watched
        if watched is None or named is None:
            return None, None
        ours = (
            distance_m(watched.target, named) <= self._tolerance_m
            and abs(watched.target.alt_amsl_m - named.alt_amsl_m) <= self._tolerance_m
        )
        if ours:
            watched.strangers = 0
            if watched.taken:
                return None, None
            watched.taken = True
            return now - watched.first_sent, None
        if watched.taken:
            watched.strangers += 1
            if watched.strangers >= _REPLACED_AFTER:
                return None, named
        return None, None

    def due(self, now: float) -> Step | None:
        """What a target that has not been named needs now."""
        watched = self._watched
        if watched is None or watched.taken:
            return None
        waited = now - watched.sent
        if watched.refusal and waited > _REFUSAL_S:
            return Step.GIVE_UP
        if waited <= self._timeout_s:
            return None
        return Step.RESEND if watched.attempts < self._attempts else Step.GIVE_UP
