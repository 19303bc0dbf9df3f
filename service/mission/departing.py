"""From the first heartbeat to the search: waiting for the vehicle, taking off or being taken up, or as it was left.

A mission that goes on with a run comes up as that was left: yielded, holding, or on its way home. What was searching
goes on if the aircraft still hovers in the guided mode; if it has landed meanwhile, the next sortie is waited for.
Whoever has flown already takes off again only on a fresh order, or when the pilot does.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Iterator
from dataclasses import replace

from service.mission.effects import (
    Action,
    Arm,
    Connect,
    EnterGuided,
    Note,
    TakeOff,
    Tell,
    WaitReady,
    WriteRow,
)
from service.mission.news import Done, Failed, News
from service.mission.phase import (
    RETRY_S,
    Begin,
    GiveUp,
    GoOn,
    Happen,
    Hold,
    Late,
    Phase,
    Stand,
    Stay,
    Turn,
    Wish,
    warn,
)
from service.mission.situation import hovering, on_ground, standing_still
from service.mission.standing import LEAST_PATIENCE_WALL_S, Look, Standing
from service.mission.states import Event, State
from service.rows import CommandRow

ALOFT_M = 5.0  # so high above home nothing that is armed is on the ground, whatever it says
LACKS_S = 10.0  # for so long what it lacks may be told yet
AS_LEFT = "as it was before the restart"


class Waiting(Phase):
    """Until the vehicle is heard, knows where it is, and says whether it is in the air.

    While others of the search are heard it is waited for, and may join them later. `between`: the run was left between
    two sorties, when an aircraft may be switched off: it is waited for as long.
    """

    def __init__(self, *, between: bool = False) -> None:
        self._between = between
        self._asked = self._late = False
        self._since: float | None = None
        self._not_before = 0.0
        self._until: float | None = None

    def tick(self, look: Look) -> Iterator[Wish]:
        """Connect, and then see whether it stands or flies; one that does not say so is taken as it is."""
        t = look.seen.telemetry
        if not self._asked:
            self._since = look.now if self._since is None else self._since
            if look.now >= self._not_before:
                self._asked = True
                yield Connect()
        elif self._until is None:
            waited_s = look.now - (self._since or look.now)
            if waited_s > look.settings.link.connect_timeout_s + RETRY_S and _others_heard(look):
                yield from self._go_without("it is not heard")  # the link itself waits for it
        elif t.landed_state != "undefined" or look.now >= self._until:
            yield Happen(Event.LINKED, f"{t.autopilot} is ready")

    def on(self, news: News, look: Look) -> Iterator[Wish]:
        """It is there, or nobody is."""
        if isinstance(news, Done):
            self._until = look.now + look.settings.link.connect_timeout_s
            if self._late:
                yield Late()
        elif isinstance(news, Failed):
            waited_s = look.now - (self._since or look.now)
            between = self._between and waited_s <= look.settings.run.next_sortie_within_s
            if not between and not _others_heard(look):
                yield GiveUp(news.reason)
                return
            self._asked, self._not_before = False, look.now + RETRY_S
            if between:
                yield Note(f"the next sortie's aircraft is still waited for: {news.reason}")
            else:
                yield from self._go_without(news.reason)

    def _go_without(self, why: str) -> Iterator[Wish]:
        """The others go on, and nobody reckons with this one any more; said once."""
        if not self._late:
            self._late = True
            said = f"{why}; the others go on, and it may join them later"
            yield Note(said, logging.WARNING)
            yield Stay(said)


def _others_heard(look: Look) -> bool:
    """Whether another aircraft of the search is heard, or was, and may fly."""
    return any(each.system_id is not None and not each.ended for each in look.seen.others)


class Lacks:
    """Says what the aircraft lacks that a search needs, while somebody is to take it up by hand: it would be waited for
    in silence, or flown up in vain."""

    def __init__(self) -> None:
        self._since, self._told = math.inf, ""

    def tick(self, look: Look) -> Iterator[Wish]:
        """Say it once it has been so for a while, and again when it is something else."""
        lacks = "; ".join(look.seen.missing)
        self._since = min(self._since, look.now) if lacks else math.inf
        lasts = look.now - self._since >= max(LACKS_S, LEAST_PATIENCE_WALL_S * look.terms.speedup)
        if lasts and lacks != self._told and look.heard():
            self._told = lacks
            yield from warn(f"no search with this aircraft: {lacks}", look)


class Handover:
    """Takes an aircraft that hovers in the guided mode, once its position can be trusted.

    `between`: two sorties of a search, which one that is too far away does not end.
    """

    def __init__(self, *, between: bool = False) -> None:
        self._between = between
        self._told = False
        self._unfit = ""
        self._not_before = 0.0

    def tick(self, look: Look) -> Iterator[Wish]:
        """Take it when it is there to be taken."""
        t = look.seen.telemetry
        left_aloft = look.flight.flown and not self._between  # which must not hover there until it falls
        low = left_aloft and bool(look.energy_low())
        there = standing_still(t) if low else hovering(t)
        if not there or look.busy or look.now < self._not_before:
            return
        if low:
            yield EnterGuided(there=True)
            return
        unfit, before = look.helm.unfit(t, look.seen.others), self._unfit
        uneven = look.helm.traffic.uneven(t, look.seen.others)
        why = self._unfit = unfit or uneven
        if why and left_aloft and not look.helm.traffic.twin(t, look.seen.others):
            yield Hold("operator", why)
        elif unfit and not self._between:
            yield GiveUp(why)
        elif why:
            if not before:
                yield from warn(f"it is not taken over: {why}", look)
        elif not (doubts := look.helm.doubts(t, look.now)):
            yield EnterGuided(there=True)
        elif not self._told:  # what is not heard yet is no fault, and no reason to begin
            self._told = True
            yield Note(f"the search waits for the position: {'; '.join(doubts)}")

    def failed(self, look: Look) -> None:
        """It could not be taken; it is tried again."""
        self._not_before = look.now + RETRY_S


class Ready(Phase):
    """Until the search can begin: by a take-off, or when the aircraft hovers in the guided mode and its position is
    trusted.

    `left` is how an earlier process left the run.
    """

    def __init__(self, left: Standing) -> None:
        self._left = left
        self._begun = self._taking_off = False
        self._handover, self._lacks = Handover(), Lacks()

    def tick(self, look: Look) -> Iterator[Wish]:
        """Get ready, or wait for whoever flies."""
        t = look.seen.telemetry
        if not self._begun:
            self._begun = True
            yield from self._begin(look)
            return
        yield from self._lacks.tick(look)
        if on_ground(t):
            yield Stand()
            if self._left.goes_home:
                yield Happen(Event.HOMEWARD, "it was on its way home")
        elif not self._taking_off:
            yield from self._handover.tick(look)

    def on(self, news: News, look: Look) -> Iterator[Wish]:
        """It is ready, or ours."""
        if isinstance(news, Failed) and isinstance(news.action, WaitReady):
            yield GiveUp(news.reason)
        elif isinstance(news, Failed):
            self._handover.failed(look)
        elif isinstance(news, Done) and isinstance(news.action, WaitReady):
            yield climb(look)
        elif isinstance(news, Done) and self._left.goes_home:
            yield Happen(Event.HOMEWARD, "it was on its way home")
        elif isinstance(news, Done):
            yield Happen(Event.AIRBORNE, "in the air, in the guided mode")

    def _begin(self, look: Look) -> Iterator[Wish]:
        t, terms = look.seen.telemetry, look.terms
        down, why_left = on_ground(t), self._left.why.removeprefix(f"{AS_LEFT}: ")
        as_left = f"{AS_LEFT}: {why_left}"
        if twin := look.helm.traffic.twin(t, look.seen.others):  # whatever this one was: it is another one's
            yield GiveUp(twin)
            return
        if down:
            yield Stand()
        elif look.flight.flown:
            yield GoOn()
        if self._left.state == State.GROUNDED and down:
            yield Happen(Event.DOWN, as_left, stopped=self._left.why_stopped)
        elif down and self._between_sorties(look):
            said = f"it landed while no service was there; before that: {why_left}"
            yield Happen(Event.DOWN, said, stopped=self._left.why_stopped or said)
        elif self._left.state == State.YIELDED:
            yield Happen(Event.PILOT, as_left)
        elif self._left.state == State.HOLDING:
            yield Hold("operator", as_left)
        elif self._left.goes_home:
            yield Note(
                "it was on its way home: waiting until the aircraft is down, or hovers in the guided mode"
            )
        elif why := look.helm.no_way_home(t, look.seen.others):
            aloft = look.flight.flown and not down  # which is not left there until it falls
            yield Hold("operator", why) if aloft else GiveUp(why)
        elif down and terms.may_take_off and not order_needed(look):
            self._taking_off = True
            yield WaitReady()
        else:
            first = (
                ""
                if not down
                else "order launch, or take off and "
                if terms.may_take_off
                else "take off and "
            )
            yield Note(
                f"{first}select {look.seen.guided_title}: the search starts when the aircraft hovers in it"
            )
            yield Tell(f"search READY: {first}select {look.seen.guided_title}")
        by_hand = "" if terms.may_take_off else lands_beside(look)
        for said in [look.helm.far(t), by_hand, *look.helm.of_the_ground(t)]:
            if said:
                yield Note(said, 30)
                yield Tell(f"search: {said}", 4)

    def _between_sorties(self, look: Look) -> bool:
        """Whether another sortie is waited for: the search is not finished, and does not fly on by itself."""
        waits = look.settings.run.next_sortie_within_s > 0.0 and not self._left.goes_home
        return waits and look.flight.flown and not look.terms.may_take_off_again


def order_needed(look: Look) -> bool:
    """Whether only an order of now lets it take off, and no flag of an earlier hour."""
    terms = look.terms
    return terms.restarted or (look.flight.flown and not terms.may_take_off_again)


def lands_beside(look: Look) -> str:
    """What a person must know of two that land at one place, before the flight; the built-in world has no such fear."""
    return "" if look.settings.mock else look.helm.beside(look.seen.telemetry, look.seen.others)


def climb(look: Look) -> Happen:
    """Begin a take-off."""
    return Happen(Event.CLIMB, f"taking off to {look.helm.heights.take_off_m():.0f} m")


class TakingOff(Phase):
    """Guided mode, arm, climb: one after the other, each only while nobody wants it otherwise."""

    def __init__(self, height_m: float) -> None:
        self._height_m = height_m
        self._left: list[Action] = [EnterGuided(), Arm(), TakeOff(height_m)]
        self._begun = False
        self._turn = Turn()
        self._failed: Failed | None = None
        self._patient_until = self._again_at = 0.0
        self._doubted_since = math.inf
        # the mode that it leaves, and no other that a pilot selects meanwhile
        self._out_of: str | None = None
        self._until = math.inf

    def tick(self, look: Look) -> Iterator[Wish]:
        """The next step, once the position is trusted and the others leave room for it. After one that failed, what the
        pilot did may be told yet: the run goes on then."""
        if not self._begun:
            if doubts := look.helm.doubts(look.seen.telemetry, look.now):
                yield from self._wait("; ".join(doubts), look)
                return
            why = look.helm.traffic.take_off(look.seen.telemetry, self._height_m, look.seen.others, look.now)
            yield from self._turn.wait(why, "to take off", look)
            if why:
                return
            self._begun = True
            yield WriteRow(CommandRow("take off", height_m=self._height_m))
            yield Stand()
            if why := look.helm.grounded(look.seen):
                yield self._in_vain(why, look)
            elif beside := lands_beside(look):
                yield from warn(beside, look)
        if self._failed is not None:
            if look.now >= self._patient_until:
                yield self._in_vain(self._failed.reason, look)
        elif not look.busy and self._left and look.now >= self._again_at:
            step = self._left[0]
            if isinstance(step, EnterGuided):
                if self._out_of is None:
                    self._out_of = look.seen.telemetry.mode
                    self._until = look.now + look.settings.link.connect_timeout_s
                step = replace(step, out_of=self._out_of)
            yield step

    def _wait(self, doubts: str, look: Look) -> Iterator[Wish]:
        """What would hold it in the air keeps it on the ground, for as long as arming would be tried."""
        if math.isinf(self._doubted_since):
            self._doubted_since = look.now
            yield from warn(f"the take-off waits for the position: {doubts}", look)
        elif look.now - self._doubted_since > look.settings.link.connect_timeout_s:
            yield self._in_vain(doubts, look)

    def on(self, news: News, look: Look) -> Iterator[Wish]:
        """A step is done, or was in vain."""
        unheard = isinstance(news, Failed) and not news.answered and isinstance(news.action, EnterGuided)
        if unheard and look.now < self._until:  # a link that was silent for a moment ends no run
            self._again_at = look.now + RETRY_S
        elif isinstance(news, Failed):
            self._failed, self._patient_until = news, look.now + RETRY_S
        elif isinstance(news, Done):
            del self._left[0]
            if isinstance(news.action, Arm):
                yield Begin()
            if self._left:
                yield self._left[0]
            else:
                yield Happen(Event.AIRBORNE, f"at {self._height_m:.0f} m")

    def _in_vain(self, why: str, look: Look) -> GiveUp | Happen:
        """The aircraft does not take off: what is in the air already flies home. Between two sorties the search waits
        on for somebody to see to it."""
        t = look.seen.telemetry
        down = t.landed_state == "on_ground"
        if t.armed and t.in_control and not (down and t.alt_home_m < ALOFT_M):
            return Happen(Event.RETURN, why, stopped=why)
        if down and look.flight.sorties and look.settings.run.next_sortie_within_s > 0.0:
            return Happen(Event.DOWN, f"it did not take off: {why}")
        return GiveUp(why)
