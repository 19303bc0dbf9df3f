"""The asyncio shell around the core of a link: bytes, ticks and events, and things to wait for.

Deciding is the core's. Whoever is about to send something that moves the aircraft calls `pump` before: everything that
the wire has is read then, so that the decision is taken on the last heartbeat there is, not on the last one that the
event loop got round to.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator, Callable
from typing import TypeVar

from service.clock import Clock
from service.mavlink.command import Command
from service.mavlink.core import LinkCore
from service.mavlink.errors import LinkError
from service.mavlink.events import CommandDone, Outcome, VehicleEvent
from service.mavlink.keeper import TimestampKeeper
from service.mavlink.settings import MavlinkSettings
from service.mavlink.transports import Transport

_T = TypeVar("_T")
_TICK_S = 0.05
_SHORTEST_TICK_WALL_S = 0.005
_PATIENCE_WALL_S = 1.0
_OPEN_AGAIN_WALL_S = 1.0


class Shell:
    """One core on one transport, run by the tasks of `running`.

    Attributes:
        core: what decides; another one for another vehicle.
        clock: of the service.
    """

    def __init__(self, transport: Transport, clock: Clock, settings: MavlinkSettings) -> None:
        scaled = settings.for_speedup(clock.speedup)
        self.clock = clock
        self.core = LinkCore(scaled, speaks_first=transport.speaks_first)
        self._transport = transport
        self._queue: asyncio.Queue[VehicleEvent | None] = asyncio.Queue()
        self._changed = asyncio.Event()
        self._waiting: dict[int, asyncio.Future[Outcome]] = {}
        signer = self.core.codec.signer
        self._keeper = None if signer is None else TimestampKeeper(signer, scaled.signing_timestamp_file)

    @contextlib.asynccontextmanager
    async def running(self) -> AsyncIterator[None]:
        """Keep the link up for as long as the block lasts; raises as `Vehicle.open`."""
        if self._keeper is not None:
            self._keeper.begin()
        if not self.core.settings.wait_for_ever:
            await self._transport.open()
        failure: Exception | None = None
        try:
            async with asyncio.TaskGroup() as group:
                tasks = [
                    group.create_task(self._keep_up(), name="mavlink wire"),
                    group.create_task(self._tick_for_ever(), name="mavlink tick"),
                ]
                if self._keeper is not None:
                    tasks.append(group.create_task(self._keeper.run(), name="mavlink signing"))
                try:
                    yield
                except Exception as error:  # leaves as it is, not wrapped into the group of our tasks' errors
                    failure = error
                finally:
                    for task in tasks:
                        task.cancel()
        finally:
            self._transport.close()
            self._queue.put_nowait(None)
        if failure is not None:
            raise failure

    @property
    def address(self) -> str:
        """The link's address, with the port in use."""
        return self._transport.address

    async def _keep_up(self) -> None:
        """Run the wire; where it is waited for, it is opened first."""
        while self.core.settings.wait_for_ever:
            try:
                await self._transport.open()
                break
            except LinkError:  # which was said before anything was prepared
                await asyncio.sleep(_OPEN_AGAIN_WALL_S)
        await self._transport.run(self.pump)

    # ---- what happens

    async def events(self) -> AsyncIterator[VehicleEvent]:
        """Everything that happens, in order, from the opening of the link on; ends when the link is closed.

        There is one stream of events, for one reader.
        """
        while (event := await self._queue.get()) is not None:
            yield event

    @property
    def events_waiting(self) -> bool:
        """True while `telemetry` is ahead of what the reader of `events` has been told."""
        return not self._queue.empty()

    # ---- in and out

    def pump(self) -> None:
        """Take in everything that the wire has, then send what that caused."""
        chunks, now = self._transport.receive(), self.clock.now()
        for data, source in chunks:  # one time for all: what waited in the buffer is as old as its oldest
            self.publish(self.core.receive_data(data, now, source))
        self.flush()
        self._announce()

    def forget(self, system_id: int | None) -> None:
        """Forget the vehicle and wait for another one: see `LinkCore.forget`."""
        self.pump()  # what it has said until now was its own
        self.core, events = self.core.forget(system_id, self.clock.now())
        self.publish(events)
        self.flush()
        self._announce()

    async def _tick_for_ever(self) -> None:
        pause = max(_TICK_S, _SHORTEST_TICK_WALL_S * self.clock.speedup)
        while True:
            self.pump()
            self.publish(self.core.tick(self.clock.now()))
            self.flush()
            self._announce()
            await self.clock.sleep(pause)

    def flush(self) -> None:
        """Send what the core has to send."""
        for frame in self.core.data_to_send():
            self._transport.send(frame, self.core.destination)

    def publish(self, events: list[VehicleEvent]) -> None:
        """Tell the reader of `events`, and whoever waits for the end of a command."""
        for event in events:
            self._queue.put_nowait(event)
            if isinstance(event, CommandDone):
                waiting = self._waiting.pop(event.ticket, None)
                if waiting is not None and not waiting.done():
                    waiting.set_result(event.outcome)

    def _announce(self) -> None:
        changed, self._changed = self._changed, asyncio.Event()
        changed.set()

    async def until(self, condition: Callable[[], _T | None], timeout_s: float) -> _T | None:
        """Wait until a condition gives something; None if it did not in time."""
        try:
            async with self.clock.timeout(timeout_s):
                while (value := condition()) is None:
                    await self._changed.wait()
                return value
        except TimeoutError:
            return condition()

    def patience(self, seconds: float) -> float:
        """A time to wait for an answer, never too short in wall time for a busy host."""
        return max(seconds, _PATIENCE_WALL_S * self.clock.speedup)

    async def ask(self, command: Command, *, ordered: bool = False) -> Outcome:
        """Send a command and wait for its end, which the core sees to."""
        ticket = self.core.request(command, self.clock.now(), ordered=ordered)
        future: asyncio.Future[Outcome] = asyncio.get_running_loop().create_future()
        self._waiting[ticket] = future
        self.flush()
        try:
            return await future
        finally:
            self._waiting.pop(ticket, None)
