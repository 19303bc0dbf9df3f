"""Missions put together: core, intake and shell around each vehicle, with what an earlier run has journalled.

What is made first knows nothing of what is made later, so that everything is whole when it is made.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from service.config import Settings
from service.evidence.intake import Intake
from service.evidence.moments import Moments
from service.evidence.observe import FramePose, Observation
from service.evidence.passes import Passes
from service.evidence.sensors import Profile
from service.journal import Journal
from service.mavlink import Vehicle
from service.mission.core import MissionCore
from service.mission.formation import Formation
from service.mission.mission import Mission, Stopwatch
from service.mission.standing import Terms
from service.redrawing import Redrawing
from service.resume import Remembered, Whose, left_flight, left_standing, remembered_of, retrace_all
from service.search import Search
from service.squad import Squad
from service.view.live import RunView

log = logging.getLogger("roisearch")


def assemble_all(
    searches: Sequence[Search],
    vehicles: Sequence[Vehicle],
    prepared: Onboard,
    journal: Journal,
    view: RunView,
) -> Squad:
    """The missions of all aircraft, each with its vehicle, whose link is open."""
    first = searches[0]
    remembered = retrace_all(journal.path, first, view.curve.add)
    if remembered:
        count, pos = sum(len(each.names) for each in remembered.values()), 100 * first.record.pos
        log.info("resumed: %d reports of the earlier run, POS %.1f %%", count, pos)
    if moved := view.settings.search.regions_moved:
        first.common.redraw_by(Redrawing(moved, first.grid.searchable, view.named))
    missions, formation = [], Formation()
    for search, vehicle in zip(searches, vehicles, strict=True):
        whose = Whose(search.aircraft, search is first)
        own = remembered_of(remembered, journal.path, whose)
        missions.append(assemble(search, vehicle, prepared, journal, view, (whose, own), formation))
    return Squad(missions, view.settings)


@dataclass(frozen=True)
class Onboard:
    """The sensor of each aircraft by its name, and whether it may be that no person started this (see `Terms`)."""

    sensors: Mapping[str, Profile]
    restarted: bool


def assemble(
    search: Search,
    vehicle: Vehicle,
    prepared: Onboard,
    journal: Journal,
    view: RunView,
    left: tuple[Whose, Remembered],
    formation: Formation,
) -> Mission:
    """The mission of a search with one vehicle, which joins the formation; `left`: whose rows are its own, and what its
    intake knows by them."""
    clock, settings = view.clock, search.settings
    whose, remembered = left

    def make_intake(
        pose_at: Callable[[float], FramePose | None], told: Callable[[Observation, float], None]
    ) -> Intake:
        def observed(observation: Observation, arrived: float) -> None:
            view.curve.add(clock.now(), search.record.pos)
            told(observation, arrived)

        intake = Intake(
            search,
            prepared.sensors[search.aircraft],
            journal,
            Moments(clock, vehicle.time_of_boot),
            pose_at,
            observed,
            believed=view.believed.observe,
            passes=Passes(again_s=settings.sensor.hover_look_s or math.inf),
        )
        intake.placed = lambda: len(vehicle.history) > 0
        remembered.tell(intake)
        return intake

    core = MissionCore(
        settings,
        search.grid,
        terms_of(settings, vehicle, restarted=prepared.restarted, name=search.aircraft),
        standing=left_standing(journal.path, search, whose),
        flight=left_flight(journal.path, search, whose),
    )
    return Mission(
        core,
        clock=clock,
        search=search,
        vehicle=vehicle,
        journal=journal,
        make_intake=make_intake,
        formation=formation,
        stopwatch=Stopwatch(view.thinking.observe, view.latency.observe),
    )


def terms_of(settings: Settings, vehicle: Vehicle, *, restarted: bool, name: str = "") -> Terms:
    """On what terms the mission flies."""
    return Terms(
        speedup=settings.speedup,
        position_fresh_s=vehicle.settings.position_fresh_s,
        heartbeat_fresh_s=vehicle.settings.heartbeat_fresh_s,
        may_take_off=settings.mock or settings.flight.takeoff,
        may_take_off_again=settings.mock,
        restarted=restarted,
        name=name,
    )
