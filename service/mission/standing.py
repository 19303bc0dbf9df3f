"""How a mission stands: all that the table's states are about, in one value with one owner, the core."""

from __future__ import annotations

from dataclasses import dataclass, replace

from service.config import Settings
from service.evidence.found import Found
from service.mission.chart import Chart
from service.mission.energy import Energy, Left
from service.mission.flight import Flight
from service.mission.helm import Helm
from service.mission.situation import Situation
from service.mission.states import FLYING, Event, State

LEAST_PATIENCE_WALL_S = 1.5

_FIRST, _LAST = 200, 300  # characters of a reason that has become too long


def one_more(why: str, more: str) -> str:
    """A reason with one more, unless it has that: what came first and what came last, however many there were."""
    said = why if more in why else "; ".join(filter(None, (why, more)))
    return said if len(said) <= _FIRST + _LAST else f"{said[:_FIRST]} ... {said[-_LAST:]}"


@dataclass(frozen=True, slots=True)
class Standing:
    """Where the mission stands.

    Args:
        state: its state in the table.
        why: the reason of the last transition.
        since: when that was.
        why_stopped: why the search ended or the run was broken off; empty while it goes on.
        searched: the search ended because there was nothing more to gain, not by an order.
        settled: nothing is left to fly for: it was searched enough, found, or an operator has finished it.
        enough: it is settled because it was searched enough, which news may change.
        found: the place that counts as found.
        causes: what it holds for; the hold ends when none is left.
        homeward: it flies home, or holds on the way there, or waits after a restart that found it so.
        direct: the way home is the autopilot's own: ours could not be flown.
        autopilot_returns: the return to launch was ordered: it flies by itself now, or soon.
        listening_since: since when a silence of the detector counts.
    """

    state: State = State.WAITING
    why: str = ""
    since: float = 0.0
    why_stopped: str = ""
    searched: bool = False
    settled: bool = False
    enough: bool = False
    found: Found | None = None
    causes: frozenset[str] = frozenset()
    homeward: bool = False
    direct: bool = False
    autopilot_returns: bool = False
    listening_since: float = 0.0

    @property
    def goes_home(self) -> bool:
        """Nothing is left but the way home."""
        return self.state in (State.RETURNING, State.FOUND)

    @property
    def comes_home(self) -> bool:
        """It flies home, or will once a hold on the way is over, or has."""
        return self.state == State.DONE or (self.homeward and self.state in (State.RETURNING, State.HOLDING))

    @property
    def goes_home_by_itself(self) -> bool:
        """The autopilot has been told to, or is about to be: which needs neither our waypoints nor our journal."""
        return self.state == State.RETURNING and (self.direct or self.autopilot_returns)

    @property
    def goes_on_by(self) -> Event:
        """What ends a hold that no person has ordered: it goes on with what it did."""
        if self.homeward:
            return Event.RETURN
        found = self.settled and self.found is not None  # and not one that the search went on after
        return Event.CONFIRMED if found else Event.RESUME

    @property
    def flying(self) -> bool:
        """It searches."""
        return self.state in FLYING


_ALOFT = (State.TAKEOFF, *FLYING, State.FOUND, State.HOLDING, State.RETURNING)


def as_asked(left: Standing, event: Event, why: str) -> Standing | None:
    """How a run that was left so comes up where a hold, a return or the finish is wanted before its aircraft is heard.

    None where that changes nothing: what its pilot has and what waits between two sorties moves by a fresh order only,
    and what has not flown is over when it is finished. Before the first flight a return is a hold on the ground.
    """
    if left.state in (State.YIELDED, State.GROUNDED):
        return None
    if left.state not in _ALOFT:
        return None if event == Event.FINISH else replace(left, state=State.HOLDING, why=why)
    if event == Event.HOLD:
        return replace(left, state=State.HOLDING, why=why)
    over = event == Event.FINISH
    return replace(
        left,
        state=State.RETURNING,
        why=why,
        why_stopped=why if over else left.why_stopped or why,
        searched=left.searched or over,
        settled=left.settled or over,
    )


def may_be_aloft(left: Standing, flight: Flight) -> bool:
    """Whether an aircraft may be in the air of which is known only how an earlier process left its run."""
    flew = left.state in (*_ALOFT, State.YIELDED) and flight.aloft_s(flight.left_at) > 0.0
    return flew or left.state == State.TAKEOFF


@dataclass(frozen=True, slots=True)
class Terms:
    """On what terms a mission flies: how fast its clock runs, how old a position and a heartbeat may be (seconds),
    whether it may arm and take off, whether it may do so by itself where the run has flown already (an aircraft of the
    built-in world is another one then), and whether nobody asked for this start: what started the service anew is no
    person who has looked at the aircraft, nor is who switched it on long after the others had gone. `name` is that of
    the aircraft, where there are several."""

    speedup: float = 1.0
    position_fresh_s: float = 2.0
    heartbeat_fresh_s: float = 2.0
    may_take_off: bool = False
    may_take_off_again: bool = False
    restarted: bool = False
    name: str = ""


@dataclass(frozen=True, slots=True)
class Look:
    """What a phase sees when it is asked; it changes nothing of it. `busy`: an action is under way; `ordered`: the
    order that this is for, if it is for one."""

    standing: Standing
    seen: Situation
    now: float
    busy: bool
    chart: Chart
    helm: Helm
    flight: Flight
    energy: Energy
    settings: Settings
    terms: Terms
    ordered: str = ""

    @property
    def speed_mps(self) -> float:
        """How fast the aircraft flies: as the settings ask, or slower where it cannot, metres a second."""
        return self.seen.flies_mps(self.settings.flight.speed_mps)

    def energy_low(self) -> str:
        """Why the aircraft must fly home now, or nothing."""
        return self.energy.objection(self.flight.aloft_s(self.now), self.settings.flight)

    def battery_left(self) -> Left | None:
        """What the battery leaves for the search and the way home; None while that is not known."""
        home = self.chart.home(self.seen.telemetry)
        return self.energy.left(self.flight.aloft_s(self.now), home, self.settings.flight)

    def detector_silent(self) -> bool:
        """No report for too long; never shorter than what a busy host may need in wall time."""
        limit = max(self.settings.sensor.silent_after_s, LEAST_PATIENCE_WALL_S * self.terms.speedup)
        return self.now - max(self.seen.reported_at, self.standing.listening_since) > limit

    def heard(self) -> bool:
        """A heartbeat has come lately."""
        return self.now - self.seen.telemetry.heartbeat_time < self.terms.heartbeat_fresh_s
