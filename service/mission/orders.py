"""What an operator orders, and what it takes: some orders need the aircraft in the guided mode and in our hands."""

from __future__ import annotations

from collections.abc import Iterator

from service.mission.departing import climb
from service.mission.effects import Answer, EnterGuided, WaitReady
from service.mission.finding import tell
from service.mission.news import Judged, Order
from service.mission.phase import ComeUp, Find, Happen, Hold, Overtaken, Pending, Replace, Settle, Wish, warn
from service.mission.situation import on_ground
from service.mission.standing import Look
from service.mission.states import FLYING, TABLE, Event, State

ASKED = "the operator asked"
SIGNAL = "stopped by a signal"
_EVENTS = {
    "hold": Event.HOLD,
    "resume": Event.RESUME,
    "return": Event.RETURN,
    "finish": Event.FINISH,
    "abort": Event.ABORT,
}
_SO_ALREADY = {
    "hold": {State.HOLDING},
    "resume": FLYING,
    "return": {State.RETURNING},
    "finish": {State.RETURNING},
    "abort": {State.ABORTED},
}
FINISHED = "the operator finished the search"
STOPPING = ("hold", "return", "home", "finish", "abort", "leave")
"""Orders that go out first and are journalled after. What was ordered before one of them counts no more."""
OFFERED = ("hold", "resume", "return", "launch", "replace", "finish")
"""Orders that a page has a button for."""
_HOMEWARD = {
    "return": ("the operator asked to return", None),
    "finish": (FINISHED, FINISHED),
    "home": (SIGNAL, ""),
}
"""Orders that bring home what an earlier process has left in the air: why, and whether that settles the search."""
_MAY_LAUNCH = (State.READY, State.GROUNDED, State.YIELDED, State.HOLDING)
_BEFOREHAND = ("hold", "return", "finish")  # mean something to an aircraft that is not heard yet
STICKS = 0.15  # part of their way, from which on deflected sticks are a hand on them


def ordered(order: Order, look: Look) -> Iterator[Wish]:
    """Hold, resume, return, launch, replace, finish or abort."""
    state, ours, t = look.standing.state, _ours(look), look.seen.telemetry
    down, first = on_ground(t), False
    wish: Happen | Hold
    if order.command in STOPPING:
        yield Overtaken(f"the operator ordered {order.command}")
    if state == State.WAITING and order.command in _BEFOREHAND:
        why = FINISHED if order.command == "finish" else ASKED
        yield ComeUp(_EVENTS[order.command], why, order.ticket)
        return
    if order.command == "return" and state == State.READY and down and look.terms.may_take_off:
        yield Hold("operator", ASKED)  # it is at home: a flag must not fly it after that
        yield Answer(order.ticket)
        return
    if order.command in _HOMEWARD and _left_aloft(look):
        why, settles = _HOMEWARD[order.command]
        home = Happen(Event.HOMEWARD, why, stopped=why, searched=order.command == "finish")
        then = (home,) if settles is None else (home, Settle(settles))
        yield Pending(order.command, EnterGuided(), then, order.ticket)
        return
    if why := _refusal(order.command, look):
        if order.command in STOPPING and look.ordered:  # that is what it was to stop
            yield Answer(order.ticket)
            return
        yield from warn(f"{order.command} is refused: {why}", look)
        yield Answer(order.ticket, why)
        return
    match order.command:
        case "hold":  # the autopilot may be climbing, or flying home by itself
            wish = Hold("operator", ASKED)
            first = state in (State.RETURNING, State.TAKEOFF) and not ours and not down
        case "resume":
            wish = Happen(Event.RESUME, ASKED)
            first = state in (State.YIELDED, State.HOLDING) and not ours
        case "return":
            wish = Happen(Event.RETURN, ASKED, stopped="the operator asked to return")
            first = _taken_home(look) and not down
        case "launch":
            yield Answer(order.ticket)  # getting ready may take long
            yield Pending(order.command, WaitReady(), (climb(look),), 0)
            return
        case "replace":
            yield Replace(order.system_id)
            yield Answer(order.ticket)
            return
        case "finish" if state == State.RETURNING:
            yield Settle(FINISHED)
            yield Answer(order.ticket)
            return
        case "finish":
            wish = Happen(Event.FINISH, ASKED, stopped=FINISHED, searched=True)
        case "home" if (state, Event.RETURN) not in TABLE:  # nobody of ours has it, and it is left to who has
            wish = Happen(Event.ABORT, SIGNAL, stopped=SIGNAL)
        case "home":  # and the process ends, whatever is left to search
            yield Happen(Event.RETURN, SIGNAL, stopped=SIGNAL)
            yield Settle("")
            yield Answer(order.ticket)
            return
        case "leave":  # whoever ends the process has said nothing about the search
            wish = Happen(Event.ABORT, SIGNAL, stopped=SIGNAL)
        case "abort":
            wish, first = Happen(Event.ABORT, ASKED, stopped="the operator aborted the run"), False
        case _:
            yield Answer(order.ticket)
            return
    if first:
        yield Pending(order.command, EnterGuided(), (wish,), order.ticket)
    else:
        yield wish
        yield Answer(order.ticket)


