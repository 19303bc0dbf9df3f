"""What a change of state brings with it: how the mission stands after it, and the phase that begins."""

from __future__ import annotations

from dataclasses import replace

from service.mission.departing import Ready, TakingOff
from service.mission.finding import OverThePlace
from service.mission.grounded import Grounded
from service.mission.holding import Holding
from service.mission.homeward import Homeward
from service.mission.phase import Happen, Phase
from service.mission.searching import Searching
from service.mission.standing import Look, Standing
from service.mission.states import FLYING, SETTLED, Event, State


def entered(standing: Standing, after: State, wish: Happen, now: float) -> Standing:
    """How it stands once the event of `wish` has brought it into the state `after`."""
    begins = after in FLYING and standing.state not in FLYING
    holds = after == State.HOLDING  # a cause that outlives its hold would keep the next one from ending
    first = not standing.why_stopped or begins or wish.event == Event.FINISH
    return replace(
        standing,
        state=after,
        why=wish.reason,
        since=now,
        why_stopped=wish.stopped if first else standing.why_stopped,
        searched=wish.searched if first else standing.searched,
        settled=(standing.settled or wish.event in SETTLED) and after not in FLYING,
        enough=still_enough(standing, wish.event, after),
        causes=standing.causes if holds else frozenset(),
        homeward=after == State.RETURNING or (standing.homeward and (holds or after == State.READY)),
        direct=(standing.direct or wish.direct) and after not in FLYING,
        autopilot_returns=False,
    )


def still_enough(standing: Standing, event: Event, after: State) -> bool:
    """Whether all that settles the search once an event has led to a state is that enough was searched."""
    others = SETTLED - {Event.SEARCHED}
    return (event == Event.SEARCHED or (standing.enough and event not in others)) and after not in FLYING


def phase_of(state: State, before: State, left: Standing, look: Look) -> Phase:
    """The phase that a state begins with; `left`: how the run that this one goes on with was left."""
    if state in FLYING:
        return Searching(look)
    match state:
        case State.READY:
            return Ready(left)
        case State.TAKEOFF:
            return TakingOff(look.helm.heights.take_off_m())
        case State.HOLDING:
            return Holding(as_left=before == State.READY)
        case State.FOUND:
            return OverThePlace()
        case State.RETURNING:
            return Homeward()
        case State.GROUNDED:
            return Grounded(look.seen.telemetry.battery_percent)
        case _:
            return Phase()
