"""What a mission looks at: its aircraft, its search, its journal and the others, put together as one moment."""

from __future__ import annotations

from dataclasses import dataclass

from service.clock import Clock
from service.evidence.intake import Intake
from service.evidence.observe import FramePose, finite_or_level, heading_or_course
from service.journal import Journal
from service.looking import pays_to_hover, place_in_sight
from service.mavlink import Vehicle
from service.mission.core import MissionCore
from service.mission.formation import Formation
from service.mission.situation import Situation
from service.mission.states import State
from service.search import Search


def pose_at(vehicle: Vehicle, core: MissionCore, moment: float) -> FramePose | None:
    """Where the aircraft was, if that was known and is trusted."""
    pose = vehicle.pose_at(moment)
    if pose is None or not core.helm.trust.trusted_at(moment):
        return None
    heading = heading_or_course(pose.heading_deg, pose.north_mps, pose.east_mps)
    up = pose.alt_home_m + core.helm.heights.home_m
    return FramePose(pose.lat, pose.lon, up, heading, moment, pose.pitch_deg, pose.roll_deg)


@dataclass(frozen=True, eq=False)
class Outlook:
    """All that the situation of one mission is taken from."""

    core: MissionCore
    clock: Clock
    search: Search
    vehicle: Vehicle
    journal: Journal
    intake: Intake
    formation: Formation

    def situation(self) -> Situation:
        """How everything is now."""
        search, standing, autopilot = self.search, self.core.standing, self.vehicle.autopilot
        looks = standing.flying or standing.state in (State.RETURNING, State.GROUNDED)
        return Situation(
            telemetry=self.vehicle.telemetry,
            guided_title=autopilot.guided_title if autopilot is not None else Situation.guided_title,
            journal_behind_s=self.journal.behind_s(),
            events_waiting=self.vehicle.events_waiting,
            reported_at=self.intake.last_at,
            why_no_report=self.intake.counts.silence(
                self.clock.now(), self.core.settings.sensor.silent_after_s
            ),
            searched=search.record.searched,
            enough=search.enough,
            left_out=search.left_out,
            place_probability=search.place.probability if looks else 0.0,
            place_in_sight=place_in_sight(search) if looks else True,
            found=search.found() if looks else None,
            confirmed=search.confirmed is not None,
            doubt=search.doubt() if standing.flying or "doubt" in standing.causes else "",
            suspect_in_view=self._suspect_in_view(),
            missing=tuple(self.vehicle.missing()) if standing.state in (State.READY, State.GROUNDED) else (),
            others=self.formation.others(search.aircraft),
            over=search.over() if self.formation.several else "",
            motion=search.motion,
        )

    def _suspect_in_view(self) -> bool:
        """A frame taken now is another look at what is worth one at once."""
        state, search = self.core.standing.state, self.search
        confirming = state == State.CONFIRMING
        chases = state == State.SEARCHING and search.grid.walk is not None
        if not self.core.settings.sensor.hover_look_s or not (confirming or chases):
            return False
        t = self.vehicle.telemetry
        attitude = (finite_or_level(t.pitch_deg), finite_or_level(t.roll_deg))
        pose = FramePose(
            t.lat, t.lon, self.core.helm.heights.up(t), t.heading_deg, t.position_time, *attitude
        )
        seen = self.intake.sensor.footprint(pose)
        in_view = [(row, col) for row, col in seen.cells[seen.counts].tolist()]
        return (confirming and search.place.cell in in_view) or pays_to_hover(search, in_view)
