"""What a mission hovers for, and how that ends: the cause is gone, an operator decides, or it is time to fly home."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from typing import TYPE_CHECKING

from service.mission.helm import LEAST_PATIENCE_WALL_S
from service.mission.limits import hold_objection
from service.mission.states import FLYING, Event, State

if TYPE_CHECKING:
    from service.mission.mission import Mission

BLIND = {"link", "position"}  # causes of a hold during which the aircraft cannot be sent home either


class Holds:
    """The causes of the present hold; several can hold at once, and the search goes on when none does."""

    def __init__(
        self, mission: Mission, *, tick: Callable[[], Awaitable[None]], energy_low: Callable[[], str]
    ) -> None:
        """`tick` waits for the next look at things, `energy_low` says why the aircraft must fly home, or nothing."""
        self._mission = mission
        self._tick, self._energy_low = tick, energy_low
        self.causes: set[str] = set()
        self.homeward = False  # a hold on the way home goes on home
        self.direct = False  # the way home is the autopilot's own: ours could not be flown
        self._since = 0.0

    def entered(self, state: State, now: float) -> None:
        """The mission is in another state."""
        self.homeward = state == State.RETURNING or (self.homeward and state == State.HOLDING)
        self.direct = self.direct and state not in FLYING
        if state == State.HOLDING:
            self._since = now
        else:  # a cause that outlives its hold would keep the next one from ending
            self.causes.clear()

    async def release(self, cause: str, reason: str) -> None:
        """`cause` no longer holds; the search goes on, or the way home, when nothing else does."""
        self.causes.discard(cause)
        if not self.causes:
            await self._mission.happen(Event.RETURN if self.homeward else Event.RESUME, reason)

    async def wait_out(self) -> None:
        """Hover until the cause is gone, an operator decides, or it is time to fly home."""
        mission = self._mission
        while mission.state == State.HOLDING:
            if mission.resend:  # the stop may have been lost
                mission.resend = False
                await mission.helm.hover(wanted=lambda: mission.state == State.HOLDING)
            if "detector" in self.causes and not self.detector_silent():
                await self.release("detector", "the detector reports again")
            elif "link" in self.causes and mission.helm.heard():
                await self._heard_again()
            elif "position" in self.causes and not mission.helm.doubts():
                await self.release("position", "the position is good again")
            elif not self.causes & BLIND and (why := self._energy_low()):
                self.direct = self.homeward
                mission.why_stopped, mission.searched = why, True
                await mission.happen(Event.ENERGY_LOW, why)
            elif not self.causes & {*BLIND, "operator"} and (
                why := hold_objection(mission.clock.now() - self._since, mission.settings.flight)
            ):
                self.direct = self.homeward
                mission.why_stopped = mission.why_stopped or why
                await mission.happen(Event.RETURN, why)
            await self._tick()

    async def _heard_again(self) -> None:
        """The autopilot was silent: go on, wait for an operator, or fly home, as the settings say."""
        mission, said = self._mission, "the autopilot is heard again"
        then = mission.settings.link.after_silence
        if then == "hold" and not self.homeward:
            self.causes.add("operator")
        self.causes.discard("link")
        if then == "return" and not self.causes:
            mission.why_stopped = mission.why_stopped or "the autopilot was silent"
            await mission.happen(Event.RETURN, said)
        else:
            await self.release("link", said)

    def detector_silent(self) -> bool:
        """No report for too long; never shorter than what a busy host may need in wall time."""
        mission = self._mission
        limit = max(mission.settings.sensor.silent_after_s, LEAST_PATIENCE_WALL_S * mission.clock.speedup)
        return mission.clock.now() - mission.intake.last_at > limit
