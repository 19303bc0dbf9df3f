"""From 'this place is probable enough' to the end of the search: found, and what then.

FOUND is a posterior: the most likely place and its neighbours hold `search.found_at` or more, and a hit was reported
there (or an operator confirmed it). Then `search.on_found` decides: "return" flies home, "hover" waits over the place
for an operator, "continue" goes on looking. An operator who confirms a place ends the search; one who rejects it adds
the evidence that it is not there, and a search that had ended for that place goes on.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

from service.chances import sure
from service.evidence.found import Found
from service.geometry import distance_m
from service.mission.effects import Stop, WriteRow
from service.mission.phase import ComeUp, Find, Happen, Phase, Settle, Unsettle, Wish, say
from service.mission.standing import Look
from service.mission.states import Event, State
from service.rows import FoundRow

_ELSEWHERE_M = 10.0  # every look moves the place a little, which the pilot need not hear


def found_now(look: Look) -> Iterator[Wish]:
    """See whether the target is found now, which may end the search."""
    known, found = look.standing.found, look.seen.found
    yield Find(found)
    if found is not None and (known is None or (known.lat, known.lon) != (found.lat, found.lon)):
        yield from tell(found, look, "sure enough to end the search")


def found_after_all(look: Look) -> Iterator[Wish]:
    """See whether the target is found by what is reported, or said, after the search of a battery: on the way home, and
    on the ground, where no other sortie need follow then."""
    standing, known, found = look.standing, look.standing.found, look.seen.found
    homeward = standing.state == State.RETURNING and standing.why_stopped
    if not homeward and standing.state != State.GROUNDED:
        return
    yield Find(found)
    if found is None:
        return
    at = _at(found, look)
    moved_m = math.inf if known is None else distance_m((known.lat, known.lon), (found.lat, found.lon))
    if moved_m > 0.0:
        yield WriteRow(FoundRow(found))
    if moved_m > _ELSEWHERE_M:
        yield from say(at, look)
    if standing.state == State.GROUNDED and (
        look.seen.confirmed or look.settings.search.on_found == "return"
    ):
        yield Happen(Event.CONFIRMED, at)


def tell(found: Found, look: Look, why: str) -> Iterator[Wish]:
    """Write down what was found; it ends the search unless that is to continue and nobody confirmed it."""
    yield WriteRow(FoundRow(found))
    if look.seen.confirmed or look.settings.search.on_found != "continue":
        how = "" if look.seen.confirmed else f" p={found.probability:.4f}"
        told = f"{look.chart.written((found.lat, found.lon))}{how}"  # the 50 characters of one STATUSTEXT
        yield Happen(Event.CONFIRMED, f"{_at(found, look)}: {why}", told=told)


def _at(found: Found, look: Look) -> str:
    """Where, and how sure; a person who has confirmed it is."""
    place = look.chart.written((found.lat, found.lon))
    return f"found at {place}" + ("" if look.seen.confirmed else f", {sure(found.probability)} sure")


def over_for_all(look: Look) -> Iterator[Wish]:
    """What follows for one of several aircraft that does not search itself when the search is over: it flies no more.

    One that searches sees the same by itself. What its pilot has, or an operator holds, stays so, and is down for good
    when it is down.
    """
    why, standing = look.seen.over, look.standing
    if not why or standing.settled or standing.flying:
        return
    silent = standing.state == State.HOLDING and standing.causes <= {"detector"}
    if standing.state == State.WAITING:
        yield ComeUp(Event.FINISH, why)
    elif standing.state == State.READY and look.flight.aloft_s(look.now) > 0.0:
        return  # an earlier process left it in the air: it comes up as that did, and is not left to hover
    elif standing.state in (State.READY, State.TAKEOFF, State.GROUNDED) or silent:
        yield Happen(Event.FINISH, why, stopped=why, searched=True)
    else:
        yield Settle(why)


def not_enough_after_all(look: Look) -> Iterator[Wish]:
    """See whether news, or news taken back, leave less searched than the search ended for."""
    seen = look.seen
    if look.standing.enough and seen.searched < seen.enough:
        why = f"by the news only POS {sure(seen.searched)} is searched: the search is not over"
        yield Unsettle(why)
        yield from say(why, look)


class OverThePlace(Phase):
    """FOUND: fly home from what was found, or hover until an operator decides or the energy runs low."""

    def __init__(self) -> None:
        self._stop = True

    def lost(self, look: Look) -> None:
        """The stop may not have arrived: stop again."""
        self._stop = True

    def tick(self, look: Look) -> Iterator[Wish]:
        """Wait, or fly home."""
        if look.settings.search.on_found != "hover" or look.seen.confirmed:
            yield Happen(Event.RETURN, "found: flying home")
        elif why := look.energy_low():
            yield Happen(Event.ENERGY_LOW, why, stopped=why)
        elif self._stop:
            self._stop = False
            yield Stop()
