"""From the first heartbeat to the search: waiting for the vehicle, taking off or being taken up, or going on home."""

from __future__ import annotations

import asyncio
import contextlib
import functools
import logging
from collections.abc import Awaitable, Callable, Coroutine, Mapping
from typing import TYPE_CHECKING

from service.mavlink import LinkError
from service.mission.helm import RETRY_S, TICK_S
from service.mission.states import Event, State

if TYPE_CHECKING:
    from service.mission.mission import Mission

log = logging.getLogger("roisearch")


class Departure:
    """Gets the aircraft of a mission to where its search begins. Whatever changes the state meanwhile ends it."""

    def __init__(
        self, mission: Mission, *, write: Callable[[str, Mapping[str, object]], Awaitable[None]]
    ) -> None:
        """`write` writes a row to the journal and returns once it is on disk."""
        self._mission, self._write = mission, write
        self.was_returning: Mapping[str, str] | None = None
        """The last transition of the run that this one goes on with, when it was on its way home."""

    async def get_ready(self) -> None:
        """Connect, and then take off, wait for a pilot who does, or go on home."""
        mission = self._mission
        vehicle, patience = mission.vehicle, mission.settings.link.connect_timeout_s
        await vehicle.connect(patience)
        await vehicle.wait_until(lambda t: t.landed_state != "undefined", patience)
        mission.helm.begin()
        await mission.happen(Event.LINKED, f"{vehicle.telemetry.autopilot} is ready")
        if mission.state != State.READY:  # aborted meanwhile
            return
        if self.was_returning is not None:
            await self._go_on_home(self.was_returning)
        elif mission.may_take_off and mission.helm.on_ground():
            await self._take_off()
        else:
            log.info("take off and select the guided mode: the search starts when the aircraft hovers in it")
            if await self._hovers():
                await mission.happen(Event.AIRBORNE, "in the air, in the guided mode")

    async def _go_on_home(self, last: Mapping[str, str]) -> None:
        """The run that this one goes on with was on its way home. So is this one, if the aircraft is ours still, or
        down; while the autopilot brings it home, or a pilot has it, that is waited for."""
        log.info("it was on its way home: waiting until the aircraft is down, or hovers in the guided mode")
        mission = self._mission
        helm = mission.helm
        mission.found = mission.search.found()
        mission.why_stopped = "" if mission.found else last["reason"]
        mission.searched = last["event"] in (Event.SEARCHED, Event.ENERGY_LOW)
        while mission.state == State.READY and not helm.on_ground() and not helm.hovering():
            await mission.clock.sleep(TICK_S)
        if mission.state == State.READY and (helm.on_ground() or await self._hovers()):
            await mission.happen(Event.HOMEWARD, "it was on its way home")

    async def _hovers(self) -> bool:
        """Wait until the aircraft hovers in the guided mode, and take control; False when the state changed first."""
        mission = self._mission
        while mission.state == State.READY and not mission.helm.hovering():
            await mission.clock.sleep(TICK_S)
        if mission.state == State.READY:
            await mission.vehicle.enter_guided()
            mission.helm.begin()  # home is where it was armed
        return mission.state == State.READY

    async def _take_off(self) -> None:
        mission = self._mission
        vehicle, height = mission.vehicle, mission.settings.flight.altitude_m
        await self._unless_changed(vehicle.wait_ready(mission.settings.link.connect_timeout_s))
        if not await mission.happen(Event.CLIMB, f"taking off to {height:.0f} m"):
            return
        await self._write("command", {"command": "take off", "height_m": height})
        mission.flight.began = mission.clock.now()
        try:
            for step in (vehicle.enter_guided, vehicle.arm, functools.partial(vehicle.take_off, height)):
                if mission.state != State.TAKEOFF or not await self._unless_changed(step()):
                    return
            mission.helm.begin()  # home is where it was armed
            await mission.happen(Event.AIRBORNE, f"at {height:.0f} m")
        except LinkError as error:
            await mission.clock.sleep(RETRY_S)  # what the pilot did is told by an event of its own
            if mission.state == State.TAKEOFF:
                raise
            log.warning("%s", error)

    async def _unless_changed(self, action: Coroutine[object, object, object]) -> bool:
        """Carry out what takes long, as long as the state lasts; False when that changed, and it was broken off."""
        mission, doing = self._mission, asyncio.create_task(action)
        state = mission.state
        try:
            while not doing.done() and mission.state == state:
                await asyncio.wait([doing], timeout=TICK_S / mission.clock.speedup)
            if doing.done():
                doing.result()
            return mission.state == state
        finally:
            doing.cancel()
            with contextlib.suppress(asyncio.CancelledError, LinkError):
                await doing
