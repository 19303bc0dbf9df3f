"""From a detector report to an observation: which cells were looked at, and which of them had a hit.

A frame shows the cells of the field of view around the aircraft at the moment of capture. It counts as a look
only when the aircraft was well enough centred on its cell for the footprint to cover the cells (`covered`),
and high enough. Frames of the same ground seconds apart are not independent looks, so a cell is looked at once
per *pass*: a pass begins with the first frame that covers the cell well (`min_covered`) and ends when a frame
covers less than half of that, so that hovering at the limit does not make many passes of one. The first frame
decides the verdict; a later hit in the same pass turns a miss into a hit, and never the reverse.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from roisearch import FieldOfView
from service.area.frame import GridFrame

HEADINGS = ("north", "east", "south", "west")
Cell = tuple[int, int]


@dataclass(frozen=True)
class Pose:
    """Where the aircraft was: degrees, metres above launch, nose in degrees from true north, seconds."""

    lat: float
    lon: float
    height_m: float
    heading_deg: float
    time: float


@dataclass(frozen=True)
class Footprint:
    """The cells that a frame from one pose shows, int [k, 2], how well they are covered (0..1), and whether
    that is enough for a look."""

    cells: NDArray[np.int64]
    covered: float
    counts: bool


@dataclass(frozen=True)
class Observation:
    """What one report says about the ground: cells int [k, 2], hits bool [k], with their likelihoods [k].

    `first` bool [k] is False where a miss of the same pass turned into a hit: that is not another look.
    """

    cells: NDArray[np.int64]
    hits: NDArray[np.bool_]
    p_tp: NDArray[np.float64]
    p_tn: NDArray[np.float64]
    first: NDArray[np.bool_]

    def to_dict(self) -> dict[str, object]:
        """Plain lists for the journal; floats keep every bit."""
        return {
            "cells": self.cells.tolist(),
            "hits": self.hits.tolist(),
            "p_tp": self.p_tp.tolist(),
            "p_tn": self.p_tn.tolist(),
            "first": self.first.tolist(),
        }

    @classmethod
    def from_dict(cls, row: dict[str, list[object]]) -> Observation:
        """The inverse of `to_dict`."""
        return cls(
            np.array(row["cells"], dtype=np.int64).reshape(-1, 2),
            np.array(row["hits"], dtype=np.bool_),
            np.array(row["p_tp"], dtype=np.float64),
            np.array(row["p_tn"], dtype=np.float64),
            np.array(row["first"], dtype=np.bool_),
        )


def grid_heading(heading_deg: float, bearing_deg: float) -> str:
    """The grid direction nearest to a true heading, for a grid whose north points to `bearing_deg`."""
    return HEADINGS[round(((heading_deg - bearing_deg) % 360.0) / 90.0) % 4]


@dataclass
class Sensor:
    """The sensor's profile on this grid: which cells a pose shows.

    `overlap` is how much wider than a cell the footprint is (0.2: a fifth), so how far off the cell's centre
    the aircraft may be and still see all of it.
    """

    frame: GridFrame
    fov: FieldOfView
    p_tp: float
    p_tn: float
    overlap: float
    min_covered: float
    height_m: float

    def footprint(self, pose: Pose) -> Footprint:
        """The cells in view from `pose`; none when it is too low, off the grid or far between cells."""
        nothing = Footprint(np.empty((0, 2), dtype=np.int64), 0.0, False)
        if pose.height_m < 0.7 * self.height_m:
            return nothing
        point = np.array([[pose.lat, pose.lon]])
        cells, inside = self.frame.locate(point)
        if not inside[0]:
            return nothing
        cell: Cell = (int(cells[0, 0]), int(cells[0, 1]))
        centre = np.array([cell[1] + 0.5, cell[0] + 0.5])
        off = np.abs(self.frame.to_metres(point)[0] / self.frame.cell_m - centre)
        spare = 0.5 * self.overlap / (1.0 - self.overlap)
        covered = float(np.prod(1.0 - np.clip(off - spare, 0.0, 1.0)))
        if covered < 0.5 * self.min_covered:
            return Footprint(nothing.cells, covered, False)
        heading = grid_heading(pose.heading_deg, self.frame.bearing_deg)
        cells_in_view = self.fov.cells(cell, heading, self.frame.shape)
        return Footprint(cells_in_view, covered, covered >= self.min_covered)


@dataclass
class Passes:
    """Which cells are in the middle of a pass, and the verdict it has so far."""

    verdict: dict[Cell, bool] = field(default_factory=dict)

    def look(
        self, seen: Iterable[Cell], hits: set[Cell], counts: bool
    ) -> tuple[list[Cell], list[Cell], list[Cell]]:
        """Take one frame in: returns the cells newly missed, newly hit, and turned from miss to hit.

        A frame that does not count starts no pass; it only keeps those that go on.
        """
        shown = list(seen)
        missed: list[Cell] = []
        hit: list[Cell] = []
        turned: list[Cell] = []
        for cell in shown:
            before = self.verdict.get(cell)
            if before is None:
                if counts:
                    (hit if cell in hits else missed).append(cell)
                    self.verdict[cell] = cell in hits
            elif not before and cell in hits:
                turned.append(cell)
                self.verdict[cell] = True
        for cell in self.verdict.keys() - set(shown):
            del self.verdict[cell]
        return missed, hit, turned


def observe(sensor: Sensor, passes: Passes, footprint: Footprint, hits: set[Cell]) -> Observation | None:
    """The observation that a frame adds, or None when it adds nothing new.

    Turning a miss into a hit multiplies the odds by (hit ratio / miss ratio): the same as a hit of a sensor
    with p_tp' = p_tp * p_tn and 1 - p_tn' = (1 - p_tp) * (1 - p_tn).
    """
    missed, hit, turned = passes.look(
        ((row, col) for row, col in footprint.cells.tolist()), hits, footprint.counts
    )
    cells = missed + hit + turned
    if not cells:
        return None
    p_tp = [sensor.p_tp] * (len(missed) + len(hit)) + [sensor.p_tp * sensor.p_tn] * len(turned)
    p_tn = [sensor.p_tn] * (len(missed) + len(hit))
    p_tn += [1.0 - (1.0 - sensor.p_tp) * (1.0 - sensor.p_tn)] * len(turned)
    return Observation(
        np.array(cells, dtype=np.int64),
        np.array([False] * len(missed) + [True] * (len(hit) + len(turned)), dtype=np.bool_),
        np.array(p_tp),
        np.array(p_tn),
        np.array([True] * (len(missed) + len(hit)) + [False] * len(turned), dtype=np.bool_),
    )
