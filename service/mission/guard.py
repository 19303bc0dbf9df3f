"""What is looked at in every tick, whatever the phase: is it safe to fly on?"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator

from service.mavlink.telemetry import Wind
from service.mission.effects import Note, Tell
from service.mission.phase import Happen, Hold, Wish
from service.mission.standing import Look
from service.mission.states import MOVING, Event, State
from service.mission.untold import Untold

CRITICAL = 2  # MAV_SEVERITY
SLOW_S = 2.0  # for so long a row may wait to be on disk before the aircraft waits too


def guard(ask: Callable[[], Look], untold: Untold, wind: Wind | None) -> Iterator[Wish]:
    """Can the position be trusted, is the waypoint flown, does it clear the ground and the other aircraft, is the
    journal written, is there the energy for the way home, is there too much wind?

    `ask` gives a look as it is after what was wished before.
    """
    look = ask()
    t, now, helm = look.seen.telemetry, look.now, look.helm
    moving = look.standing.state in MOVING
    trouble = helm.trouble(t, now, moving=moving)
    holds = moving or look.standing.state == State.HOLDING
    if trouble is not None and holds and not look.standing.goes_home_by_itself:
        yield Hold(trouble.cause, trouble.reason)
    low = helm.too_low(t, now) if moving else ""
    if low and not ask().standing.goes_home_by_itself:
        helm.heights.learn(t)
        yield Hold("ground", low)
        yield Note(f"{low}: climbing", logging.WARNING)
        yield Tell(f"search: {low}", CRITICAL)
    apart = helm.traffic.near(t, look.seen.others, now) if moving and t.in_control else ""
    if apart and not ask().standing.goes_home_by_itself:
        yield Hold("apart", apart)
    behind = look.seen.journal_behind_s
    if behind > SLOW_S and moving and not ask().standing.goes_home_by_itself:
        yield Hold("journal", f"the journal has not been written for {behind:.0f} s")
    yield from untold.tick(ask(), wind)
    if ask().standing.flying and (why := ask().energy_low()):
        yield Happen(Event.ENERGY_LOW, why, stopped=why, searched=True)
    if ask().standing.flying and (why := helm.too_windy(wind, now) or helm.strayed(t, now)):
        yield Happen(Event.RETURN, why, stopped=why)
