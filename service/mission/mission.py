"""The mission's shell: feeds the core with what happens, carries out what it wants, and decides nothing.

What the core wants at once is done at once, in the same call in which it was told: from a pilot's mode change to the
silence that it asks for nothing is awaited. An action waits until all rows before it are on disk; a waypoint is then
shown to the core once more, and sent in the same call in which that has nothing against it.
"""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

from roisearch import SearchState
from service.clock import Clock
from service.evidence.found import Found
from service.evidence.intake import Intake
from service.evidence.observe import FramePose, Observation
from service.evidence.reports import OrderReceipt
from service.geometry import Cell, LatLon
from service.journal import Journal, JournalLost
from service.known import Withdrawn
from service.looking import passed, worth_a_look
from service.mavlink import LinkError, Vehicle
from service.mission.apart import Other
from service.mission.core import MissionCore
from service.mission.doing import do
from service.mission.effects import (
    UNWRITTEN,
    Action,
    Answer,
    Brake,
    DropAction,
    DropThought,
    Effect,
    ForgetAircraft,
    Learn,
    LetGo,
    Note,
    Passed,
    PlanAnew,
    Reckon,
    Rest,
    SendWaypoint,
    Stop,
    Tell,
    Think,
    WriteRow,
)
from service.mission.energy import Energy
from service.mission.flight import Flight
from service.mission.formation import Formation
from service.mission.limits import Objection
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
from service.mission.orders import STOPPING
from service.mission.outlook import Outlook, pose_at
from service.mission.situation import Situation, on_ground
from service.mission.standing import Standing
from service.mission.states import FINAL, State
from service.mission.tickets import Tickets
from service.mission.written import WrittenRows
from service.news.bearing import FieldNews
from service.reasons import Reason
from service.rows import OrderRow
from service.search import Search

log = logging.getLogger("roisearch")
TICK_S = 0.1
LEAVING_S = 5.0
MOVING_ORDERS, JUDGING = ("resume", "launch"), ("confirm", "reject")
_OVERTAKEN = (
    "the aircraft was stopped or taken over before it was carried out; order it again if it is wanted"
)
MakeIntake = Callable[[Callable[[float], FramePose | None], Callable[[Observation, float], None]], Intake]


@dataclass(frozen=True)
class Stopwatch:
    """Who is told the seconds of a decision, and those from a hit's report to its waypoint on the wire."""

    decision: Callable[[float], None] = lambda seconds: None
    hit_to_waypoint: Callable[[float], None] = lambda seconds: None


