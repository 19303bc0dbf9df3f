"""What the vehicle does by itself: the pilot's mode changes, a lost link, a waypoint that it does not fly, landing."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

from service.geometry import offset_m
from service.mavlink.events import (
    AnotherService,
    ArmedChanged,
    CommandDone,
    LandedChanged,
    LinkBack,
    LinkLost,
    ModeChanged,
    Notice,
    Paired,
    Rebooted,
    ReferenceMoved,
    Stalled,
    StatusText,
    TargetNotTaken,
    TargetReplaced,
    TargetTaken,
    VehicleEvent,
)
from service.mavlink.telemetry import Telemetry
from service.mission.departing import order_needed
from service.mission.effects import Note, Tell, WriteRow
from service.mission.orders import gives_back
from service.mission.phase import Happen, Hold, Lost, Overtaken, Stay, Wish, touchdown
from service.mission.situation import on_ground
from service.mission.standing import Look, Standing
from service.mission.states import MOVING, Event, State
from service.mission.takeover import Takeovers
from service.mission.vehicle_clock import VehicleClock
from service.rows import ModeRow, NotTakenRow, VehicleRow, YieldedRow

REFUSALS = 2  # so many waypoints in a row that are not flown are no bad luck
SILENT = "the autopilot is silent"
_WAITS = (State.WAITING, State.READY)
_THEIRS = (State.YIELDED, State.GROUNDED)  # nothing of ours moves anyway
Listener = Callable[..., Iterator[Wish]]  # of the watch, the event that it stands beside, and a look


class VehicleWatch:
    """Reads what the vehicle tells, whatever the phase, and says what follows."""

    def __init__(self) -> None:
        self._refused = 0  # waypoints in a row that were not flown
        self._stalled_at = -math.inf
        self._takeovers = Takeovers()
        self._clock = VehicleClock()
        self._up = False  # it has been seen in the air, and not on the ground since

    def read(self, event: VehicleEvent, look: Look) -> Iterator[Wish]:
        """What follows from an event."""
        why = self._takeovers.read(event, landing=_lands(look.standing), written=look.chart.written)
        if isinstance(event, ModeChanged):
            yield WriteRow(ModeRow(event.mode, event.commanded))
        if why:
            yield from self._taken(why, look)
        yield from LISTENERS[type(event)](self, event, look)

    def _taken(self, why: str, look: Look) -> Iterator[Wish]:
        """The aircraft is somebody else's now. One that is waited for, until its pilot hands it over, is so anyway, but
        for one that we are about to take off with."""
        state = look.standing.state
        yield Overtaken(why)
        if state in _THEIRS:
            yield Stay(why)
            yield WriteRow(YieldedRow(why))
        elif state not in _WAITS or (look.terms.may_take_off and (look.busy or not order_needed(look))):
            yield Happen(Event.PILOT, why)

    # ---- the listeners

    def _nothing(self, event: VehicleEvent, look: Look) -> Iterator[Wish]:
        """The telemetry shows it, or `Takeovers` has read it."""
        yield from ()

    def _paired(self, event: Paired, look: Look) -> Iterator[Wish]:
        """Which aircraft it is, for whoever reads the run later."""
        yield WriteRow(VehicleRow(event.system_id, event.autopilot))

    def _mode(self, event: ModeChanged, look: Look) -> Iterator[Wish]:
        """What follows when the aircraft is in the guided mode again, and nobody has said whose it is."""
        if look.standing.state == State.YIELDED and event.guided and not event.commanded:
            yield Tell(f"search YIELDED: in {look.seen.guided_title} again; {gives_back(look)}", 5)

    def _stalled(self, event: Stalled, look: Look) -> Iterator[Wish]:
        self._stalled_at = event.time
        yield Lost()

    def _link_lost(self, event: LinkLost, look: Look) -> Iterator[Wish]:
        yield _hold("link", SILENT, look)

    def _taken_up(self, event: TargetTaken, look: Look) -> Iterator[Wish]:
        self._refused = 0
        yield from ()

    def _another(self, event: AnotherService, look: Look) -> Iterator[Wish]:
        """Two services on one aircraft: each says so, and a person ends one of them."""
        yield Note(f"this aircraft has two masters: {event.reason}; end one of them", 30)
        yield Tell(f"search: {event.reason}; end one", 4)

    def _notice(self, event: Notice, look: Look) -> Iterator[Wish]:
        """On the page, on the console, and to the pilot."""
        yield Note(event.text, 30)
        yield Stay(event.text)
        yield Tell(f"search: {event.text}", 4)

    def _moved(self, event: ReferenceMoved, look: Look) -> Iterator[Wish]:
        """What follows from it is computed anew wherever it is used; a person must know why heights change."""
        before, after = event.before.alt_amsl_m, event.after.alt_amsl_m
        far = math.hypot(*offset_m((event.before.lat, event.before.lon), (event.after.lat, event.after.lon)))
        aside = f"{far:.0f} m to the side, " if far >= 1.0 else ""
        said = f"{event.what} has moved: {aside}{before:.0f} to {after:.0f} m above sea level"
        yield Note(said, 30)
        yield Tell(f"search: {said}", 4)
        if event.position_too and look.standing.state in (*MOVING, State.HOLDING):
            moved = "the position has moved with the estimator's origin: is it where the map says?"
            yield _hold("operator", moved, look)

    def _not_taken(self, event: TargetNotTaken, look: Look) -> Iterator[Wish]:
        """The autopilot does not fly to the waypoint: hold, for what that is most likely due to.

        On a bad radio a waypoint may get lost as often as it is repeated, so another one is tried first.
        """
        yield WriteRow(NotTakenRow(event.target.lat, event.target.lon))
        if event.time == self._stalled_at:  # given up because we stood still: it is sent again
            return
        self._refused += 1
        if look.standing.state not in MOVING:
            yield Note(f"the stop is not flown: {event.reason}", 30)
            if self._refused < REFUSALS:
                yield Lost()
        elif not look.heard():
            yield _hold("link", SILENT, look)
        elif doubts := look.helm.doubts(look.seen.telemetry, look.now):
            yield _hold("position", "; ".join(doubts), look)
        elif self._refused < REFUSALS:
            yield Lost()
        else:
            yield _hold("target", f"the waypoint is not flown: {event.reason}", look)

    def tick(self, look: Look) -> Iterator[Wish]:
        """What only time shows."""
        yield from self._clock.tick(look)

    def see(self, t: Telemetry) -> None:
        """Remember that it has been in the air."""
        self._up |= t.landed_state == "in_air"

    def landed(self, look: Look) -> Iterator[Wish]:
        """Whether the aircraft has landed while somebody else had it, or it held; while more events wait, why it
        landed may be among them."""
        standing, t = look.standing, look.seen.telemetry
        if not self._up or look.seen.events_waiting or standing.state not in (State.YIELDED, State.HOLDING):
            return
        if on_ground(t):
            self._up = False
            why = f"landed before the search was over: {standing.why}"
            said = self._takeovers.said(standing.since)  # often told only after the mode has changed
            yield touchdown(look, "on the ground, disarmed", stopped=why + (said if said not in why else ""))


def _hold(cause: str, why: str, look: Look) -> Hold | Note:
    """Hover for a cause, unless the autopilot flies home by our order: nothing breaks that off."""
    return (
        Note(f"flying home all the same: {why}", 30)
        if look.standing.goes_home_by_itself
        else Hold(cause, why)
    )


def _lands(standing: Standing) -> bool:
    """Whether it goes home, where it disarms by itself."""
    return standing.state == State.RETURNING or (standing.state in _WAITS and standing.homeward)


LISTENERS: dict[type, Listener] = {
    Paired: VehicleWatch._paired,
    ModeChanged: VehicleWatch._mode,
    ArmedChanged: VehicleWatch._nothing,
    LandedChanged: VehicleWatch._nothing,
    LinkLost: VehicleWatch._link_lost,
    LinkBack: VehicleWatch._nothing,
    Rebooted: VehicleWatch._nothing,
    Stalled: VehicleWatch._stalled,
    StatusText: VehicleWatch._nothing,
    TargetTaken: VehicleWatch._taken_up,
    TargetNotTaken: VehicleWatch._not_taken,
    TargetReplaced: VehicleWatch._nothing,
    AnotherService: VehicleWatch._another,
    Notice: VehicleWatch._notice,
    ReferenceMoved: VehicleWatch._moved,
    CommandDone: VehicleWatch._nothing,
}
"""Who listens to what the link tells: everything has a listener, if only one that says why nothing follows."""
