"""The mission's state machine: every state, every event, and what each pair leads to.

A search waits for the aircraft (WAITING), is READY when it may fly, climbs (TAKEOFF), and then alternates
between SEARCHING and CONFIRMING (a place looks promising: look again). It ends by being FOUND, where it may hover
until an operator decides, or by having searched enough, flies home (RETURNING), and is DONE on the ground. HOLDING is
a hover with a reason that can pass: the operator asked, the detector is silent, the link is gone. YIELDED means that
somebody else has the aircraft, the pilot, its autopilot or another ground station: nothing that moves it is sent until
an operator resumes, or, on the ground, launches. A search outlives a battery: GROUNDED is on the ground with the search
unfinished, waiting for the next sortie. ABORTED ends the run where it stands.

The table is the machine: `next_state` looks a pair up and does nothing else. A pair that is not in the table
changes nothing, which is what an event that comes too late should do.
"""

from __future__ import annotations

from enum import StrEnum


class State(StrEnum):
    WAITING = "WAITING"
    READY = "READY"
    TAKEOFF = "TAKEOFF"
    SEARCHING = "SEARCHING"
    CONFIRMING = "CONFIRMING"
    FOUND = "FOUND"
    HOLDING = "HOLDING"
    YIELDED = "YIELDED"
    RETURNING = "RETURNING"
    GROUNDED = "GROUNDED"
    DONE = "DONE"
    ABORTED = "ABORTED"


class Event(StrEnum):
    LINKED = "linked"  # paired, position known, ready to fly
    CLIMB = "climb"  # a take-off was ordered
    AIRBORNE = "airborne"  # at search height in the guided mode
    SUSPECT = "suspect"  # one place stands out
    CLEARED = "cleared"  # it no longer does
    CONFIRMED = "confirmed"  # the posterior passed the threshold, or an operator said so
    REJECTED = "rejected"  # an operator said that what was found is not the target
    SEARCHED = "searched"  # enough of the probability has been looked at
    ENERGY_LOW = "energy low"
    PILOT = "pilot"  # a mode change that was not asked for
    HOLD = "hold"
    RESUME = "resume"
    RETURN = "return"
    LANDED = "landed"  # and the run is over
    DOWN = "down"  # landed, and the search is not finished: another sortie may follow
    FINISH = "finish"  # an operator has had enough of the search
    ABORT = "abort"
    HOMEWARD = "homeward"  # the run that this one goes on with was on its way home


FLYING = (State.SEARCHING, State.CONFIRMING)
MOVING = (*FLYING, State.RETURNING)  # on the way to waypoints of ours
MAY_MOVE = frozenset({State.TAKEOFF, State.SEARCHING, State.CONFIRMING, State.RETURNING})
FINAL = frozenset({State.DONE, State.ABORTED})
SEARCHED_TO = "searched to POS"
"""So begins the reason of a search that is over because enough was searched."""
SETTLED = frozenset({Event.SEARCHED, Event.CONFIRMED, Event.FINISH})  # after these no sortie follows

