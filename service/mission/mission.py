"""The mission: one search, from the first heartbeat to the ground.

`Mission.run` goes through the phases; a `Watch` beside it listens to the vehicle. Both change the state only through
`happen`, which looks the table of `states` up, journals the transition and tells the pilot. A guard looks ten times a
second at what `limits` objects to. Every waypoint passes the helm, which asks for a state that may move, a position to
trust and a leg that is clear, and writes it to the journal before it goes out.
"""

from __future__ import annotations

import asyncio
import contextlib
import functools
import logging
import math
import sqlite3
import time
from collections.abc import Awaitable, Callable, Mapping

from roisearch import Decision
from service.clock import Clock
from service.config import Settings
from service.evidence.intake import Intake, JournalLost
from service.evidence.observe import Observation
from service.evidence.suspects import Found
from service.journal import Journal
from service.mavlink import LinkError, Vehicle
from service.mission.departure import Departure
from service.mission.finding import Finding
from service.mission.flight import Flight, LatLon
from service.mission.helm import RETRY_S, TICK_S, Helm
from service.mission.holds import Holds
from service.mission.homeward import Homeward
from service.mission.navigator import Cell, Navigator
from service.mission.states import FINAL, FLYING, MAY_MOVE, MOVING, Event, State, next_state
from service.mission.watch import Watch
from service.search import Search
from service.view.reasons import Reason

log = logging.getLogger("roisearch")
LEAVING_S = 5.0
HOME_AGAIN_S = 5.0  # after which a return to launch that is not flown is ordered again
_CRITICAL = 2  # MAV_SEVERITY
SUSPECT_AT, CLEARED_BELOW = 0.5, 0.35


