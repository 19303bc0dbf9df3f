"""What the vehicle does by itself: the pilot's mode changes, a lost link, a waypoint that it does not fly, landing."""

from __future__ import annotations

import logging
from collections.abc import Awaitable, Callable, Mapping
from typing import TYPE_CHECKING

from service.mavlink.events import LinkLost, ModeChanged, Stalled, TargetNotTaken, TargetTaken
from service.mission.states import MOVING, Event, State
from service.mission.takeover import Takeovers

if TYPE_CHECKING:
    from service.mission.mission import Mission

log = logging.getLogger("roisearch")
REFUSALS = 2  # so many waypoints in a row that are not flown are no bad luck


class Watch:
    """Listens to the vehicle beside the phases of a mission, and lets happen what follows from it."""

    def __init__(
        self, mission: Mission, *, write: Callable[[str, Mapping[str, object]], Awaitable[None]]
    ) -> None:
        """`write` writes a row to the journal and returns once it is on disk."""
        self._mission, self._write = mission, write
        self._refused = 0  # waypoints in a row that were not flown
        self._takeovers = Takeovers()

    async def run(self) -> None:
        """Listen until the link is closed."""
        mission = self._mission
        stalled_at = 0.0
        async for event in mission.vehicle.events():
            if isinstance(event, ModeChanged):
                await self._write("mode", {"mode": event.mode, "commanded": event.commanded})
            elif isinstance(event, Stalled):
                stalled_at, mission.resend = event.time, True
            elif isinstance(event, TargetNotTaken):
                await self._write("not taken", {"lat": event.target.lat, "lon": event.target.lon})
                if event.time != stalled_at:  # given up because we stood still: it is sent again
                    await self._not_taken(event)
            elif isinstance(event, TargetTaken):
                self._refused = 0
            elif isinstance(event, LinkLost):
                await mission.hold("link", "the autopilot is silent")
            why = self._takeovers.read(event, landing=mission.state == State.RETURNING)
            if why and not await mission.happen(Event.PILOT, why) and mission.state == State.YIELDED:
                mission.why_here += f"; {why}"
                await self._write("yielded", {"reason": why})
            # while more events wait, why it landed may be among them
            told = not mission.vehicle.events_waiting
            if told and mission.state in (State.YIELDED, State.HOLDING) and mission.helm.on_ground():
                why = f"landed before the search was over: {mission.why_here}"
                said = self._takeovers.said()  # often told only after the mode has changed
                mission.why_stopped = mission.why_stopped or why + (said if said not in why else "")
                await mission.happen(Event.LANDED, "on the ground, disarmed")

    async def _not_taken(self, event: TargetNotTaken) -> None:
        """The autopilot does not fly to the waypoint: hold, for what that is most likely due to.

        On a bad radio a waypoint may get lost as often as it is repeated, so another one is tried first.
        """
        mission = self._mission
        self._refused += 1
        if mission.state not in MOVING:
            log.warning("the stop is not flown: %s", event.reason)
            mission.resend = self._refused < REFUSALS
        elif not mission.helm.heard():
            await mission.hold("link", "the autopilot is silent")
        elif doubts := mission.helm.doubts():
            await mission.hold("position", "; ".join(doubts))
        elif self._refused < REFUSALS:
            mission.resend = True
        else:
            await mission.hold("target", f"the waypoint is not flown: {event.reason}")
