"""From a detector report to an observation: which cells were looked at, and which of them had a hit.

A frame shows the cells of the field of view around the aircraft at the moment of capture. It counts as a look
only when the aircraft was well enough centred on its cell for the footprint to cover the cells (`covered`),
and high enough. Frames of the same ground seconds apart are not independent looks, so a cell is looked at once
per *pass*: a pass begins with the first frame that covers the cell well (`min_covered`) and ends when a frame
covers less than half of that, so that hovering at the limit does not make many passes of one. The first frame
decides the verdict; a later hit in the same pass turns a miss into a hit, and never the reverse.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from roisearch import FieldOfView
from service.area.frame import GridFrame
from service.reports import Report

HEADINGS = ("north", "east", "south", "west")
Cell = tuple[int, int]


@dataclass(frozen=True)
class Pose:
    """Where the aircraft was: degrees, metres above launch, seconds; nose from true north, up, and right wing
    down, as `service.reports` says."""

    lat: float
    lon: float
    height_m: float
    heading_deg: float
    time: float
    pitch_deg: float = 0.0
    roll_deg: float = 0.0


@dataclass(frozen=True)
class Footprint:
    """The cells that a frame shows, and what a look at each of them is worth.

    cells int [k, 2]; covered float [k], the part of the cell that is in view (0..1); counts bool [k], whether that
    is enough for a look; p_tp and p_tn float [k], the likelihoods of such a look.
    """

    cells: NDArray[np.int64]
    covered: NDArray[np.float64]
    counts: NDArray[np.bool_]
    p_tp: NDArray[np.float64]
    p_tn: NDArray[np.float64]

    @classmethod
    def alike(
        cls, cells: NDArray[np.int64], *, covered: float, counts: bool, p_tp: float, p_tn: float
    ) -> Footprint:
        """A footprint with the same for every cell."""
        k = len(cells)
        return cls(cells, np.full(k, covered), np.full(k, counts), np.full(k, p_tp), np.full(k, p_tn))


@dataclass(frozen=True)
class Reading:
    """What a sensor makes of one report: the cells that the frame shows, and for each cell with a hit the
    likelihood ratio of it, P(hit | target there) / P(hit | target not there), above 0."""

    footprint: Footprint
    hits: Mapping[Cell, float]


class Unreadable(ValueError):
    """A report that the sensor can make nothing of; says why, for its sender."""


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

    def read(self, pose: Pose, report: Report) -> Reading:
        """The evidence in a report of a frame taken from `pose`.

        Raises:
            Unreadable: the report says what this profile cannot interpret.
        """
        if report.footprint is not None or report.gimbal is not None:
            given = "footprint" if report.footprint is not None else "gimbal"
            raise Unreadable(f"the sensor profile fixes what a frame shows: it has no use for a {given}")
        if any(detection.box is not None for detection in report.detections):
            raise Unreadable(
                "the sensor profile cannot place a pixel box; give the lat and lon of each detection"
            )
        footprint = self.footprint(pose)
        return Reading(footprint, self._hits(report, footprint))

    def footprint(self, pose: Pose) -> Footprint:
        """The cells in view from `pose`; none when it is too low, off the grid or far between cells."""
        nothing = self._alike(np.empty((0, 2), dtype=np.int64), 0.0)
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
            return nothing
        heading = grid_heading(pose.heading_deg, self.frame.bearing_deg)
        return self._alike(self.fov.cells(cell, heading, self.frame.shape), covered)

    def _alike(self, cells: NDArray[np.int64], covered: float) -> Footprint:
        counts = covered >= self.min_covered
        return Footprint.alike(cells, covered=covered, counts=counts, p_tp=self.p_tp, p_tn=self.p_tn)

    def _hits(self, report: Report, footprint: Footprint) -> dict[Cell, float]:
        """The cells of the footprint that a detection lies in, or next to (its position is not exact)."""
        hits: dict[Cell, float] = {}
        if not report.detections or not len(footprint.cells):
            return hits
        cells, _ = self.frame.locate(np.array([[seen.lat, seen.lon] for seen in report.detections]))
        for cell in cells:
            gap = np.abs(footprint.cells - cell).max(axis=1)
            nearest = int(gap.argmin())
            if gap[nearest] <= 1:
                row, col = footprint.cells[nearest]
                hits[int(row), int(col)] = self.p_tp / (1.0 - self.p_tn)
        return hits


@dataclass
class Passes:
    """Which cells are in the middle of a pass, and the verdict it has so far."""

    verdict: dict[Cell, bool] = field(default_factory=dict)

    def look(
        self, seen: Iterable[tuple[Cell, bool]], hits: Mapping[Cell, float]
    ) -> tuple[list[Cell], list[Cell], list[Cell]]:
        """Take one frame in: returns the cells newly missed, newly hit, and turned from miss to hit.

        `seen` tells for each cell in view whether it counts as a look; one that does not starts no pass, it only
        keeps one that goes on.
        """
        shown = dict(seen)
        missed: list[Cell] = []
        hit: list[Cell] = []
        turned: list[Cell] = []
        for cell, counts in shown.items():
            before = self.verdict.get(cell)
            if before is None:
                if counts:
                    (hit if cell in hits else missed).append(cell)
                    self.verdict[cell] = cell in hits
            elif not before and cell in hits:
                turned.append(cell)
                self.verdict[cell] = True
        for cell in self.verdict.keys() - shown.keys():
            del self.verdict[cell]
        return missed, hit, turned


def observe(passes: Passes, reading: Reading) -> Observation | None:
    """The observation that a frame adds, or None when it adds nothing new.

    A hit of likelihood ratio L is told to the belief as that of a sensor with the cell's p_tp and
    1 - p_tn = p_tp / L. Turning a miss into a hit multiplies the odds by L / ((1 - p_tp) / p_tn).
    """
    footprint, hits = reading.footprint, reading.hits
    shown = [(row, col) for row, col in footprint.cells.tolist()]
    missed, hit, turned = passes.look(zip(shown, footprint.counts.tolist(), strict=True), hits)
    cells = missed + hit + turned
    if not cells:
        return None
    at = [shown.index(cell) for cell in cells]
    p_tp, p_tn = footprint.p_tp[at], footprint.p_tn[at]
    for number in range(len(missed), len(cells)):
        ratio = hits[cells[number]]
        if number >= len(missed) + len(hit):
            ratio *= p_tn[number] / (1.0 - p_tp[number])
        p_tp[number], p_tn[number] = as_likelihoods(ratio, p_tp[number])
    return Observation(
        np.array(cells, dtype=np.int64),
        np.array([False] * len(missed) + [True] * (len(hit) + len(turned)), dtype=np.bool_),
        p_tp,
        p_tn,
        np.array([True] * (len(missed) + len(hit)) + [False] * len(turned), dtype=np.bool_),
    )


def as_likelihoods(ratio: float, p_tp: float) -> tuple[float, float]:
    """p_tp and p_tn of a sensor whose hit multiplies the odds by `ratio` > 0: p_tp / (1 - p_tn) = ratio.

    The given p_tp is kept wherever it can be; a hit that says less than it (ratio <= p_tp) is told with
    p_tp = p_tn = ratio / (1 + ratio), which has that ratio too.
    """
    if ratio > p_tp:
        return p_tp, 1.0 - p_tp / ratio
    return ratio / (1.0 + ratio), ratio / (1.0 + ratio)
