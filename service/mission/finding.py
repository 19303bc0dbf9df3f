"""From 'this place is probable enough' to the end of the search: found, what then, and what an operator says to it.

FOUND is a posterior: the most likely place and its neighbours hold `search.found_at` or more, and a hit was reported
there (or an operator confirmed it). Then `search.on_found` decides: "return" flies home, "hover" waits over the place
for an operator, "continue" goes on looking. An operator who confirms a place ends the search; one who rejects it adds
the evidence that it is not there, and a search that had ended for that place goes on.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Mapping
from typing import TYPE_CHECKING

from service.evidence.observe import Pose, finite_or_level
from service.mission.flight import LatLon
from service.mission.states import Event, State

if TYPE_CHECKING:
    from service.mission.mission import Mission


class Finding:
    """What a mission does about a found target; `mission.found` is the place, or None."""

    def __init__(
        self,
        mission: Mission,
        *,
        write: Callable[[str, Mapping[str, object]], Awaitable[None]],
        tick: Callable[[], Awaitable[None]],
        energy_low: Callable[[], str],
    ) -> None:
        """`write` puts a row into the journal, `tick` waits for the next look at things, `energy_low` says why the
        aircraft must fly home, or nothing."""
        self._mission = mission
        self._write, self._tick, self._energy_low = write, tick, energy_low
        self._settings = mission.settings
        self._then = mission.settings.search.on_found

    async def look(self) -> bool:
        """See whether the target is found now; True when that ends the search."""
        mission, known = self._mission, self._mission.found
        found = mission.found = mission.search.found()
        if found is not None and (known is None or (known.lat, known.lon) != (found.lat, found.lon)):
            await self._tell("the posterior passed search.found_at")
        return mission.state == State.FOUND

    def hovers(self) -> bool:
        """Whether to stay here for another look: at a suspect in view, when hovering gives one."""
        mission = self._mission
        if self._settings.sensor.hover_look_s == 0.0 or mission.state != State.CONFIRMING:
            return False
        t = mission.vehicle.telemetry
        attitude = (finite_or_level(t.pitch_deg), finite_or_level(t.roll_deg))
        pose = Pose(t.lat, t.lon, t.alt_home_m, t.heading_deg, t.position_time, *attitude)
        seen = mission.intake.sensor.footprint(pose)
        return list(mission.search.place.cell) in seen.cells[seen.counts].tolist()

    async def judge(self, place: LatLon | None, *, confirmed: bool) -> None:
        """Take in what an operator says about a place, or about the present one."""
        mission = self._mission
        present = (mission.found.lat, mission.found.lon) if mission.found else None
        await mission.intake.judge(mission.search.cell_at(place or present), confirmed=confirmed)
        said = f"the operator {'confirmed' if confirmed else 'rejected'} the place"
        if confirmed:
            mission.found = mission.search.found()
            await self._tell(said)
        elif mission.found is not None and mission.search.found() is None:
            mission.found = None
            homeward = mission.state == State.RETURNING and not mission.why_stopped
            ours = mission.vehicle.in_control and mission.vehicle.telemetry.guided
            if homeward and (mission.autopilot_returns or not ours):
                await mission.vehicle.enter_guided()
            if homeward or mission.state == State.FOUND:
                await mission.happen(Event.REJECTED, said)

    async def wait_over_the_place(self) -> None:
        """Fly home from what was found, or hover until an operator decides or the energy runs low."""
        mission = self._mission
        if self._then == "hover" and mission.search.confirmed is None:
            await mission.helm.hover(wanted=lambda: mission.state == State.FOUND)
            while mission.state == State.FOUND and mission.search.confirmed is None:
                if why := self._energy_low():
                    mission.why_stopped = why
                    await mission.happen(Event.ENERGY_LOW, why)
                await self._tick()
        if mission.state == State.FOUND:
            await mission.happen(Event.RETURN, "found: flying home")

    async def _tell(self, why: str) -> None:
        """Write down what was found; it ends the search unless that is to continue and nobody confirmed it."""
        mission = self._mission
        assert mission.found is not None
        await self._write("found", vars(mission.found))
        if mission.search.confirmed is not None or self._then != "continue":
            where = f"{mission.found.lat:.6f}, {mission.found.lon:.6f}, p = {mission.found.probability:.4f}"
            await mission.happen(Event.CONFIRMED, f"found at {where}: {why}")
