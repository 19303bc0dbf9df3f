"""What the mission's core is shown each time it is asked: the aircraft, the search and the journal as they are now."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from roisearch import Motion
from service.evidence.found import Found
from service.mavlink.telemetry import Telemetry
from service.mission.apart import Other


@dataclass(frozen=True)
class Situation:
    """One moment, as a value.

    `guided_title` is what pilots call the mode in which the aircraft follows us. `events_waiting`: the telemetry is
    ahead of what the core was told, so the reason of what it shows may come yet. `journal_behind_s`: for how long the
    oldest row has waited to be on disk. `reported_at`: when the last detector report was taken in; `why_no_report`: why
    none was since. `searched`: the POS so far, and `enough` that at which
    the search is at its end; `left_out`: what of the ground is given up then;
    `place_probability` that of the most likely place, `found` that place if
    it counts as found (both while searching, on the way home and between two sorties); `place_in_sight`: it can
    be looked at from the air, as far as is known; `confirmed`: an operator said that it is the target's;
    `doubt`: why it waits for a person before it counts as found.
    `suspect_in_view`: a frame taken now shows it. `missing`: what the aircraft lacks that a search needs, as sentences'
    ends. `others`: the other aircraft of the same
    search; `over`: why that is over for all of them, which is told where there are others.
    `motion`: how the aircraft moves, as far as is known by now; None: as the settings say.
    """

    telemetry: Telemetry = field(default_factory=Telemetry)
    guided_title: str = "the guided mode"
    events_waiting: bool = False
    journal_behind_s: float = 0.0
    reported_at: float = 0.0
    why_no_report: str = "the detector is silent"
    searched: float = 0.0
    enough: float = 1.0
    left_out: str = ""
    place_probability: float = 0.0
    place_in_sight: bool = True
    found: Found | None = None
    confirmed: bool = False
    doubt: str = ""
    suspect_in_view: bool = False
    missing: tuple[str, ...] = ()
    others: tuple[Other, ...] = ()
    over: str = ""
    motion: Motion | None = None

    def flies_mps(self, asked_mps: float) -> float:
        """How fast the aircraft flies when it is asked to at `asked_mps`: slower where its parameters, or what was
        learnt in flight, say that it cannot; metres a second over ground in no wind."""
        told = self.telemetry.most_speed_mps or math.inf
        return min(asked_mps, told, math.inf if self.motion is None else self.motion.speed_mps)


def on_ground(t: Telemetry) -> bool:
    """On the ground with the motors off."""
    return not t.armed and t.landed_state == "on_ground"


def hovering(t: Telemetry) -> bool:
    """In the air, armed, in the guided mode."""
    return t.landed_state == "in_air" and t.guided and t.armed


def standing_still(t: Telemetry) -> bool:
    """The same, or in the mode that only stops."""
    return hovering(t) or (t.landed_state == "in_air" and t.stopped and t.armed)
