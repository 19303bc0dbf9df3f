"""A sensor over ground where something hides the target from above.

A look at a cell finds a target that is there with `visibility` times its chance in the open; where it is hidden, what
is reported there is a false alarm, as likely as anywhere. So P(report | target there) = fa + v (p_tp - fa), with
fa = 1 - p_tn: a look at what cannot be seen at all says nothing, and the mass there stays.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from service.area import Grid
from service.area.projection import FloatArray
from service.config import Settings, about, each_aircraft
from service.evidence.observe import Footprint, FramePose, Reading
from service.evidence.reports import Report
from service.evidence.sensors import Profile, make_sensor

Floats = NDArray[np.float64]


def covered_p_tp(p_tp: Floats, p_tn: Floats, visibility: Floats) -> Floats:
    """P(report | target there) of looks [k] at cells that are visible so far."""
    alarm = 1.0 - p_tn
    return np.where(visibility >= 1.0, p_tp, alarm + visibility * (p_tp - alarm))


def detection_p(p_tp: Floats, p_tn: Floats, visibility: Floats) -> Floats:
    """The chance that such a look finds the target itself, from what `covered_p_tp` gives: for POD, in which a false
    alarm beside a hidden target is no success."""
    return np.where(visibility >= 1.0, p_tp, np.maximum(0.0, p_tp - (1.0 - visibility) * (1.0 - p_tn)))


@dataclass(frozen=True, eq=False)
class UnderCover:
    """A profile of a sensor over a grid with `visibility` [rows, cols]."""

    profile: Profile
    visibility: FloatArray

    def footprint(self, pose: FramePose) -> Footprint:
        """The cells in view, each worth what a look at it finds under its cover."""
        return self._covered(self.profile.footprint(pose))

    def read(self, pose: FramePose, report: Report) -> Reading:
        """The evidence in a report. Raises Unreadable."""
        reading = self.profile.read(pose, report)
        hits = {
            cell: 1.0 + float(self.visibility[cell]) * (ratio - 1.0) for cell, ratio in reading.hits.items()
        }
        return replace(reading, footprint=self._covered(reading.footprint), hits=hits)

    def _covered(self, footprint: Footprint) -> Footprint:
        at = self.visibility[footprint.cells[:, 0], footprint.cells[:, 1]]
        return replace(footprint, p_tp=covered_p_tp(footprint.p_tp, footprint.p_tn, at))


def sensors_over(grid: Grid, settings: Settings) -> dict[str, Profile]:
    """The sensor of each aircraft over a grid, by its name; "" that of the only one. Raises BadInput."""
    sensors = {}
    for name, alone in each_aircraft(settings).items():
        with about(name):
            sensors[name] = sensor_over(grid, alone)
    return sensors


def sensor_over(grid: Grid, settings: Settings) -> Profile:
    """The sensor of the settings of one aircraft over a grid. Raises BadInput."""
    profile = make_sensor(settings, grid)
    return profile if grid.visibility is None else UnderCover(profile, grid.visibility)
