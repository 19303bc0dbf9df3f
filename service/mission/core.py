"""The mission without its wires: what happens and the time go in, what is to be done comes out.

Nothing here opens a socket, sleeps, looks at a clock or writes a file. The owner calls `on` with what has happened and
`tick` ten times a second, each time with the situation as it is now, and carries out the effects that it gets. All that
the table of `states` is about stands in one frozen `Standing`, which only the core replaces; the state changes only in
`_happen`, which looks the table up.

What is to move the aircraft passes the core twice: when it is wanted, and, after its row is on disk, in `objection`,
right before it is sent. So nothing is ever sent from a queue. What stops the aircraft, or gives it away, waits for
nothing.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Iterable
from dataclasses import replace

from service.area import Grid
from service.config import Settings
from service.geometry import Cell, LatLon
from service.mission.apart import Other
from service.mission.chart import Chart, here
from service.mission.departing import Waiting
from service.mission.effects import (
    ACTIONS,
    UNWRITTEN,
    Action,
    Answer,
    Brake,
    DropAction,
    DropThought,
    Effect,
    EnterGuided,
    ForgetAircraft,
    LetGo,
    Note,
    PlanAnew,
    Rest,
    ReturnToLaunch,
    SendWaypoint,
    Stop,
    Tell,
    WriteRow,
    row,
)
from service.mission.entering import entered, phase_of
from service.mission.excluded import other_ground
from service.mission.finding import found_after_all, not_enough_after_all, over_for_all
from service.mission.flight import Flight
from service.mission.grounded import Grounded
from service.mission.guard import CRITICAL, guard
from service.mission.helm import Helm
from service.mission.holding import BLIND
from service.mission.limits import Objection, no_stop
from service.mission.logbook import Logbook
from service.mission.news import (
    Done,
    Failed,
    Hit,
    Judged,
    MapChanged,
    News,
    NotSent,
    NotStopped,
    NotThought,
    Order,
    Thought,
    Unwritten,
)
from service.mission.orders import concerned, gives_back, judged, ordered, sensible
from service.mission.phase import (
    Begin,
    ComeUp,
    Enter,
    Find,
    GiveUp,
    GoOn,
    Happen,
    Hold,
    Late,
    Listen,
    Lost,
    Overtaken,
    Pending,
    Phase,
    Release,
    Replace,
    Settle,
    Stand,
    Stay,
    Unsettle,
    Wish,
    warn,
)
from service.mission.reserve import Reserve
from service.mission.situation import Situation, on_ground
from service.mission.standing import (
    LEAST_PATIENCE_WALL_S,
    Look,
    Standing,
    Terms,
    as_asked,
    may_be_aloft,
    one_more,
)
from service.mission.states import (
    FINAL,
    FLYING,
    MAY_MOVE,
    SEARCHED_TO,
    Event,
    State,
    next_state,
)
from service.mission.traffic import Course, aloft
from service.mission.untold import Untold
from service.mission.watch import VehicleWatch
from service.reasons import Reason
from service.rows import DecisionRow, ReplacedRow, TransitionRow

_BEFORE_FLIGHT = (State.READY, State.TAKEOFF)
_WARNING = logging.WARNING
GIVEN_UP_AFTER = 10  # waypoints that the ground forbids


class MissionCore:
    """One search with one aircraft.

    Args:
        settings: those of the run.
        grid: the ground.
        terms: on what terms it flies.
        standing: as the run that this one goes on with was left, which may be over for this aircraft; as new by
            default.
        flight: what was flown in that run.
    """

    def __init__(
        self,
        settings: Settings,
        grid: Grid,
        terms: Terms,
        *,
        standing: Standing | None = None,
        flight: Flight | None = None,
    ) -> None:
        self.settings, self.terms = settings, terms
        self.chart = Chart(grid)
        self._patience_s = max(settings.flight.stuck_after_s, LEAST_PATIENCE_WALL_S * terms.speedup)
        self._begin_with_an_aircraft()
        self.flight = flight or Flight()
        self.standing = standing or Standing()
        self.reason = Reason("waiting for the aircraft")
        self.path: tuple[Cell, ...] = ()
        self.doing: Action | None = None
        """The action under way."""
        self.overtaken = 0
        """How often a person has stopped the aircraft, or taken it: an order of before counts no more then."""
        # as an earlier process left it; with what was asked of it since, and without
        self._left = self._flown_as = self.standing
        self._logbook = Logbook(self.flight, self._left)
        self._phase: Phase = Phase()
        if self._left.state not in FINAL:
            self.standing = replace(
                self.standing, state=State.WAITING, causes=frozenset(), homeward=self._left.goes_home
            )
            self._phase = Waiting(between=self._left.state == State.GROUNDED)
        self._pending: Pending | None = None
        self._effects: list[Effect] = []
        self._seen, self._now = Situation(), 0.0

    # ---- what the owner calls

    def on(self, news: News, seen: Situation, now: float) -> list[Effect]:
        """Take in what has happened; returns what is to be done about it."""
        self._see(seen, now)
        if isinstance(news, (Done, Failed, NotSent)) and news.action is not self.doing:
            return []  # it was dropped, and ended all the same
        phase, ordered_it = self._phase, self._pending is not None
        match news:
            case Order():
                self._want(ordered(news, self._look()))
            case Judged():
                self._want(judged(news, self._look()))
            case Thought():
                self._decided(news)
            case Hit(places=places):
                self.flight.hits.extend(places)
            case MapChanged(grid=grid) if grid is not self.chart.grid:
                self._fly_around(grid)
            case MapChanged() | NotThought():
                pass
            case NotSent(action=waypoint, objection=objection):
                self.doing = None
                self._refused(waypoint, objection)
            case NotStopped(reason=reason):
                self._emit(Note(f"no stop was sent: {reason}", _WARNING))
                self._phase.lost(self._look())
            case Unwritten(reason=reason):
                self._go_home_unwritten(reason)
            case Done() | Failed():
                self._ended(news)
            case _:
                self._want(self._watch.read(news, self._look()))
        if isinstance(news, MapChanged):
            self._want(not_enough_after_all(self._look()))
        self._want(self._watch.landed(self._look()))
        its_own = isinstance(news, (Thought, NotThought, Hit, MapChanged)) or (
            isinstance(news, (Done, Failed)) and not ordered_it
        )
        if its_own and self._phase is phase:
            self._ask(phase.on(news, self._look()))
        return self._handed_out()

    def tick(self, seen: Situation, now: float) -> list[Effect]:
        """Do what is due by time."""
        self._see(seen, now)
        if self.standing.state not in FINAL:
            if not on_ground(seen.telemetry):
                self.flight.record(seen.telemetry, now)
            waits_s = self.helm.traffic.wait_s(seen.telemetry, seen.others)
            under_way = self.helm.under_way(seen.telemetry)
            speed = seen.flies_mps(self.settings.flight.speed_mps)
            self.reserve.update(seen.telemetry, now, under_way=under_way, waits_s=waits_s, speed_mps=speed)
            self._want(self._logbook.track(now, at_once=False))
            self._want(self._watch.tick(self._look()))
            self._want(guard(self._look, self._untold, self.reserve.wind))
            self._want(over_for_all(self._look()))
            self._want(found_after_all(self._look()))
        if self.standing.state not in FINAL:
            self._ask(self._phase.tick(self._look()))
        return self._handed_out()

    def objection(self, waypoint: SendWaypoint, seen: Situation, now: float) -> Objection | None:
        """Why a waypoint must not be sent now, or nothing; asked right before it is."""
        if self.standing.state not in MAY_MOVE or self.doing is not waypoint:
            return Objection("state", "the mission is not to move the aircraft")
        return self._speaks_against(waypoint, seen, now)

    def sent(self, waypoint: SendWaypoint) -> None:
        """A waypoint is on the wire."""
        self.helm.sent(waypoint.point, on_way=waypoint.on_way)
        self.helm.traffic.sent(waypoint, self._now)
        self._too_low, self._kept_from = 0, ""
        self.flight.waypoints += 1

    def leave(
        self, reason: str, seen: Situation, now: float, *, stop: bool = True, home: bool = False
    ) -> list[Effect]:
        """End the run where it is, for a fault that it cannot go on with or on a signal.

        Stops the aircraft, if it is ours and `stop`, and tells the pilot, who has it now; `home`: the autopilot is told
        to bring it home right after.
        """
        self._see(seen, now)
        if self.standing.state not in FINAL:
            self._give_up(reason, stop=stop, then="flying home" if home else "hovering")
        return self._handed_out()

    # ---- what can be seen of it

    @property
    def state(self) -> State:
        """The state in the table."""
        return self.standing.state

    @property
    def battery_doubt(self) -> str:
        """What a person must know of the battery's level while nobody tells it, or nothing."""
        return self._untold.battery

    @property
    def may_be_aloft(self) -> bool:
        """Whether an earlier process has left the aircraft in the air, for all that is known without hearing it."""
        return may_be_aloft(self._flown_as, self.flight)

    def told(self, seen: Situation, now: float) -> Other:
        """This aircraft as the other aircraft of the search are to see it: in the air from when it is about to be, and
        as an earlier process left it there until it says where it is, or that its motors stand still."""
        t = seen.telemetry
        placed, stands = math.isfinite(t.position_time), math.isfinite(t.heartbeat_time) and not aloft(t)
        if not placed and not stands and self.may_be_aloft:
            climbs = self._flown_as.state == State.TAKEOFF
            return self.helm.traffic.unheard(t, now, self.flight, climbs=climbs)
        standing, heard = self.standing, now - t.heartbeat_time < self.terms.heartbeat_fresh_s
        course = Course(
            standing.state == State.TAKEOFF,
            standing.goes_home_by_itself,
            heard,
            standing.state in FINAL,
        )
        return self.helm.traffic.told(t, now, course)

    def ahead(self, seen: Situation) -> list[LatLon]:
        """Where the aircraft goes from here as decided: its waypoint and the path beyond; empty when it does not."""
        if self._phase.waypoint is None:
            return []
        return [here(seen.telemetry), *self.chart.latlons([self._phase.waypoint, *self.path])]

    @property
    def between_sorties(self) -> bool:
        """Whether it waits on the ground for the next sortie, or did so when an earlier process left it: its aircraft
        may be switched off."""
        waits = self.standing.state == State.WAITING and self._left.state == State.GROUNDED
        return waits or self.standing.state == State.GROUNDED

    def orders(self, seen: Situation) -> list[str]:
        """The orders that would change something now."""
        return sensible(replace(self._look(), seen=seen))

    def concerned(self, command: str, seen: Situation) -> bool:
        """Whether an order means something now."""
        return concerned(command, replace(self._look(), seen=seen))

    # ---- wishes

    def _begin_with_an_aircraft(self) -> None:
        """All that follows from what an aircraft has told, of which nothing is known yet."""
        self.helm = Helm(
            self.chart,
            self.settings,
            fresh_s=self.terms.position_fresh_s,
            patience_s=self._patience_s,
            name=self.terms.name,
        )
        self.reserve = self._fresh_reserve()
        self._untold, self._watch = Untold(), VehicleWatch()
        self._too_low = 0  # waypoints in a row that were not sent for the ground
        self._kept_from = ""  # why the last one that the other aircraft leave no room for was not sent

    def _replace(self, wish: Replace) -> None:
        """Another aircraft flies the next sortie: nothing that is known of this one is known of that."""
        t = self._seen.telemetry
        said = "the next aircraft that is heard" if wish.system_id is None else f"system {wish.system_id}"
        self._drop_action()
        self._emit(WriteRow(ReplacedRow(wish.system_id, t.system_id, t.autopilot)))
        self._emit(Tell(f"search {self.standing.state}: this aircraft is let go for another one", 5))
        self._emit(Note(f"waiting for {said}, in the place of system {t.system_id} ({t.autopilot})"))
        self._emit(ForgetAircraft(wish.system_id))
        self._flown_as = Standing()
        self._begin_with_an_aircraft()
        self._phase = Grounded(None, coming=True)

    def _fresh_reserve(self) -> Reserve:
        """The energy of a flight that has not begun."""
        return Reserve(self.chart, self.settings.flight, self.helm.heights.highest_return_m)

    def _see(self, seen: Situation, now: float) -> None:
        self._seen, self._now = seen, now
        self.helm.reckon(seen.telemetry)
        self._watch.see(seen.telemetry)

    def _look(self) -> Look:
        return Look(
            self.standing,
            self._seen,
            self._now,
            self.doing is not None,
            self.chart,
            self.helm,
            self.flight,
            self.reserve.energy,
            self.settings,
            self.terms,
            self._pending.command if self._pending else "",
        )

    def _ask(self, wishes: Iterable[Wish]) -> None:
        """Grant what a phase wishes, as long as it is the phase."""
        phase = self._phase
        for wish in wishes:
            self._grant(wish)
            if self._phase is not phase:
                return

    def _want(self, wishes: Iterable[Wish]) -> None:
        for wish in wishes:
            self._grant(wish)

    def _grant(self, wish: Wish) -> None:
        now = self._now
        match wish:
            case Happen():
                self._happen(wish)
            case Hold(cause=cause) if self.standing.state in _BEFORE_FLIGHT and cause != "operator":
                pass  # nothing of ours moves yet, and what is at fault is waited for anyway
            case Hold(cause=cause, reason=reason):
                holds = self.standing.state == State.HOLDING
                again = holds and cause == "operator"  # it may not stand yet
                if self._happen(Happen(Event.HOLD, reason)) or (again and self._seen.telemetry.in_control):
                    self._stop()
                if holds and cause not in self.standing.causes:
                    self._emit(Note(f"it hovers for another reason too: {reason}", _WARNING))
                    self._change(why=one_more(self.standing.why, reason))
                if self.standing.state == State.HOLDING:
                    self._change(causes=self.standing.causes | {cause})
            case Release():
                self._release(wish)
            case Find(found=found):
                self._change(found=found)
            case Enter(cell=cell):
                self.flight.enter(cell)
            case Listen():
                self._change(listening_since=now)
            case Replace():
                self._replace(wish)
            case Begin():
                self._logbook.begins(self._seen.telemetry, now)
            case Stand():
                self._want(self._logbook.stands(self._seen, now))
            case Late():
                self.terms = replace(self.terms, restarted=True)
            case GoOn():
                self._want(self._logbook.goes_on(self._seen, now))
            case Settle(why=""):
                self._change(settled=True, enough=False)
            case Settle(why=why):
                enough = why.startswith(SEARCHED_TO)
                self._change(settled=True, searched=True, why_stopped=why, enough=enough)
                state = self.standing.state  # which stays; that no sortie follows has to outlive the process
                self._emit(WriteRow(TransitionRow(state, Event.FINISH, state, why)))
            case Unsettle(why=why):
                self._change(settled=False, enough=False, why_stopped=why)
                state = self.standing.state
                self._emit(WriteRow(TransitionRow(state, Event.RESUME, state, why)))
            case Lost():
                self._phase.lost(self._look())
            case Stay(why=why):
                self._change(why=one_more(self.standing.why, why))
            case GiveUp(reason=reason):
                self._emit(Note(reason, logging.ERROR))
                self._give_up(reason, stop=True, then="hovering")
            case ComeUp():
                self._come_up(wish)
            case Overtaken():
                self._overtake(wish)
            case Pending():
                self._drop_action()
                self._pending = wish
                self._emit(wish.action)
            case Stop():
                self._stop()
            case SendWaypoint():
                objection = self._speaks_against(wish, self._seen, now)
                if objection is None:
                    self._emit(wish)
                else:
                    self._refused(wish, objection)
            case _:
                self._emit(wish)

    def _emit(self, effect: Effect) -> None:
        written, stops = row(effect), isinstance(effect, Stop | Brake)
        if written is not None and not stops:
            self._effects.append(written)
        if isinstance(effect, ACTIONS):
            self.doing = effect
            if isinstance(effect, ReturnToLaunch):
                self._change(autopilot_returns=True)
        elif isinstance(effect, Rest):
            self.helm.rest()
            self.helm.traffic.rest(self._now)
        self._effects.append(effect)
        if written is not None and stops:  # what stops the aircraft waits for nothing
            self._effects.append(written)

    def _speaks_against(self, waypoint: SendWaypoint, seen: Situation, now: float) -> Objection | None:
        """Why a waypoint must not be sent: for its own sake, or for that of the other aircraft."""
        t, urgent = seen.telemetry, self.standing.state == State.RETURNING
        objection = self.helm.objection(waypoint, t, now)
        if objection is not None:
            return objection
        why = self.helm.traffic.leg(waypoint, t, seen.others, now, urgent=urgent)
        return Objection("apart", f"the leg to it {why}") if why else None

    def _refused(self, waypoint: SendWaypoint, objection: Objection) -> None:
        """A waypoint must not be sent: hover for what it would be fatal to fly on with, else try again."""
        phase = self._phase
        self._too_low += objection.cause == "ground"
        if objection.cause == "limits" and phase.elsewhere(self._look()):
            self._emit(Note(f"waypoint not sent: {objection.reason}; another way is planned", _WARNING))
            return
        if objection.cause in ("position", "limits") or self._too_low > GIVEN_UP_AFTER:
            self._too_low = 0
            self._want([Hold(objection.cause if objection.cause != "ground" else "limits", objection.reason)])
        elif objection.cause == "ground":  # it has come nearer since the leg was planned: plan it anew
            self._emit(Note(f"waypoint not sent: {objection.reason}", _WARNING))
            self._stop()
        elif objection.cause != "apart" or objection.reason != self._kept_from:
            self._emit(Note(f"waypoint not sent: {objection.reason}", _WARNING))
        self._kept_from = objection.reason if objection.cause == "apart" else ""
        if self._phase is phase:
            phase.refused(objection, self._look())

    def _change(self, **fields: object) -> None:
        self.standing = replace(self.standing, **fields)  # type: ignore[arg-type]

    def _handed_out(self) -> list[Effect]:
        effects, self._effects = self._effects, []
        return effects

    # ---- the table

    def _happen(self, wish: Happen) -> bool:
        """Let an event happen; True when it changed the state."""
        before, after = self.standing.state, next_state(self.standing.state, wish.event)
        if before == after:
            return False
        self._enter(before, after, wish)
        self._emit(WriteRow(TransitionRow(before, wish.event, after, wish.reason)))
        self._emit(Note(f"{before} → {after}: {wish.reason}"))
        how = f"; {gives_back(self._look())}" if after == State.YIELDED else ""
        self._emit(Tell(f"search {after}: {wish.told or wish.reason}{how}"))
        return True

    def _enter(self, before: State, after: State, wish: Happen) -> None:
        """Take over what a change of state brings with it: what was under way is out of date."""
        self.standing = entered(self.standing, after, wish, self._now)
        if before in FLYING and after in FLYING:
            return
        self._want(self._logbook.track(self._now, at_once=True))
        self.helm.traffic.forget(self._now)
        self._emit(DropThought())
        self._drop_action()
        self._emit(Rest())
        if after == State.YIELDED:
            self._emit(LetGo(wish.reason))
        if after in (State.DONE, State.GROUNDED):
            self._want(self._logbook.lands(self._seen, self._now, self.standing.why_stopped or wish.reason))
        if before == State.GROUNDED:  # the next sortie has a battery of its own
            self.reserve = self._fresh_reserve()
            if after not in FINAL:
                self._emit(PlanAnew())
        self._phase = phase_of(after, before, self._left, self._look())

    def _release(self, wish: Release) -> None:
        """A cause no longer holds; the search goes on, or the way home, when nothing else does."""
        causes = self.standing.causes - {wish.cause} | ({wish.instead} if wish.instead else set())
        self._change(causes=causes)
        if causes:
            return
        if wish.home:
            self._happen(Happen(Event.RETURN, wish.reason, stopped="the autopilot was silent"))
        else:
            self._happen(Happen(self.standing.goes_on_by, wish.reason))

    def _come_up(self, wish: ComeUp) -> None:
        """What a person wants of an aircraft that is not heard yet is as good as done, whatever a flag says later."""
        if not wish.ticket and self._left.state == State.HOLDING:
            return  # what an operator holds stays so, whatever others find
        asked = as_asked(self._left, wish.event, wish.why)
        if asked is not None:
            self._left = asked
            homeward = self.standing.homeward or asked.goes_home
            said = f"it will be {asked.state} once it is heard: {wish.why}"
            self._change(why=said, homeward=homeward, settled=asked.settled)
            self._change(why_stopped=asked.why_stopped, searched=asked.searched)
            state = self.standing.state
            self._emit(WriteRow(TransitionRow(state, wish.event, state, wish.why)))
            self._emit(Note(said))
        elif wish.event == Event.FINISH:
            self._happen(Happen(wish.event, wish.why, stopped=wish.why, searched=True))
        in_vain = asked is None and wish.event != Event.FINISH
        refused = f"it was left {self._left.state} and is not heard yet; order it once it is"
        self._emit(Answer(wish.ticket, refused if in_vain else ""))

    def _give_up(self, reason: str, *, stop: bool, then: str) -> None:
        before = self.standing.state
        self.helm.traffic.forget(self._now)
        self._drop_action()
        self._change(state=State.ABORTED, why=reason, why_stopped=reason)
        self._phase = Phase()
        self._emit(DropThought())
        t = self._seen.telemetry
        ours = t.in_control and t.guided and not on_ground(t) and self._look().heard()
        hovers = ours and stop and self._stop()
        self._emit(Tell(f"search ABORTED{f', {then}' if hovers else ''}: {reason}", CRITICAL))
        self._emit(WriteRow(TransitionRow(before, Event.ABORT, State.ABORTED, reason)))

    # ---- stopping

    def _stop(self) -> bool:
        """Stop here. A stop is a waypoint too: while none can be sent, the autopilot brakes by itself."""
        self._drop_action()
        self._emit(Rest())
        if not self._seen.telemetry.in_control:
            return False
        t = self._seen.telemetry
        blind = self.helm.doubts(t, self._now) or no_stop(t)
        self._emit(Brake() if blind else Stop(self.helm.heights.least_stop_amsl_m(self._seen.telemetry)))
        return True

    def _drop_action(self) -> None:
        """What is under way is not wanted any more; nor is the order that it was for."""
        if self.doing is not None:
            self.doing = None
            self._effects.append(DropAction())
        if self._pending is not None:
            self._emit(Answer(self._pending.ticket, "another order or event came before it was carried out"))
            self._pending = None

    def _overtake(self, wish: Overtaken) -> None:
        """Nothing that was ordered before a person stopped the aircraft, or took it, is carried out after it."""
        self.overtaken += 1
        ordered = self._pending.command if self._pending else ""
        if not ordered and not isinstance(self.doing, EnterGuided):  # which its pilot gave it over for
            return
        self._drop_action()
        self._emit(Rest())  # the link repeats nothing of it either
        if ordered:
            self._phase.lost(self._look())
            self._want(warn(f"{ordered} is not carried out: {wish.why}", self._look()))

    def _go_home_unwritten(self, reason: str) -> None:
        """Fly home although no row can be written any more, by our own way; from a hold in which that cannot be flown
        once it can."""
        standing, t = self.standing, self._seen.telemetry
        if not t.in_control or on_ground(t):
            return
        if not isinstance(self.doing, UNWRITTEN):  # it waits for a row that will not be there
            self._drop_action()
        self._want([Settle("")])
        if standing.state == State.RETURNING or standing.causes & BLIND:
            self._phase.lost(self._look())
            self._change(homeward=True, causes=standing.causes & BLIND)
            self._change(why_stopped=standing.why_stopped or reason)
            self._want(warn(reason, self._look()))
        else:
            event = Event.HOMEWARD if standing.state == State.READY else Event.RETURN
            self._happen(Happen(event, reason, stopped=reason))

    # ---- news

    def _ended(self, news: Done | Failed) -> None:
        """An action has ended, and with it the order that it was for."""
        self.doing, pending, self._pending = None, self._pending, None
        if isinstance(news, Failed):
            self._emit(Note(f"{type(news.action).__name__}: {news.reason}", _WARNING))
            if pending is not None:
                said = f"search {self.standing.state}: {pending.command} failed: {news.reason}"
                self._emit(Tell(said))
        elif pending is not None:
            self._want(pending.then)
        if pending is not None:
            failed = f"{pending.command} failed: {news.reason}" if isinstance(news, Failed) else ""
            self._emit(Answer(pending.ticket, failed))

    def _fly_around(self, grid: Grid) -> None:
        """Other ground is excluded now, or other ground can be seen."""
        known = self.chart.grid.layout_notes
        self.chart.take(grid)
        crosses = self.helm.crosses(self._seen.telemetry)
        self.helm.regrid()
        self.reserve.forget_way()
        self._want(other_ground(self._look(), known, crosses=crosses))

    def _decided(self, thought: Thought) -> None:
        decision, self.reason = thought.decision, thought.reason
        self.flight.decisions += 1
        self.path = decision.path
        reason = self.reason
        self._emit(WriteRow(DecisionRow(decision.action, decision.path, reason.text, reason.options)))