class Mission:
    """One search with one vehicle."""

    def __init__(
        self,
        *,
        settings: Settings,
        clock: Clock,
        search: Search,
        vehicle: Vehicle,
        journal: Journal,
        intake: Intake,
        may_take_off: bool,
        sent: Callable[[float], None] = lambda seconds: None,
        thought: Callable[[float], None] = lambda seconds: None,
    ) -> None:
        """`sent` is told the seconds from a hit's report to its waypoint on the wire, `thought` those of a decision."""
        self.settings, self.clock, self.search = settings, clock, search
        self.vehicle, self.journal, self.intake = vehicle, journal, intake
        self.may_take_off = may_take_off
        self._sent, self._thought = sent, thought
        self.frame = search.grid.frame
        self.state = State.WAITING
        self.flight = Flight()
        self.found: Found | None = None
        self.reason = Reason("waiting for the aircraft")
        self.path: tuple[Cell, ...] = ()
        self.why_here = ""  # the reason of the last transition
        self.why_stopped = ""
        self.searched = False  # the search ended because there was nothing more to gain, not by an order
        self.resend = False  # the last waypoint or stop may have been lost: `Watch` says so
        self.autopilot_returns = False  # the return to launch was ordered: it flies by itself now, or soon
        self._hovering = False  # over a suspect, for another look
        fly = settings.flight
        self._navigator = Navigator(self.frame.cell_m, fly.speed_mps, fly.deceleration_mps2, fly.corner_m)
        self._thinking: asyncio.Task[Decision] | None = None
        self._hit_at: float | None = None
        self._last_cell: Cell | None = None
        self._changed = asyncio.Event()
        self._wake = asyncio.Event()
        self._group = asyncio.TaskGroup()
        self.departure = Departure(self, write=self._write)
        self.holds = Holds(self, tick=self._tick, energy_low=self._energy_low)
        self.finding = Finding(self, write=self._write, tick=self._tick, energy_low=self._energy_low)
        self.helm = Helm(settings, clock, search.grid, vehicle, may_move=self._may_move, write=self._write)
        self.homeward = Homeward(self.helm, clock, fly)
        self.watch = Watch(self, write=self._write)

    # ---- state -------------------------------------------------------------------------------------------

    async def happen(self, event: Event, reason: str) -> bool:
        """Let an event happen; True when it changed the state. The change is on disk when this returns."""
        before, after = self.state, next_state(self.state, event)
        if before == after:
            return False
        self.state, self.why_here = after, reason
        self.holds.entered(after, self.clock.now())
        self.autopilot_returns = False
        if after in FLYING and before not in FLYING:
            self.why_stopped, self.searched = "", False
        if not (before in FLYING and after in FLYING):
            self.helm.rest()
            self.resend = False
        if after == State.YIELDED:
            self.vehicle.release_control(reason)
        elif after == State.DONE:
            self.flight.ended = self.clock.now()
        self._changed.set()
        self._drop_thought()
        log.info("%s → %s: %s", before, after, reason)
        body = {"from": before, "event": event, "to": after, "reason": reason}
        await self._write("transition", body)
        self.vehicle.status_text(f"search {after}: {reason}")
        return True

    async def hold(self, cause: str, reason: str) -> None:
        """Hover until `cause` is gone; several causes can hold at once."""
        self.holds.causes.add(cause)
        if await self.happen(Event.HOLD, reason):
            refusal = await self.helm.hover(wanted=lambda: self.state == State.HOLDING)
            if refusal is not None:
                log.warning("no hold was sent: %s", refusal.reason)
                self.resend = refusal.cause == "link"

    async def leave(self, reason: str, *, stop: bool = True) -> None:
        """End the run where it is, for a fault that it cannot go on with or on a signal.

        Stops the aircraft, if it is ours and `stop`, and tells the pilot, who has it now.
        """
        before, self.state = self.state, State.ABORTED
        self.why_stopped = reason
        self._drop_thought()
        hovers = stop and not self.helm.on_ground() and self.helm.stop() is None
        said = self.vehicle.status_text(
            f"search ABORTED{', hovering' if hovers else ''}: {reason}", _CRITICAL
        )
        if self.journal.failed is None:
            body = {"from": before, "event": Event.ABORT, "to": self.state, "reason": reason}
            with contextlib.suppress(JournalLost):
                await self._write("transition", body)
        if said and hovers:
            await self.clock.sleep(LEAVING_S)  # a stop that is lost is sent again

    async def order(self, command: str, place: LatLon | None = None) -> str:
        """An operator's order: hold, resume, return or abort; confirm or reject a place, the present one unless
        given. Returns the state that came of it."""
        await self._write("order", {"command": command, "state": self.state, "place": place})
        try:
            if command in ("confirm", "reject"):
                await self.finding.judge(place, confirmed=command == "confirm")
            else:
                await self._obey(command)
        except LinkError as error:
            log.warning("%s: %s", command, error)
            self.vehicle.status_text(f"search {self.state}: {command} failed: {error}")
        return self.state.value

    async def _obey(self, command: str) -> None:
        ours = self.vehicle.in_control and self.vehicle.telemetry.guided and not self.autopilot_returns
        if command == "hold":
            if self.state == State.RETURNING and not ours:  # the autopilot flies home by itself
                await self.vehicle.enter_guided()
            await self.hold("operator", "the operator asked")
        elif command == "resume":
            if self.state in (State.YIELDED, State.HOLDING) and not ours:
                await self.vehicle.enter_guided()
            await self.happen(Event.RESUME, "the operator asked")
        elif command == "return":
            if self.state == State.YIELDED:
                await self.vehicle.enter_guided()
            if await self.happen(Event.RETURN, "the operator asked"):
                self.why_stopped = self.why_stopped or "the operator asked to return"
        elif command == "abort":
            self.why_stopped = "the operator aborted the run"
            await self.happen(Event.ABORT, "the operator asked")

    def _may_move(self) -> bool:
        return self.state in MAY_MOVE

    def flight_time(self) -> float:
        """Seconds in the air so far."""
        return (self.flight.ended or self.clock.now()) - self.flight.began if self.flight.began else 0.0

    def ahead(self) -> list[LatLon]:
        """Where the aircraft goes from here as decided: its waypoint and the path beyond; empty when it does not."""
        if self.state not in FLYING:
            return []
        return [
            self.helm.here(),
            *(self.helm.latlon(cell) for cell in (self._navigator.waypoint, *self.path)),
        ]

    # ---- phases ------------------------------------------------------------------------------------------

    async def run(self) -> None:
        """Fly the whole mission; returns when the state is final."""
        async with self._group as group:
            jobs = (self.watch.run(), self._guard(), self._keep_track())
            watchers = [group.create_task(job) for job in jobs]
            try:
                await self.departure.get_ready()
                while self.state not in FINAL:
                    await self._phase()
            finally:
                self._drop_thought()
                for watcher in watchers:
                    watcher.cancel()

    async def _phase(self) -> None:
        """Do what the state asks for until the state changes."""
        self._changed.clear()
        if self.state in FLYING:
            await self._search()
        elif self.state == State.FOUND:
            await self.finding.wait_over_the_place()
        elif self.state == State.RETURNING:
            await self._go_home()
        elif self.state == State.HOLDING:
            await self.holds.wait_out()
        else:
            await self._changed.wait()

    async def _search(self) -> None:
        """Fly from decision to decision until something else is to be done."""
        if not self.flight.began:
            self.flight.began = self.clock.now()
        await self._command(
            "speed", functools.partial(self.vehicle.set_speed, self.settings.flight.speed_mps)
        )
        here, inside = self.helm.cell()
        start = self.search.nearest_flyable(here)
        if self.state in FLYING and (not inside or start != here or self.helm.too_near()):
            await self._fly_route(start)
        self.intake.last_at = self.clock.now()
        self._navigator.interrupt(start, self.helm.heading())
        while self.state in FLYING:
            await self._look_for_the_end()
            if self.state in FLYING:
                await self._steer()
            await self._tick()

    async def _look_for_the_end(self) -> None:
        """Found, searched enough, or nobody looking?"""
        settings, place = self.settings, self.search.place
        if await self.finding.look():
            return
        if place.probability >= SUSPECT_AT:
            await self.happen(Event.SUSPECT, f"a place with probability {place.probability:.0%}")
        elif place.probability < CLEARED_BELOW:
            await self.happen(Event.CLEARED, "nothing there")
        enough = settings.search.stop_at_pos * self.search.grid.reachable_mass
        if self.search.record.searched >= enough and self.state == State.SEARCHING:
            self.why_stopped = f"searched to POS {self.search.record.searched:.1%}"
            await self._stop_searching(Event.SEARCHED)
        elif self.flight.steps >= settings.search.max_steps:
            self.why_stopped = f"{self.flight.steps} steps flown"
            await self._stop_searching(Event.SEARCHED)
        elif self.holds.detector_silent():
            log.warning("no detector report for %.0f s: hovering", settings.sensor.silent_after_s)
            await self.hold("detector", "the detector is silent")

    def _energy_low(self) -> str:
        """Why the aircraft must fly home now, or nothing."""
        return self.homeward.energy.objection(self.flight_time(), self.settings.flight)

    async def _stop_searching(self, event: Event) -> None:
        self.searched = True
        await self.happen(event, self.why_stopped)

    async def _steer(self) -> None:
        """One tick: note progress, think when it is time, send the next waypoint when it is due."""
        navigator, telemetry = self._navigator, self.vehicle.telemetry
        here, inside = self.helm.cell()
        if inside and here != self._last_cell:
            self.flight.steps += self._last_cell is not None
            self._last_cell = here
            navigator.entered(here)
        speed = telemetry.ground_speed_mps
        remaining = self.helm.metres_to(navigator.waypoint)
        if self._thinking is not None and self._thinking.done():
            decision, self._thinking = self._thinking.result(), None
            navigator.decide(decision.path)
            await self._decided(decision)
        if self.finding.hovers():
            if not self._hovering:
                self._hovering = True
                self._drop_thought()
                await self.helm.hover(wanted=lambda: self.state in FLYING)
            return
        if self._hovering:
            self._hovering = False
            navigator.interrupt(self.search.nearest_flyable(here), self.helm.heading())
        thinking_s = self.settings.search.deadline_s * self.clock.speedup
        if self._thinking is None and navigator.wants_decision(remaining, thinking_s):
            unseen = [cell for cell in navigator.ahead if cell not in self.intake.passes]
            self._thinking = asyncio.create_task(
                self.search.decide(navigator.waypoint, navigator.heading, unseen)
            )
            self._thinking.add_done_callback(lambda _: self._wake.set())
        target = navigator.due(remaining, speed)
        if self.resend or (target is not None and not await self._send(self.helm.latlon(target))):
            await self.clock.sleep(RETRY_S)
            self.resend = False
            self._drop_thought()  # it begins where the aircraft does not go now
            here, _ = self.helm.cell()
            navigator.interrupt(self.search.nearest_flyable(here), self.helm.heading())
        elif target is not None and self._hit_at is not None:
            self.flight.latencies_s.append(time.perf_counter() - self._hit_at)
            self._sent(self.flight.latencies_s[-1])
            self._hit_at = None

    def observed(self, observation: Observation, arrived: float) -> None:
        """An observation was applied (called by the intake): a hit asks for a new decision at once."""
        if not observation.speaking:
            return
        for lat, lon in self.frame.to_latlon(observation.speaking):
            self.flight.hits.append((float(lat), float(lon)))
        if self.state in FLYING:
            self._drop_thought()
            here, _ = self.helm.cell()
            self._navigator.interrupt(self.search.nearest_flyable(here), self.helm.heading())
            self._hit_at = arrived
            self._wake.set()

    # ---- home --------------------------------------------------------------------------------------------

    async def _go_home(self) -> None:
        """Fly home around what must not be flown over, then let the autopilot land."""
        if self.vehicle.telemetry.guided and not self.holds.direct:
            for point in self.helm.route(self.helm.home())[:-1]:
                if not await self._fly_to(point):
                    return
        self.helm.rest()  # from here the autopilot steers: it need not come nearer to a waypoint of ours
        ordered = -math.inf
        while self.state == State.RETURNING:
            now, telemetry = self.clock.now(), self.vehicle.telemetry
            if not telemetry.armed:
                await self.happen(Event.LANDED, "on the ground, disarmed")
            elif ordered < 0.0 or (telemetry.guided and now - ordered > HOME_AGAIN_S):
                ordered, self.autopilot_returns = now, True
                await self._command("return to launch", self.vehicle.return_to_launch)
            else:
                await self.clock.sleep(TICK_S)

    async def _fly_route(self, goal: Cell) -> None:
        """Fly to a cell around what must not be flown over; ends early when the state changes."""
        for point in self.helm.route(self.helm.latlon(goal)):
            if not await self._fly_to(point):
                return

    async def _fly_to(self, point: LatLon) -> bool:
        """Fly straight to a point; False when the state changed on the way."""
        state = self.state
        sent = await self._send(point, on_way=True)
        while self.state == state:
            if self.helm.distance(self.helm.here(), point) <= self.settings.flight.corner_m:
                return True
            if not sent or self.resend:
                await self.clock.sleep(RETRY_S)
                self.resend = False
                sent = self.state == state and await self._send(point, on_way=True)
            await self._tick()
        return False

    # ---- beside the phases -------------------------------------------------------------------------------

    async def _guard(self) -> None:
        """Ten times a second: can the position be trusted, is the waypoint flown, is there the energy for the way home,
        is there too much wind?"""
        while True:
            if self.journal.failed is not None:  # told to somebody else, who does not fly
                raise self._journal_lost(self.journal.failed)
            self.homeward.update()
            trouble = self.helm.trouble(moving=self.state in MOVING)
            if trouble is not None and self.state in (*MOVING, State.HOLDING):
                await self.hold(trouble.cause, trouble.reason)
            if self.state in FLYING and (why := self._energy_low()):
                self.why_stopped = why
                await self._stop_searching(Event.ENERGY_LOW)
            if self.state in FLYING and (why := self.helm.too_windy() or self.helm.strayed()):
                self.why_stopped = why
                await self.happen(Event.RETURN, why)
            await self.clock.sleep(TICK_S)

    async def _keep_track(self) -> None:
        """The track, once a second."""
        while True:
            if not self.helm.on_ground():
                self.flight.record(self.vehicle.telemetry, self.clock.now())
            await self.clock.sleep(1.0)

    # ---- commands ----------------------------------------------------------------------------------------

    async def _send(self, point: LatLon, *, on_way: bool = False) -> bool:
        """Send the aircraft to a point; hold when something speaks against it. False when it was not sent."""
        refusal = await self.helm.send(point, on_way=on_way)
        if refusal is None:
            self.flight.waypoints += 1
        elif refusal.cause in ("position", "limits"):
            await self.hold(refusal.cause, refusal.reason)
        else:
            log.warning("waypoint not sent: %s", refusal.reason)
        return refusal is None

    async def _command(self, name: str, action: Callable[[], Awaitable[object]]) -> None:
        """Carry out a command that is not a waypoint, if the state outlasts its row; a refusal is told, not fatal."""
        state = self.state
        await self._write("command", {"command": name})
        if self.state != state:
            return
        try:
            await action()
        except LinkError as error:
            log.warning("%s: %s", name, error)

    async def _write(self, kind: str, body: Mapping[str, object]) -> None:
        try:
            await self.journal.append(self.clock.now(), kind, body)
        except (sqlite3.Error, OSError) as error:
            raise self._journal_lost(error) from error

    def _journal_lost(self, error: Exception) -> JournalLost:
        return JournalLost(f"the journal {self.journal.path} cannot be written: {error}")

    async def _decided(self, decision: Decision) -> None:
        self.flight.decisions += 1
        self._thought(decision.effort.seconds)
        self.path = decision.path
        self.reason = self.search.reason(decision, self._navigator.waypoint)
        body = {"action": decision.action, "path": decision.path[:16], "reason": self.reason.text}
        await self._write("decision", {**body, "options": self.reason.rows()})

    def _drop_thought(self) -> None:
        if self._thinking is not None:
            self._thinking.cancel()
            self._thinking = None

    async def _tick(self) -> None:
        """Wait for the next tick, or for news that cannot wait."""
        self._wake.clear()
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(TICK_S / self.clock.speedup):
                await self._wake.wait()