def sensible(look: Look) -> list[str]:
    """The orders that would change something now. What else may be against one is told to whoever gives it."""
    state = look.standing.state
    stops = ["hold"] if look.ordered else []  # a launch that gets ready
    if state == State.WAITING:
        stops = ["hold", "return"]
    return [each for each in OFFERED if each in stops or not (_senseless(each, look) or _is_so(each, state))]


def concerned(command: str, look: Look) -> bool:
    """Whether an order means something now, be it that it is carried out already; whether it may be is another
    question."""
    stops = command in STOPPING and bool(look.ordered)
    return stops or not _senseless(command, look)


def _is_so(command: str, state: State) -> bool:
    """Whether an order asks for what is already done; a second finish still ends the search."""
    return command != "finish" and state in _SO_ALREADY.get(command, ())


def judged(word: Judged, look: Look) -> Iterator[Wish]:
    """What follows from an operator's word on a place, which the belief knows by now."""
    standing = look.standing
    said = f"the operator {'confirmed' if word.confirmed else 'rejected'} the place"
    if not word.moves:  # it counts where the search goes on, or ends
        if not word.confirmed and word.found is None:
            yield Find(None)
        yield from warn(f"{said}; the aircraft stays stopped, as was said since", look)
        yield Answer(word.ticket)
        return
    if word.confirmed and word.found is not None:
        yield Find(word.found)
        yield from tell(word.found, look, said)
    elif not word.confirmed and standing.found is not None and word.found is None:
        yield Find(None)
        wish = Happen(Event.REJECTED, said)
        ended_for_it = standing.state == State.RETURNING and not standing.why_stopped
        if ended_for_it and not _ours(look):
            yield Pending("reject", EnterGuided(), (wish,), word.ticket)
            return
        if ended_for_it or standing.state == State.FOUND:
            yield wish
    yield Answer(word.ticket)


def _refusal(command: str, look: Look) -> str:
    """Why an order cannot be obeyed now, for the person who gave it, or nothing."""
    t = look.seen.telemetry
    if why := _senseless(command, look):
        return why
    resumes = command == "resume" and look.standing.state in (State.YIELDED, State.HOLDING)
    takes = command == "launch" or resumes or (command == "return" and _taken_home(look))
    if takes and (twin := look.helm.traffic.twin(t, look.seen.others)):
        return twin
    if takes and (t.sticks or 0.0) > STICKS:
        return "the pilot's sticks are not in the middle; the pilot has the aircraft"
    if command == "launch":
        if not look.terms.may_take_off:
            return "this service was not allowed to arm or take off (--takeoff)"
        return look.helm.grounded(look.seen)
    if command == "replace" and look.heard() and not on_ground(t):
        return "the aircraft that is heard does not stand on the ground with its motors off"
    return ""


def _left_aloft(look: Look) -> bool:
    """An earlier process has left the aircraft in the air, in the guided mode, and it is not in our hands yet."""
    t = look.seen.telemetry
    return look.standing.state == State.READY and look.flight.flown and t.guided and not on_ground(t)


def _senseless(command: str, look: Look) -> str:
    """Why an order means nothing to the aircraft as it is; or nothing."""
    state, down = look.standing.state, on_ground(look.seen.telemetry)
    if command == "return" and _left_aloft(look):
        return ""
    if command in _EVENTS and state not in _SO_ALREADY[command] and (state, _EVENTS[command]) not in TABLE:
        return f"there is nothing to {command} in {state}"
    if command == "resume" and state in (State.YIELDED, State.HOLDING) and down:
        return "the aircraft is on the ground; order launch, or take off and then resume"
    if command == "launch" and (state not in _MAY_LAUNCH or not down):
        return f"a launch is for an aircraft on the ground before its flight; this one is {state}"
    if command == "replace" and state != State.GROUNDED:
        return f"another aircraft comes between two sorties, in {State.GROUNDED}; this one is {state}"
    return ""


def _taken_home(look: Look) -> bool:
    """A return takes the aircraft: its pilot has it, or a restart has not got it in hand yet."""
    state = look.standing.state
    return state == State.YIELDED or (state == State.HOLDING and not look.seen.telemetry.in_control)


def _ours(look: Look) -> bool:
    """The aircraft is in our hands, and follows our waypoints."""
    t = look.seen.telemetry
    return t.in_control and t.guided and not look.standing.autopilot_returns


def gives_back(look: Look) -> str:
    """What a person does who gives a yielded aircraft back."""
    if not on_ground(look.seen.telemetry):
        return "Resume gives it back"
    return "Launch gives it back" if look.terms.may_take_off else "take off, then Resume gives it back"
