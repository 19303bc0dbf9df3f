"""All aircraft of a run: each has its mission, and all of them one belief, one journal and one door.

A mission knows of the others only what its `Situation` tells it. What concerns all of them is here: an order goes to
the aircraft that it names or to all, and a report to the aircraft that it is of. One that fails ends its own mission;
the others go on, and the run is over when all are.
"""

from __future__ import annotations

import asyncio
import logging
import math
from collections.abc import Sequence

from service.config import ONLY, Settings, name_of
from service.errors import BadInput, shown
from service.evidence.counts import Counts, together
from service.evidence.found import Found
from service.evidence.reports import OrderReceipt, Receipt, Report
from service.geometry import LatLon
from service.journal import JournalLost
from service.known import Withdrawn
from service.mavlink import LinkError
from service.mission.mission import Mission
from service.mission.orders import SIGNAL, STOPPING
from service.mission.states import FINAL, State
from service.news.bearing import FieldNews

log = logging.getLogger("roisearch")
LOST_S = 30.0
"""An aircraft that has been silent for so long is not waited for when all others have ended."""
TAKING = ("resume", "return", "launch")
"""Orders that take an aircraft from its pilot, by its name only."""


class Squad:
    """The missions of a run, in the order of their aircraft."""

    def __init__(self, missions: Sequence[Mission], settings: Settings) -> None:
        self.missions = {mission.name or ONLY: mission for mission in missions}
        self._owner = {
            source: name_of(table, number)
            for number, table in enumerate(settings.aircraft)
            for source in table.sources
        }
        self._flying: list[asyncio.Task[None]] = []
        self._hits: list[LatLon] = []
        self._taken: dict[str, int] = {}

    # ---- what can be seen of it

    @property
    def leading(self) -> Mission:
        """The first that has been heard and has not ended, else the first that has not; when all have, the first that
        came home, or else the first."""
        every = list(self.missions.values())
        left = [each for each in every if each.state not in FINAL]
        heard = [each for each in left if each.state != State.WAITING]
        return next(iter([*heard, *left, *(each for each in every if each.state == State.DONE), *every]))

    @property
    def several(self) -> bool:
        """Whether there is more than one aircraft."""
        return len(self.missions) > 1

    @property
    def ended(self) -> bool:
        """Whether all missions have."""
        return all(each.state in FINAL for each in self.missions.values())

    @property
    def found(self) -> Found | None:
        """The place that counts as found."""
        return next((each.found for each in self.missions.values() if each.found is not None), None)

    @property
    def hits(self) -> list[LatLon]:
        """Where detectors reported the target, in their order; it only grows."""
        if not self.several:
            return self.leading.flight.hits
        for name, mission in self.missions.items():
            self._hits += mission.flight.hits[self._taken.get(name, 0) :]
            self._taken[name] = len(mission.flight.hits)
        return self._hits

    def counts(self) -> Counts:
        """What has become of the reports of all of them."""
        return together([each.intake.counts for each in self.missions.values()])

    # ---- flying

    async def run(self) -> None:
        """Fly all missions to their ends. Raises what was a mistake of ours in one, once all have ended."""
        self._flying = [asyncio.create_task(self._fly(each)) for each in self.missions.values()]
        waiting = asyncio.create_task(self._leave_the_lost()) if self.several else None
        try:
            await asyncio.wait(self._flying)
            for each in self._flying:
                each.result()
        finally:
            if waiting is not None:
                waiting.cancel()

    def cancel(self) -> None:
        """Leave every aircraft to its autopilot at once."""
        for each in self._flying:
            each.cancel()

    async def _fly(self, mission: Mission) -> None:
        """Fly one; what it cannot go on with ends it, and tells its pilot."""
        try:
            await mission.run()
        except* (LinkError, JournalLost) as group:
            for error in group.exceptions:
                log.error("%s%s", mission.called, error)
            lost = any(isinstance(error, JournalLost) for error in group.exceptions)
            await mission.leave(str(group.exceptions[0]), home=lost)  # nobody hovers because of a disk
        except* asyncio.CancelledError:
            await mission.leave(SIGNAL, stop=False)
        except* Exception as group:  # a mistake of ours: the aircraft does not fly on into it
            log.exception("%sinternal error", mission.called, exc_info=group)
            await mission.leave(f"internal error, {group.exceptions[0]!r}")
            raise

    async def _leave_the_lost(self) -> None:
        """When all others have ended, do not wait for one that is not heard any more."""
        clock = next(iter(self.missions.values())).clock
        begun = clock.now()
        while True:
            await clock.sleep(1.0)
            left = [each for each in self.missions.values() if each.state not in FINAL]
            if 0 < len(left) < len(self.missions) and all(_lost(each, begun) for each in left):
                for each in left:
                    log.error("%sit has been silent since all others have ended", each.called)
                    await each.leave("the autopilot is silent, and all others have ended")

    # ---- orders

    async def order(
        self,
        command: str,
        place: LatLon | None = None,
        aircraft: str | None = None,
        system_id: int | None = None,
    ) -> OrderReceipt:
        """An operator's order for one aircraft, or for all that have not ended. Raises BadInput when there is none of
        that name.

        A word on a place is about what all of them know. An aircraft that its pilot has is taken back by its name only,
        and so is one replaced by another: by the next that is heard, or the one with a MAVLink `system_id`.
        """
        if command in ("confirm", "reject"):
            return await self._judge(command, place)
        if aircraft is not None:
            return await self._named(aircraft).order(command, system_id=system_id)
        left = [each for each in self.missions.values() if each.state not in FINAL] or [self.leading]
        if self.several and command == "replace":
            return OrderReceipt(
                state=self.leading.state,
                refused="there are several: name the aircraft that another one replaces",
            )
        if not self.several:
            return await left[0].order(command, system_id=system_id)
        return await self._all(command, left)

    async def _all(self, command: str, left: list[Mission]) -> OrderReceipt:
        """An order that names none: who it means nothing to does not refuse it, unless it means nothing to any.

        What stops goes to all of them all the same, as it also ends what is only about to begin.
        """
        pilots = [each for each in left if command in TAKING and each.state == State.YIELDED]
        asked = [each for each in left if each not in pilots]
        meant = [each for each in asked if each.concerned(command)] or asked
        given = asked if command in STOPPING else meant
        receipts = await asyncio.gather(*(each.order(command) for each in given))
        why = [
            f"{each.name}: {said.refused}"
            for each, said in zip(given, receipts, strict=True)
            if said.refused and each in meant
        ]
        why += [
            f"{each.name}: its pilot has it, and only an order that names it takes it back" for each in pilots
        ]
        return OrderReceipt(state=self.leading.state, refused="; ".join(why) or None)

    async def _judge(self, command: str, place: LatLon | None) -> OrderReceipt:
        """A person's word on a place: believed once, and then told to all."""
        first = next((each for each in self.missions.values() if each.found is not None), self.leading)
        before = {name: each.core.overtaken for name, each in self.missions.items()}
        receipt = await first.order(command, place)
        for name, each in self.missions.items():
            if each is not first and each.state not in FINAL and not receipt.refused:
                moves = each.core.overtaken == before[name]  # nobody has stopped it since
                await each.judged(confirmed=command == "confirm", moves=moves)
        return receipt

    def _named(self, aircraft: str) -> Mission:
        if aircraft not in self.missions:
            raise BadInput(f"there is no aircraft {shown(aircraft)}; there is {', '.join(self.missions)}")
        return self.missions[aircraft]

    async def hear(self, said: FieldNews | Withdrawn) -> None:
        """News from the field, or news taken back. Raises BadInput, JournalLost."""
        if isinstance(said, FieldNews) and said.role == "exclude":
            for each in self.missions.values():
                if each.state not in FINAL:
                    each.core.chart.refuse_over_home(said.ground, each.vehicle.telemetry, each.name)
        first = self.leading
        await first.hear(said)
        for each in self.missions.values():
            if each is not first:
                each.map_changed()

    # ---- reports

    async def submit_all(self, reports: Sequence[Report]) -> list[Receipt]:
        """Detector reports, each placed by the pose of its own aircraft; their receipts in the same order.

        Raises JournalLost when one could not be written.
        """
        receipts: dict[int, Receipt] = {}
        own: dict[str, list[int]] = {}
        for number, report in enumerate(reports):
            name, why = self._whose(report)
            if why:
                receipts[number] = self.leading.intake.refuse(report, why)
            else:
                own.setdefault(name, []).append(number)
        for name, numbers in own.items():
            taken = await self.missions[name].intake.submit_all([reports[each] for each in numbers])
            receipts |= dict(zip(numbers, taken, strict=True))
        return [receipts[number] for number in range(len(reports))]

    def _whose(self, report: Report) -> tuple[str, str]:
        """The aircraft that a report is of, or why that cannot be told."""
        name = report.aircraft or self._owner.get(report.source)
        if name is None and not self.several:
            return next(iter(self.missions)), ""
        names = ", ".join(f'"{each}"' for each in self.missions)
        if name is None:
            source = shown(report.source)
            return "", (
                f'it does not say of which aircraft it is: add "aircraft", one of {names}, or put the source {source} '
                "into the sources of an aircraft in the settings"
            )
        return (
            (name, "")
            if name in self.missions
            else ("", f"there is no aircraft {shown(name)}; there is {names}")
        )


def _lost(mission: Mission, begun: float) -> bool:
    """Silent for long, since the run was `begun` at the earliest; on the ground between two sorties it may be switched
    off, and is waited for as the settings say. One that has not been heard may be starting, and one that an earlier
    process has left in the air is waited for as long as a battery lasts."""
    if mission.core.between_sorties:
        return False
    told, settings = mission.vehicle.telemetry.heartbeat_time, mission.core.settings
    patience_s = max(LOST_S, mission.core.terms.heartbeat_fresh_s)
    if not math.isfinite(told):
        aloft = mission.core.may_be_aloft
        patience_s = (
            settings.flight.full_battery_s if aloft else max(patience_s, settings.link.connect_timeout_s)
        )
    return mission.clock.now() - max(told, begun) > patience_s