class Mission:
    """One search with one vehicle, under way.

    Args:
        make_intake: makes the intake from where the aircraft was at a time, and from who is told of an observation.
        formation: who flies the search beside it; by default nobody.
        stopwatch: is told what took how long.
    """

    def __init__(
        self,
        core: MissionCore,
        *,
        clock: Clock,
        search: Search,
        vehicle: Vehicle,
        journal: Journal,
        make_intake: MakeIntake,
        formation: Formation | None = None,
        stopwatch: Stopwatch | None = None,
    ) -> None:
        self.core, self.clock, self.search = core, clock, search
        self.vehicle, self.journal = vehicle, journal
        self.intake = make_intake(partial(pose_at, vehicle, core), self.observed)
        formation = formation or Formation()
        self._outlook = Outlook(core, clock, search, vehicle, journal, self.intake, formation)
        self._rows = WrittenRows(journal, clock, search.aircraft)
        self._tickets = Tickets()
        self._stopwatch = stopwatch or Stopwatch()
        self._acting: asyncio.Task[None] | None = None
        self._thinking: asyncio.Task[None] | None = None
        self._stopped = self._unwritten = False
        self._group = asyncio.TaskGroup()
        formation.join(search.aircraft, self.told)

    # ---- what can be seen of it

    @property
    def name(self) -> str:
        """The name of its aircraft; empty for the only one."""
        return self.search.aircraft

    @property
    def called(self) -> str:
        """What a line that is about it begins with; nothing for the only one."""
        return f"aircraft '{self.name}': " if self.name else ""

    @property
    def standing(self) -> Standing:
        """How it stands."""
        return self.core.standing

    @property
    def state(self) -> State:
        """Its state."""
        return self.core.standing.state

    @property
    def found(self) -> Found | None:
        """The place that counts as found."""
        return self.core.standing.found

    @property
    def flight(self) -> Flight:
        """What was flown."""
        return self.core.flight

    @property
    def reason(self) -> Reason:
        """Why it goes where it goes."""
        return self.core.reason

    @property
    def energy(self) -> Energy:
        """The battery, and what the way home needs of it."""
        return self.core.reserve.energy

    def flight_time(self) -> float:
        """Seconds in the air so far."""
        return self.flight.seconds(self.clock.now())

    def heard(self) -> bool:
        """A heartbeat has come lately."""
        age = self.clock.now() - self.vehicle.telemetry.heartbeat_time
        return age < self.core.terms.heartbeat_fresh_s

    def cell(self) -> Cell:
        """The cell under the aircraft, the nearest one when it is off the grid."""
        return self.core.chart.cell(self.vehicle.telemetry)[0]

    def heading(self) -> str:
        """Where its nose points, in the grid's directions."""
        return self.core.chart.heading(self.vehicle.telemetry)

    def told(self) -> Other:
        """This aircraft as the others are to see it."""
        return self.core.told(Situation(self.vehicle.telemetry), self.clock.now())

    def ahead(self) -> list[LatLon]:
        """Where the aircraft goes from here as decided; empty when it does not."""
        return self.core.ahead(self._outlook.situation())

    def orders(self) -> list[str]:
        """The orders that would change something now."""
        return self.core.orders(self._outlook.situation())

    def concerned(self, command: str) -> bool:
        """Whether an order means something to it as it is now, be it that it is carried out already."""
        return self.core.concerned(command, self._outlook.situation())

    # ---- what happens

    async def run(self) -> None:
        """Fly the whole mission; returns when the state is final."""
        async with self._group as group:
            listening = group.create_task(self._listen())
            try:
                while self.state not in FINAL:
                    if self._rows.lost is not None:
                        self._go_home_unwritten(self._rows.lost)
                    self._carry_out(self.core.tick(self._outlook.situation(), self.clock.now()))
                    await self.clock.sleep(TICK_S)
            finally:
                self._drop_thought()
                self._drop_action()
                listening.cancel()
        await self._linger()

    async def order(
        self, command: str, place: LatLon | None = None, system_id: int | None = None
    ) -> OrderReceipt:
        """An operator's order: hold, resume, return, launch, replace (by the aircraft with `system_id`, or any), finish
        or abort; confirm or reject a place, the present one unless given. Returns the state that came of it, and why it
        was refused if it was."""
        if why := self._no_place(command, place):
            return OrderReceipt(state=self.state, refused=why)
        row, before = OrderRow(command, self.state, place), self.core.overtaken
        if command not in STOPPING:
            await self._rows.on_disk(row)
            if command in MOVING_ORDERS and self.core.overtaken != before:  # the later word counts
                return OrderReceipt(state=self.state, refused=_OVERTAKEN)
        if command in JUDGING:
            confirmed = command == "confirm"
            present = (self.found.lat, self.found.lon) if self.found else None
            await self.intake.judge(self.search.cell_at(place or present), confirmed=confirmed)
            return await self.judged(confirmed=confirmed, moves=self.core.overtaken == before)
        ticket, done = self._tickets.draw()
        self._feed(Order(command, ticket, system_id))
        if command in STOPPING:
            self._rows.write(row)
        refused = await done
        return OrderReceipt(state=self.state, refused=refused or None)

    def _no_place(self, command: str, place: LatLon | None) -> str:
        """Why there is no place that a person's word could be about, or nothing."""
        if place is not None:
            return self.search.why_not_here(place)
        there = self.found is not None or self.search.was_hit(self.search.place)
        return "" if there or command not in JUDGING else f"nothing was seen yet: name the place to {command}"

    async def judged(self, *, confirmed: bool, moves: bool = True) -> OrderReceipt:
        """An operator has confirmed or rejected a place, and the belief knows it; what comes of it. `moves`: nobody has
        stopped the aircraft or taken it since."""
        ticket, done = self._tickets.draw()
        self._feed(Judged(confirmed, self.search.found(), ticket, moves))
        refused = await done
        return OrderReceipt(state=self.state, refused=refused or None)

    async def hear(self, said: FieldNews | Withdrawn) -> None:
        """News from the field, or news taken back; the next decision knows. Raises JournalLost."""
        await self.intake.hear(said)
        self.map_changed()

    def map_changed(self) -> None:
        """What is known of the ground has changed, by another way than a look."""
        self._feed(MapChanged(self.search.grid))

    def observed(self, observation: Observation, arrived: float) -> None:
        """An observation was applied (called by the intake)."""
        if observation.speaking:
            places = self.search.grid.frame.to_latlon(observation.speaking)
            self._feed(Hit(tuple((float(lat), float(lon)) for lat, lon in places), arrived))

    async def leave(self, reason: str, *, stop: bool = True, home: bool = False) -> None:
        """End the run where it is, for a fault that it cannot go on with or on a signal; `home`: an aircraft of ours is
        not left hovering, its autopilot brings it home."""
        seen = self._outlook.situation()
        self._carry_out(self.core.leave(reason, seen, self.clock.now(), stop=stop, home=home))
        if home and seen.telemetry.in_control and not on_ground(seen.telemetry):
            try:
                await self.vehicle.return_to_launch()
                self._stopped = False
            except LinkError as error:
                log.error("%s", error)
                self.vehicle.status_text(f"search ABORTED, hovering: {error}", 2)
        await self._linger()

    def _go_home_unwritten(self, lost: JournalLost) -> None:
        """Among others it flies home without a journal, past them and by the turn that they take to land: by their
        autopilots all would fly at one height, at once. Raises JournalLost where that is not, or no longer, so."""
        if not self._unwritten and self._outlook.formation.several:
            self._unwritten = True
            self._feed(Unwritten(str(lost)))
        if not (self._unwritten and self.standing.comes_home):
            raise lost

    async def _linger(self) -> None:
        """A last stop that is lost is sent again."""
        if self._stopped and self.state == State.ABORTED:
            self._stopped = False
            await self.clock.sleep(LEAVING_S)

    async def _listen(self) -> None:
        async for event in self.vehicle.events():
            self._feed(event)

    def _feed(self, news: News) -> None:
        """Tell the core what has happened, and do what follows, before anything else is looked at."""
        self._carry_out(self.core.on(news, self._outlook.situation(), self.clock.now()))

    # ---- what is to be done at once

    def _carry_out(self, effects: Sequence[Effect]) -> None:
        news: list[News] = []
        for effect in effects:
            match effect:
                case Stop() | Brake():
                    news += self._stop(effect)
                case Rest():
                    self.vehicle.stand_by("the mission wants something else now")
                case LetGo(reason=reason):
                    self.vehicle.release_control(reason)
                case Tell(text=text, severity=severity):
                    self.vehicle.status_text(text, severity)
                case Note(text=text, level=level):
                    log.log(level, "%s%s", self.called, text)
                case WriteRow(row=row):
                    self._rows.write(row)
                case Think():
                    self._drop_thought()
                    self._thinking = self._group.create_task(self._think(effect))
                case Passed(cell=cell, heading=heading):
                    if note := passed(self.search, cell, heading, self.clock.now()):
                        log.warning("%s%s", self.called, note)
                        news.append(MapChanged(self.search.grid))
                case Learn(flights=flights):
                    self.search.learn(flights)
                case Reckon(limits=limits):
                    self.search.limit(limits)
                case PlanAnew():
                    self.search.replan()
                case DropThought():
                    self._drop_thought()
                case DropAction():
                    self._drop_action()
                case ForgetAircraft(system_id=system_id):
                    self.vehicle.forget(system_id)
                    self.search.forget_motion()
                case Answer(ticket=ticket, refused=refused):
                    self._tickets.answer(ticket, refused)
                case _:
                    self._drop_action()
                    self._acting = self._group.create_task(self._act(effect))
        if not self.standing.flying:
            self.search.give_back()
        for each in news:
            self._feed(each)

    def _stop(self, effect: Stop | Brake) -> list[NotStopped]:
        try:
            if isinstance(effect, Stop):
                self.vehicle.hold(effect.least_amsl_m)
            else:
                self.vehicle.brake()
        except LinkError as error:
            return [NotStopped(str(error))]
        self._stopped = True
        return []

    def _drop_thought(self) -> None:
        if self._thinking is not None:
            self._thinking.cancel()
            self._thinking = None

    def _drop_action(self) -> None:
        if self._acting is not None and self._acting is not asyncio.current_task():
            self._acting.cancel()
        self._acting = None

    # ---- what takes time

    async def _think(self, wanted: Think) -> None:
        unseen = [cell for cell in wanted.ahead if cell not in self.intake.passes]
        try:
            state = SearchState(wanted.cell, wanted.heading, wanted.speed_mps)
            decision = await self.search.decide(state, unseen, wanted.left, self.clock.now())
        except Exception as error:  # whatever a planner from outside does: the aircraft is not left alone
            log.exception("the planner has failed")
            self._thinking = None
            self._feed(NotThought(f"{type(error).__name__}: {error}"))
            return
        self._thinking = None
        self._stopwatch.decision(decision.effort.seconds)
        reason, worth = self.search.reason(decision, wanted.cell), worth_a_look(self.search, decision.path)
        self._feed(Thought(decision, reason, worth))

    async def _act(self, action: Action) -> None:
        """Carry out an action once all rows before it are on disk, and tell the core how it ended. A return or a
        landing by the autopilot waits for no disk, nor does the way home of one that flies it without a journal."""
        waits = not (self._unwritten or isinstance(action, UNWRITTEN))
        if waits and not await self._rows.all_on_disk():
            return  # told by its own way
        patience = self.core.settings.link.connect_timeout_s
        news: News
        try:
            news = (
                self._send(action)
                if isinstance(action, SendWaypoint)
                else await do(action, self.vehicle, patience)
            )
        except LinkError as error:
            news = Failed(action, str(error), error.answered)
        self._acting = None
        self._feed(news)

    def _send(self, waypoint: SendWaypoint) -> Done | NotSent:
        """The one place where a waypoint leaves for the aircraft."""
        objection = self.core.objection(waypoint, self._outlook.situation(), self.clock.now())
        if objection is not None:  # something happened while its row was written
            return NotSent(waypoint, objection)
        try:
            self.vehicle.reposition(*waypoint.point, waypoint.altitude_m)
        except LinkError as error:
            return NotSent(waypoint, Objection("link", str(error)))
        self.core.sent(waypoint)
        if waypoint.hit_at is None:
            return Done(waypoint)
        latency = time.perf_counter() - waypoint.hit_at
        self.flight.latencies_s.append(latency)
        self._stopwatch.hit_to_waypoint(latency)
        return Done(waypoint, latency)
