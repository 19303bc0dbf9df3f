"""Watches whether the autopilot flies to the target it was given.

The acknowledgement of DO_REPOSITION is no judge (PX4 answers UNSUPPORTED and flies there), so the judge is
POSITION_TARGET_GLOBAL_INT, which both autopilots send and which names the final target at once. One target at
a time:

    start ──► WATCHED ── named ──► TAKEN
                 │  ▲
        not named in time ──► resend, a few times, else (TargetNotTaken) ──► idle

Beside it `Strangers` knows what the autopilot may name: the last few of ours, and where it hovered when we took it
over. Another place named twice was given by somebody else (TargetReplaced), whether a target of ours is watched or not.
So was one named once that a waypoint of ours, already on its way then, has replaced: that person was overtaken.
Somebody who steers it by a velocity names no place at all; ArduCopter tells that it follows one.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, replace
from enum import Enum

from service import geometry
from service.mavlink.events import Target

_REFUSAL_S = 0.5
_REPLACED_AFTER = 2
_SETTLED_AFTER = 3
_SUSPECTED_S = 5.0
_STANDS_MPS = 0.1
_OVERTAKES_S = (
    1.0  # so long may a waypoint be on its way, while the autopilot names what somebody else gave it before
)
_OURS = 4  # an answer about one of them may still be on its way when the next is sent


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


def distance_m(a: Target, b: Target) -> float:
    """Horizontal distance on a sphere, good to 0.3 % over the few kilometres of a leg."""
    return geometry.distance_m((a.lat, a.lon), (b.lat, b.lon))


def near(a: Target, b: Target, tolerance_m: float) -> bool:
    """Whether two targets are the same, but for rounding."""
    return distance_m(a, b) <= tolerance_m and abs(a.alt_amsl_m - b.alt_amsl_m) <= tolerance_m


class Strangers:
    """Tells a target that somebody else has given to the aircraft from those that it may have: see above.

    What it hovers at by itself is learnt anew (`start_over`) whenever it was given to us, changed its mode, or was
    stopped without a target: the same place named several times, or one of ours.
    """

    def __init__(self, tolerance_m: float) -> None:
        self._tolerance_m = tolerance_m
        self._ours: deque[Target] = deque()
        self._settled = False
        self._named: Target | None = (
            None  # the last of ours that it named: as long as it goes on, nobody gave another
        )
        self._resting: Target | None = None
        self._times_resting = 0
        self._suspect: Target | None = None
        self._times_suspect = 0
        self._times_steered = 0
        self._sent_at = self._suspect_at = -math.inf
        self._off_until = -math.inf

    def suspects(self, now: float) -> bool:
        """A place that is not ours was named lately, but not often enough to be sure; when nothing is named any more,
        that is no reason for ever."""
        return self._suspect is not None and now - self._suspect_at < _SUSPECTED_S

    def look_away(self, until: float) -> None:
        """We have asked for another mode, whose target it may name before its heartbeat shows the mode."""
        self._off_until = until
        self.start_over()

    def look_again(self) -> None:
        """The mode that we have asked for is there."""
        self._off_until = -math.inf

    def start_over(self) -> None:
        """It may go anywhere by itself now."""
        self._ours.clear()
        self._settled, self._resting, self._times_resting = False, None, 0
        self._named = None
        self._times_steered = 0
        self._suspect, self._times_suspect = None, 0

    def sent(self, target: Target, now: float) -> None:
        """This one is ours."""
        self._sent_at = now
        self._ours.append(target)
        while len(self._ours) > _OURS:
            self._ours.popleft()

    def sea_moved(self, by_m: float) -> None:
        """All altitudes were corrected by so much: what it has may be named by the old one or the new one."""
        self._ours.extend([replace(ours, alt_amsl_m=ours.alt_amsl_m + by_m) for ours in self._ours])
        if self._resting is not None:
            self._settled, self._resting, self._times_resting = False, None, 0
        self._suspect, self._times_suspect = None, 0

    def on_named(self, named: Target, now: float) -> Target | None:
        """The autopilot has named its target; returns it once it is sure that somebody else has given it."""
        if now < self._off_until:
            return None
        overtaken: Target | None = None
        if any(near(ours, named, self._tolerance_m) for ours in self._ours):
            self._settled, self._named = True, named
            overtaken = self._overtaken(named)
        elif self._named is not None and near(self._named, named, self._tolerance_m):
            pass  # it does not take what was sent since
        elif not self._settled:
            self._learn(named)
        elif self._resting is None or not near(self._resting, named, self._tolerance_m):
            return self._suspicious(named, now)
        else:
            self._resting = named  # one that still brakes, or drifts, names where it is
        self._suspect, self._times_suspect = None, 0
        return overtaken

    def on_steered(self, speed_mps: float | None, now: float) -> bool:
        """The autopilot tells how fast it is to go where it has no place to go to (None: it has one); whether it is
        sure that somebody steers it. We ask for a stand at most, and so does the mode when it is entered: a speed of
        nothing is somebody else's only where it flew to a place of ours before."""
        steered = speed_mps is not None and (self._named is not None or speed_mps > _STANDS_MPS)
        theirs = steered and now >= self._off_until
        self._times_steered = self._times_steered + 1 if theirs else 0
        return self._times_steered >= _REPLACED_AFTER

    def _overtaken(self, named: Target) -> Target | None:
        """What somebody else gave it just before the last of ours, which it names now, came."""
        newest = self._ours and near(self._ours[-1], named, self._tolerance_m)
        return self._suspect if newest and 0.0 <= self._suspect_at - self._sent_at < _OVERTAKES_S else None

    def _learn(self, named: Target) -> None:
        again = self._resting is not None and near(self._resting, named, self._tolerance_m)
        self._resting, self._times_resting = named, self._times_resting + 1 if again else 1
        self._settled = self._times_resting >= _SETTLED_AFTER

    def _suspicious(self, named: Target, now: float) -> Target | None:
        if self._suspect is None or not near(self._suspect, named, self._tolerance_m):
            self._suspect, self._times_suspect, self._suspect_at = named, 1, now
            return None
        self._times_suspect += 1
        return named if self._times_suspect >= _REPLACED_AFTER else None


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

    def on_named(self, named: Target | None, now: float) -> float | None:
        """The autopilot has named its target: the seconds until ours was taken, when it is that for the first time."""
        watched = self._watched
        if (
            watched is None
            or watched.taken
            or named is None
            or not near(watched.target, named, self._tolerance_m)
        ):
            return None
        watched.taken = True
        return now - watched.first_sent

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
