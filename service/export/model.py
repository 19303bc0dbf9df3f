"""A run as plain values, as every export takes it: where the aircraft was, what was seen, what was found, and when."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from roisearch import Belief
from service.area import Grid, SearchArea
from service.area.frame import GridFrame
from service.chances import share, sure
from service.config import Settings
from service.geometry import LatLon
from service.mission.states import FINAL
from service.places import written
from service.view.names import region_names
from service.view.shapes import region_features


@dataclass(frozen=True)
class Fix:
    """Where the aircraft was: time, degrees, metres above launch, nose in degrees from true north."""

    time: float
    lat: float
    lon: float
    height_m: float
    heading_deg: float
    aircraft: str = ""
    """Its name, where several fly."""


@dataclass(frozen=True)
class PlacedDetection:
    """What a detector reported at a place (degrees); `counted`: the frame put a hit into the map."""

    time: float
    lat: float
    lon: float
    kind: str
    score: float
    source: str
    counted: bool


@dataclass(frozen=True)
class ExportedFind:
    """The place at which the search counted its target as found; `sigma_m` metres along the longest axis.

    `ellipse` holds the target with 95 %: semi-axes in metres, and the bearing of the long one in degrees from true
    north; a circle of that size for a journal that tells no more than sigma.
    """

    time: float
    lat: float
    lon: float
    probability: float
    sigma_m: float
    ellipse: tuple[float, float, float]
    confirmed: bool = False
    """Whether an operator said so."""


@dataclass(frozen=True)
class TimelineEntry:
    """Something that happened, for the timeline: what kind of thing, and in words."""

    time: float
    kind: str
    text: str


@dataclass(frozen=True, eq=False)
class ExportedRun:
    """One run. Arrays are [rows, cols]; times in the service's clock, seconds since the epoch.

    Attributes:
        name: of its folder.
        area: as drawn in its file, and excluded since.
        grid: with what may be flown over as it stands in the end.
        belief: after all that was reported.
        pod: cumulative probability of detection, cell by cell.
        labels: regions of interest, 0 for none.
        pos: probability of success so far; `curve` is (seconds of searching, pos).
        track: the flights in unbroken pieces, each of one aircraft.
        hits: centres of the cells that had a hit, in order.
        autopilot: "px4" or "ardupilot", as it said when it was linked; empty before.
        launch_amsl_m: how high the launch point is above sea level; None before the first waypoint.
        state: the mission's last state; `over` is True when it can have no other.
    """

    name: str
    area: SearchArea
    grid: Grid
    settings: Settings
    belief: Belief
    pod: NDArray[np.float64]
    labels: NDArray[np.int32]
    pos: float
    looks: int
    reports: int
    curve: tuple[tuple[float, float], ...]
    track: tuple[tuple[Fix, ...], ...]
    hits: tuple[LatLon, ...]
    detections: tuple[PlacedDetection, ...]
    find: ExportedFind | None
    timeline: tuple[TimelineEntry, ...]
    autopilot: str
    launch_amsl_m: float | None
    state: str

    @property
    def frame(self) -> GridFrame:
        """Cells to positions and back."""
        return self.grid.frame

    @cached_property
    def region_names(self) -> list[str]:
        """What people call the regions of interest, region 1 first."""
        return region_names(self.area, self.frame, region_features(self.grid, self.labels))

    @property
    def poa(self) -> NDArray[np.float64]:
        """The probability now that the target is in each cell."""
        return self.belief.probability()

    @property
    def over(self) -> bool:
        """Whether the run has ended, as far as its journal knows: a killed one has not."""
        return self.state in FINAL

    @property
    def began(self) -> float:
        """When the first thing happened."""
        return self.timeline[0].time

    @property
    def last(self) -> float:
        """When the last thing was written down."""
        return max(self.timeline[-1].time, *(piece[-1].time for piece in self.track), self.began)

    @property
    def aircraft(self) -> Fix | None:
        """Where the aircraft was last."""
        return self.track[-1][-1] if self.track else None

    @property
    def tracks(self) -> dict[str, list[tuple[Fix, ...]]]:
        """The pieces of each aircraft, by its name."""
        found: dict[str, list[tuple[Fix, ...]]] = {}
        for piece in self.track:
            found.setdefault(piece[0].aircraft, []).append(piece)
        return found

    @property
    def flown_m(self) -> float:
        """Metres along the track."""
        total = 0.0
        for piece in self.track:
            metres = self.frame.to_metres([(fix.lat, fix.lon) for fix in piece])
            total += float(np.hypot(*np.diff(metres, axis=0).T).sum())
        return total

    def written(self, lat: float, lon: float) -> str:
        """A place as the team writes places."""
        return written((lat, lon), self.settings.run.coordinates)

    @property
    def summary(self) -> str:
        """How it stands, in one sentence."""
        done = f"probability of success {share(self.pos)} after {self.looks} looks"
        if self.find is not None:
            place = self.written(self.find.lat, self.find.lon)
            how = "confirmed by an operator" if self.find.confirmed else f"{sure(self.find.probability)} sure"
            return f"found at {place}, {how}; {done}"
        return f"{self.state.lower()}, not found so far; {done}" if not self.over else f"not found; {done}"
