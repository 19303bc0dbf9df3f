"""On the ground with the search unfinished: a fresh battery, and then the next sortie.

Nothing of ours moves here. The next sortie begins when the pilot takes off and gives the aircraft over in the guided
mode, or when an operator orders `launch`; it is flown by another aircraft, if an operator orders `replace` before. The
run ends when an operator orders `finish`, or nobody flies for long.
"""

from __future__ import annotations

from collections.abc import Iterator

from service.chances import sure
from service.mission.departing import Handover, Lacks, climb
from service.mission.effects import Connect, Note, WaitReady
from service.mission.news import Done, Failed, News
from service.mission.phase import RETRY_S, Happen, Phase, Stand, Stay, Wish, say
from service.mission.situation import on_ground
from service.mission.standing import Look
from service.mission.states import Event

FRESH_PERCENT = 10.0
"""By so much more than at the landing a battery is another one, and not the same that has rested."""


class Grounded(Phase):
    """GROUNDED. `percent` is the battery's level at the landing, where that was told; `coming`: another aircraft is
    waited for, and the one that landed is not there any more."""

    def __init__(self, percent: float | None, *, coming: bool = False) -> None:
        self._percent, self._coming = percent, coming
        self._handover, self._lacks = Handover(between=True), Lacks()
        self._told = self._fresh = False
        self._not_before = 0.0

    def tick(self, look: Look) -> Iterator[Wish]:
        """Wait for a battery, for whoever flies, or for too long."""
        t, standing = look.seen.telemetry, look.standing
        waits_s = look.settings.run.next_sortie_within_s
        if look.seen.searched >= look.seen.enough:  # by others, meanwhile: nothing is left to fly for
            why = f"searched to POS {sure(look.seen.searched)}"
            yield Happen(Event.FINISH, why, stopped=why, searched=True)
            return
        if not self._told:
            self._told = True
            yield from say(f"the search is not finished: {how_to_fly(look)}, or finish", look)
        if (self._coming or on_ground(t)) and look.now - standing.since > waits_s:
            yield Happen(Event.LANDED, f"nobody flew again within {waits_s / 60.0:.0f} min")
        elif self._coming:
            if not look.busy and look.now >= self._not_before:
                yield Connect()
        elif on_ground(t):
            yield Stand()
            yield from self._lacks.tick(look)
            yield from self._look_at_the_battery(look)
        else:
            yield from self._handover.tick(look)

    def on(self, news: News, look: Look) -> Iterator[Wish]:
        """Another one is there, or it is ready to take off by itself, or ours in the air."""
        if isinstance(news, Done) and isinstance(news.action, Connect):
            self._coming = False
            yield from _arrived(look)
        elif isinstance(news, Failed) and isinstance(news.action, Connect):
            self._not_before = look.now + RETRY_S
            yield Note(f"another aircraft is still waited for: {news.reason}")
        elif isinstance(news, Done) and isinstance(news.action, WaitReady):
            yield climb(look)
        elif isinstance(news, Done):
            yield Happen(Event.AIRBORNE, "in the air, in the guided mode")
        elif isinstance(news, Failed):
            self._handover.failed(look)
            self._not_before = look.now + RETRY_S

    def _look_at_the_battery(self, look: Look) -> Iterator[Wish]:
        """Tell of a fresh one; the aircraft of the built-in world, which landed for want of energy, flies with it."""
        percent = look.seen.telemetry.battery_percent
        if percent is not None:
            if self._percent is None:
                self._percent = percent
            if not self._fresh and percent >= self._percent + FRESH_PERCENT:
                self._fresh = True
                yield from say(f"fresh battery, {percent:.0f} %: {how_to_fly(look)}", look)
            self._percent = min(self._percent, percent)
        by_itself = look.terms.may_take_off_again and look.standing.searched
        if self._fresh and by_itself and not look.busy and look.now >= self._not_before:
            yield WaitReady()


def _arrived(look: Look) -> Iterator[Wish]:
    """What a person must know of another aircraft that is there now."""
    t = look.seen.telemetry
    yield Stay(f"another aircraft: system {t.system_id} ({t.autopilot})")
    yield from say(f"another aircraft, system {t.system_id} ({t.autopilot}): {how_to_fly(look)}", look)
    for said in [look.helm.far(t), *look.helm.of_the_ground(t)]:
        if said:
            yield from say(said, look)


def how_to_fly(look: Look) -> str:
    """What a person has to do for the next sortie."""
    by_hand = f"take off and select {look.seen.guided_title}"
    return f"order launch, or {by_hand}" if look.terms.may_take_off else by_hand
