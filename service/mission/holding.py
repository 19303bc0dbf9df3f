"""What a mission hovers for, and how that ends: the cause is gone, an operator decides, or it is time to fly home."""

from __future__ import annotations

import math
from collections.abc import Iterator

from service.mission.effects import EnterGuided, Stop
from service.mission.limits import hold_objection, not_airborne
from service.mission.phase import RETRY_S, Happen, Phase, Release, Wish
from service.mission.situation import on_ground, standing_still
from service.mission.standing import Look
from service.mission.states import Event

BLIND = {"link", "position", "air"}  # causes of a hold during which no waypoint of ours leads home
UNHINDERED = {"operator", "apart"}  # causes that say nothing against our own way home
UNSURE = {"position", "air"}  # what the aircraft's own word ends
_GOOD = {"position": "the position is good", "air": "the autopilot says that it is in the air"}
CLIMB_AGAIN_S = 5.0
PROMPT_S = 0.5  # a row that waits longer for the disk is late
STAYS = {"operator", "link", "position"}  # causes that no patience ends


class Holding(Phase):
    """HOLDING; several causes can hold at once, and the search goes on when none does.

    `as_left`: the run was holding when an earlier process left it. What hovers in the guided mode then, or where it was
    stopped without a position, is still ours, and is taken in hand without being moved, so that it can be sent home
    when its energy ends.
    """

    def __init__(self, *, as_left: bool = False) -> None:
        self._again_at = math.inf
        self._take, self._take_at = as_left, -math.inf
        self._prompt_since = self._clear_since = self._alone_since = math.inf
        self._climb_at = -math.inf
        self._guided_at = 0.0

    def lost(self, look: Look) -> None:
        """The stop may not have arrived: stop again."""
        self._again_at = look.now + RETRY_S

    def tick(self, look: Look) -> Iterator[Wish]:
        """Is a cause gone, or is it time to fly home?"""
        standing, now, t = look.standing, look.now, look.seen.telemetry
        causes, low = standing.causes, look.energy_low()
        self._take &= not t.in_control
        if self._take and standing_still(t) and not look.busy and now >= self._take_at:
            self._take_at = now + RETRY_S
            yield EnterGuided(there=True)
        if now >= self._again_at and look.heard():  # to whom is not heard nothing is sent
            self._again_at = math.inf
            if not on_ground(t):  # a climb that was broken off in time: what stands disarmed needs no stop
                yield Stop()
        if low and look.heard() and t.in_control:  # which needs no position, nor a journal
            # by itself it goes past no others: not where nothing speaks against the way that it was on
            unflown = standing.homeward and not causes <= UNHINDERED
            direct = unflown or bool(causes & BLIND)
            yield Happen(Event.ENERGY_LOW, low, stopped=low, searched=True, direct=direct)
        elif "detector" in causes and not look.detector_silent():
            yield Release("detector", "the detector reports again")
        elif "doubt" in causes and not look.seen.doubt:
            yield Release("doubt", "no place waits for a person any more")
        elif "journal" in causes and self._prompt(look):
            yield Release("journal", "the journal is written again")
        elif "ground" in causes and self._clear(look):
            yield Release("ground", "clear of the ground again")
        elif "apart" in causes and self._alone(look):
            yield Release("apart", "apart from the others again")
        elif "link" in causes and look.heard():
            yield self._heard_again(look)
        elif causes & UNSURE and not look.helm.doubts(t, now) and not not_airborne(t):
            if t.guided or not t.in_control:
                cause = min(causes & UNSURE)
                yield Release(cause, f"{_GOOD[cause]} again")
            elif not look.busy and now >= self._guided_at:  # it braked in a mode of its own
                self._guided_at = now + RETRY_S
                yield EnterGuided(out_of=t.mode)
        elif not causes & STAYS and (why := hold_objection(now - standing.since, look.settings.flight)):
            direct = standing.homeward or bool(causes & BLIND)
            yield Happen(Event.RETURN, why, stopped=why, direct=direct)

    def _clear(self, look: Look) -> bool:
        """The aircraft has been clear of the ground for a while; until then it is told again and again to climb."""
        low = bool(look.helm.heights.low(look.seen.telemetry))
        self._clear_since = math.inf if low else min(self._clear_since, look.now)
        if low and look.now >= self._climb_at:
            self._climb_at = look.now + CLIMB_AGAIN_S
            self._again_at = min(self._again_at, look.now)
        return look.now - self._clear_since >= look.settings.flight.settle_s

    def _alone(self, look: Look) -> bool:
        """It has stood, or nobody has been near, for a while; where it goes from there its next leg is judged anew."""
        t, others = look.seen.telemetry, look.seen.others
        near = look.helm.traffic.near(t, others, look.now)
        self._alone_since = math.inf if near else min(self._alone_since, look.now)
        return look.now - self._alone_since >= look.settings.flight.settle_s

    def _prompt(self, look: Look) -> bool:
        """The journal has been written in time for a while: a slow disk is not slow at every row."""
        late = look.seen.journal_behind_s > PROMPT_S
        self._prompt_since = math.inf if late else min(self._prompt_since, look.now)
        return look.now - self._prompt_since >= look.settings.flight.settle_s

    def _heard_again(self, look: Look) -> Release:
        """The autopilot was silent: go on, wait for an operator, or fly home, as the settings say."""
        then, homeward = look.settings.link.after_silence, look.standing.homeward
        said = "the autopilot is heard again"
        if then == "hold" and not homeward:
            return Release("link", said, instead="operator")
        return Release("link", said, home=then == "return")
