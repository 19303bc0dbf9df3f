"""From the computer's time, in which detectors tell when a frame was taken, to the service's.

The computer's clock may step, forward 400 days or back 45 seconds, while the service's goes on. Then a time means two
things, before the step and after it, and a detector on this computer changes from one to the other with a frame that
may still be on its way when the step is noticed; a detector on another computer, or one that takes its time from the
service, never does. So every source has an offset of its own, and moves on to the newest one when the times that it
tells have jumped as the computer's clock has, or would lie in the future otherwise.
"""

from __future__ import annotations

from dataclasses import dataclass

from service.clock import Clock

STEP_S = 1.0  # less than this is no step: a clock that is slewed, whose offset is followed
AHEAD_S = 0.5  # how far in the future of the service's clock a frame may be: as far as a pose is carried on
_SLEWED_S = 0.02  # less than this nobody has set: reading two clocks one after the other takes as long
_JUMPS_S = 60.0  # so long after a step may a source's first frame after it come
_ALIKE = 0.25  # of the step, and half a second: as near must a source's jump come to it
_STILL_REPORTS, _STILL_S = 5, 3.0  # so many reports of the same time over so long, and a clock stands still
_KEPT = 16
_MOST_SOURCES = 1000


@dataclass(slots=True, eq=False)
class _Offset:
    """By how much a clock is ahead of the service's; `since` when that is known."""

    ahead: float
    since: float


@dataclass(slots=True, eq=False)
class _Source:
    """What the last report of a source told, when that came, and how old it was."""

    offset: _Offset
    told: float
    arrived: float
    late: float = 0.0


class StillClocks:
    """Notices a source whose reports all tell the same time, while time goes on."""

    def __init__(self) -> None:
        self._sources: dict[str, tuple[float, float, int]] = {}  # what it tells, since when, and how often

    def stands(self, source: str, told: float, now: float) -> bool:
        """Whether the clock of a source that tells this time now stands still."""
        if len(self._sources) >= _MOST_SOURCES:
            self._sources.clear()
        before, since, count = self._sources.get(source, (told, now, 0))
        if before != told:
            since, count = now, 0
        self._sources[source] = (told, since, count + 1)
        return count >= _STILL_REPORTS and now - since >= _STILL_S


class SourceClocks:
    """The offset of each source's clock from the service's."""

    def __init__(self, clock: Clock, history_s: float) -> None:
        self._clock, self._history_s = clock, history_s
        self._own = _Offset(0.0, clock.now())
        ahead = clock.wall_ahead()
        self._walls = [_Offset(ahead if abs(ahead) > _SLEWED_S else 0.0, clock.now())]
        self._sources: dict[str, _Source] = {}

    @property
    def wall_ahead(self) -> float:
        """By how much the computer's clock is ahead of the service's, as measured last."""
        return self._walls[-1].ahead

    def measure(self) -> float:
        """Look at the computer's clock; by how many seconds it has stepped since it was looked at last, 0 if not."""
        newest, ahead = self._walls[-1], self._clock.wall_ahead()
        step = ahead - newest.ahead
        if abs(step) < STEP_S:
            newest.ahead = ahead if abs(step) > _SLEWED_S else newest.ahead
            return 0.0
        self._walls = [*self._walls, _Offset(ahead, self._clock.now())][-_KEPT:]
        return step

    def captured(self, source: str, told: float, now: float) -> float:
        """When it was in the service's clock that a source tells as `told`, in a report that arrives now."""
        known = self._sources.get(source)
        if known is None:
            if len(self._sources) >= _MOST_SOURCES:
                self._sources.clear()
            known = self._sources[source] = _Source(self._first(told, now), told, now)
        else:
            known.offset = self._after(known, told, now)
        captured = told - known.offset.ahead
        known.told, known.arrived, known.late = told, now, now - captured
        return captured

    def _first(self, told: float, now: float) -> _Offset:
        """The offset of a source that has not been heard yet: the one that makes its report the freshest; of those
        that are alike, the computer's."""
        offsets = [*reversed(self._walls), self._own]
        fitting = [each for each in offsets if self._fits(told - each.ahead, now)]
        freshest = min((each.ahead for each in fitting), default=0.0)
        return next((each for each in fitting if each.ahead < freshest + STEP_S), offsets[0])

    def _after(self, known: _Source, told: float, now: float) -> _Offset:
        """The offset of a source that has been heard: as it was, unless its clock has moved on."""
        present = known.offset
        others = [each for each in (*self._walls, self._own) if each is not present]
        fitting = [each for each in others if self._fits(told - each.ahead, now)]
        if told - present.ahead > now + AHEAD_S:
            return min(fitting, key=lambda each: abs(now - told + each.ahead - known.late), default=present)
        jump = (told - known.told) - (now - known.arrived)
        for each in reversed(fitting):
            step = each.ahead - present.ahead
            newer = each.since > present.since and now - each.since <= _JUMPS_S
            if newer and abs(step) >= STEP_S and abs(jump - step) <= 0.5 + _ALIKE * abs(step):
                return each
        return present

    def _fits(self, captured: float, now: float) -> bool:
        return now - self._history_s <= captured <= now + AHEAD_S