TABLE: dict[tuple[State, Event], State] = {
    (State.WAITING, Event.LINKED): State.READY,
    (State.WAITING, Event.PILOT): State.YIELDED,
    (State.WAITING, Event.FINISH): State.DONE,
    (State.READY, Event.CLIMB): State.TAKEOFF,
    (State.READY, Event.AIRBORNE): State.SEARCHING,
    (State.READY, Event.HOMEWARD): State.RETURNING,
    (State.READY, Event.PILOT): State.YIELDED,
    (State.READY, Event.HOLD): State.HOLDING,
    (State.READY, Event.DOWN): State.GROUNDED,
    (State.READY, Event.FINISH): State.DONE,
    (State.TAKEOFF, Event.AIRBORNE): State.SEARCHING,
    (State.TAKEOFF, Event.PILOT): State.YIELDED,
    (State.TAKEOFF, Event.HOLD): State.HOLDING,
    (State.TAKEOFF, Event.RETURN): State.RETURNING,
    (State.TAKEOFF, Event.FINISH): State.RETURNING,
    (State.TAKEOFF, Event.DOWN): State.GROUNDED,
    (State.SEARCHING, Event.SUSPECT): State.CONFIRMING,
    (State.CONFIRMING, Event.CLEARED): State.SEARCHING,
    (State.HOLDING, Event.RESUME): State.SEARCHING,
    (State.HOLDING, Event.CLIMB): State.TAKEOFF,
    (State.HOLDING, Event.PILOT): State.YIELDED,
    (State.HOLDING, Event.RETURN): State.RETURNING,
    (State.HOLDING, Event.ENERGY_LOW): State.RETURNING,
    (State.HOLDING, Event.FINISH): State.RETURNING,
    (State.HOLDING, Event.CONFIRMED): State.FOUND,
    (State.HOLDING, Event.LANDED): State.DONE,
    (State.HOLDING, Event.DOWN): State.GROUNDED,
    (State.YIELDED, Event.RESUME): State.SEARCHING,
    (State.YIELDED, Event.CLIMB): State.TAKEOFF,
    (State.YIELDED, Event.RETURN): State.RETURNING,
    (State.YIELDED, Event.FINISH): State.DONE,
    (State.YIELDED, Event.LANDED): State.DONE,
    (State.YIELDED, Event.DOWN): State.GROUNDED,
    (State.FOUND, Event.REJECTED): State.SEARCHING,
    (State.FOUND, Event.RETURN): State.RETURNING,
    (State.FOUND, Event.ENERGY_LOW): State.RETURNING,
    (State.FOUND, Event.HOLD): State.HOLDING,
    (State.FOUND, Event.PILOT): State.YIELDED,
    (State.FOUND, Event.LANDED): State.DONE,
    (State.FOUND, Event.FINISH): State.RETURNING,
    (State.RETURNING, Event.PILOT): State.YIELDED,
    (State.RETURNING, Event.REJECTED): State.SEARCHING,
    (State.RETURNING, Event.HOLD): State.HOLDING,
    (State.RETURNING, Event.LANDED): State.DONE,
    (State.RETURNING, Event.DOWN): State.GROUNDED,
    (State.GROUNDED, Event.CLIMB): State.TAKEOFF,
    (State.GROUNDED, Event.AIRBORNE): State.SEARCHING,
    (State.GROUNDED, Event.CONFIRMED): State.DONE,
    (State.GROUNDED, Event.FINISH): State.DONE,
    (State.GROUNDED, Event.LANDED): State.DONE,
    **{
        (state, event): to
        for state in FLYING
        for event, to in {
            Event.CONFIRMED: State.FOUND,
            Event.SEARCHED: State.RETURNING,
            Event.ENERGY_LOW: State.RETURNING,
            Event.PILOT: State.YIELDED,
            Event.HOLD: State.HOLDING,
            Event.RETURN: State.RETURNING,
            Event.FINISH: State.RETURNING,
            Event.LANDED: State.DONE,
        }.items()
    },
    **{(state, Event.ABORT): State.ABORTED for state in State if state not in FINAL},
}


def next_state(state: State, event: Event) -> State:
    """The state that `event` leads to from `state`; the same state where the table has no entry."""
    return TABLE.get((state, event), state)


def diagram() -> str:
    """The table as a Mermaid state diagram, one arrow for each pair of states with all that leads along it."""
    arrows: dict[tuple[State, State], list[Event]] = {}
    for (state, event), to in TABLE.items():
        if event != Event.ABORT:
            arrows.setdefault((state, to), []).append(event)
    lines = ["stateDiagram-v2", f"    [*] --> {State.WAITING}"]
    for state in State:
        for to in State:
            if (state, to) in arrows:
                lines.append(f"    {state} --> {to}: {', '.join(arrows[state, to])}")
    lines += [f"    {state} --> [*]" for state in State if state in FINAL]
    return "\n".join(lines) + "\n"
