"""From a detector report to an observation: which cells were looked at, and which of them had a hit.

A frame shows the cells of the field of view around the aircraft at the moment of capture. It counts as a look
only when the aircraft was well enough centred on its cell for the footprint to cover the cells (`covered`),
and high enough. How many looks the frames of the same ground are, `service.evidence.passes` decides.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from roisearch import FieldOfView
from service.area.frame import GridFrame
from service.camera.locate import Spot, spread_hits
from service.evidence.calibration import Calibration
from service.evidence.passes import Look, Passes
from service.evidence.reports import Report

HEADINGS = ("north", "east", "south", "west")
Cell = tuple[int, int]


@dataclass(frozen=True)
class Pose:
    """Where the aircraft was: degrees, metres above launch, seconds; nose from true north, up, and right wing
    down, as `service.evidence.reports` says."""

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
    """What a sensor makes of one report: the cells that the frame shows, and for each of them with a hit the
    likelihood ratio of it, P(hit | target there) / P(hit | target not there), above 0; and where its detections
    are."""

    footprint: Footprint
    hits: Mapping[Cell, float]
    sightings: tuple[Sighting, ...] = ()


@dataclass(frozen=True)
class Sighting:
    """One detection as the service places it: degrees, and the covariance of it in the grid's square metres as
    (east-east, east-south, south-south), or None when nothing is known about its error."""

    lat: float
    lon: float
    covariance: tuple[float, float, float] | None = None
    thumbnail: str | None = None


class Unreadable(ValueError):
    """A report that the sensor can make nothing of; says why, for its sender."""


@dataclass(frozen=True)
class Observation:
    """What one report says about the ground: cells int [k, 2], hits bool [k], with their likelihoods [k].

    `first` bool [k] is False where a look of the same pass turned into a hit: that is not another look.
    `sightings` are the frame's detections.
    """

    cells: NDArray[np.int64]
    hits: NDArray[np.bool_]
    p_tp: NDArray[np.float64]
    p_tn: NDArray[np.float64]
    first: NDArray[np.bool_]
    sightings: tuple[Sighting, ...] = ()

    @property
    def speaking(self) -> list[Cell]:
        """The cells with a hit that makes the target there more likely."""
        for_it = self.hits & (self.p_tp > 1.0 - self.p_tn)
        return [(row, col) for row, col in self.cells[for_it].tolist()]

    def to_dict(self) -> dict[str, object]:
        """Plain lists for the journal; floats keep every bit."""
        return {
            "cells": self.cells.tolist(),
            "hits": self.hits.tolist(),
            "p_tp": self.p_tp.tolist(),
            "p_tn": self.p_tn.tolist(),
            "first": self.first.tolist(),
            **({"sightings": [asdict(each) for each in self.sightings]} if self.sightings else {}),
        }

    @classmethod
    def from_dict(cls, row: dict[str, list[Any]]) -> Observation:
        """The inverse of `to_dict`."""
        return cls(
            np.array(row["cells"], dtype=np.int64).reshape(-1, 2),
            np.array(row["hits"], dtype=np.bool_),
            np.array(row["p_tp"], dtype=np.float64),
            np.array(row["p_tn"], dtype=np.float64),
            np.array(row["first"], dtype=np.bool_),
            tuple(_sighting(each) for each in row.get("sightings", ())),
        )


def finite_or_level(angle_deg: float) -> float:
    """An angle of attitude; level until the vehicle has told it."""
    return angle_deg if math.isfinite(angle_deg) else 0.0


def _sighting(row: dict[str, Any]) -> Sighting:
    c = row["covariance"]
    covariance = None if c is None else (c[0], c[1], c[2])
    return Sighting(row["lat"], row["lon"], covariance, row["thumbnail"])


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
    calibration: Calibration | None = None

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
        if self.calibration is not None and (looks := self.calibration.at(report.threshold)) is not None:
            k = len(footprint.cells)
            footprint = replace(footprint, p_tp=np.full(k, looks[0]), p_tn=np.full(k, looks[1]))
        hits = self._hits(report, footprint)
        return Reading(footprint, hits, sightings(report, self.frame, hits))

    def footprint(self, pose: Pose) -> Footprint:
        """The cells in view from `pose`; none when it is too low, off the grid or far between cells."""
        nothing = self._alike(np.empty((0, 2), dtype=np.int64), 0.0)
        if pose.height_m < 0.7 * self.height_m:
            return nothing
        east, south = (self.frame.to_metres([[pose.lat, pose.lon]])[0] / self.frame.cell_m).tolist()
        rows, cols = self.frame.shape
        if not (0.0 <= south < rows and 0.0 <= east < cols):
            return nothing
        cell: Cell = (math.floor(south), math.floor(east))
        spare = 0.5 * self.overlap / (1.0 - self.overlap)
        off = (abs(south - cell[0] - 0.5), abs(east - cell[1] - 0.5))
        covered = math.prod(1.0 - min(max(along - spare, 0.0), 1.0) for along in off)
        if covered < 0.5 * self.min_covered:
            return nothing
        heading = grid_heading(pose.heading_deg, self.frame.bearing_deg)
        return self._alike(self.fov.cells(cell, heading, self.frame.shape), covered)

    def _alike(self, cells: NDArray[np.int64], covered: float) -> Footprint:
        counts = covered >= self.min_covered
        return Footprint.alike(cells, covered=covered, counts=counts, p_tp=self.p_tp, p_tn=self.p_tn)

    def _hits(self, report: Report, footprint: Footprint) -> dict[Cell, float]:
        """The cells of the footprint that a detection lies in, or next to (its position is not exact); one with a
        known accuracy is spread over all that it may lie in."""
        if not report.detections or not len(footprint.cells):
            return {}
        sure = [
            (Spot(self.frame.to_metres([[seen.lat, seen.lon]])[0], np.eye(2) * seen.accuracy_m**2), seen)
            for seen in report.detections
            if seen.lat is not None and seen.lon is not None and seen.accuracy_m is not None
        ]
        hits, _ = spread_hits(
            [(spot, self._ratio(seen.score)) for spot, seen in sure],
            footprint.cells, footprint.p_tp, footprint.p_tn, self.frame.cell_m,
        )  # fmt: skip
        cells, _ = self.frame.locate(np.array([[seen.lat, seen.lon] for seen in report.detections]))
        for cell, seen in zip(cells, report.detections, strict=True):
            if seen.accuracy_m is not None:
                continue
            gap = np.abs(footprint.cells - cell).max(axis=1)
            nearest = int(gap.argmin())
            if gap[nearest] <= 1:
                row, col = (int(index) for index in footprint.cells[nearest])
                hits[row, col] = max(self._ratio(seen.score), hits.get((row, col), 0.0))
        return hits

    def _ratio(self, score: float) -> float:
        """What a hit with this score is worth."""
        return self.p_tp / (1.0 - self.p_tn) if self.calibration is None else self.calibration.ratio(score)


def sightings(report: Report, frame: GridFrame, hits: Mapping[Cell, float]) -> tuple[Sighting, ...]:
    """The detections of a report that lie in the cells of `hits` or beside them."""
    found = []
    for seen in report.detections if hits else ():
        if seen.lat is None or seen.lon is None:
            continue
        row, col = frame.to_cells([[seen.lat, seen.lon]])[0].tolist()
        if any((row + r, col + c) in hits for r in (-1, 0, 1) for c in (-1, 0, 1)):
            square = None if seen.accuracy_m is None else (seen.accuracy_m**2, 0.0, seen.accuracy_m**2)
            found.append(Sighting(seen.lat, seen.lon, square, seen.thumbnail))
    return tuple(found)


def observe(passes: Passes, source: str, time: float, reading: Reading) -> Observation | None:
    """The observation that a source's frame of that time adds, or None when it adds nothing new."""
    footprint = reading.footprint
    looks: dict[Cell, Look] = {}
    columns = (footprint.cells, footprint.counts, footprint.p_tp, footprint.p_tn)
    for (row, col), counts, p_tp, p_tn in zip(*(column.tolist() for column in columns), strict=True):
        looks[row, col] = Look(counts, p_tp, p_tn, reading.hits.get((row, col)))
    changes = passes.take(source, time, looks)
    if not changes:
        return None
    return Observation(
        np.array([change.cell for change in changes], dtype=np.int64),
        np.array([change.hit for change in changes], dtype=np.bool_),
        np.array([change.p_tp for change in changes]),
        np.array([change.p_tn for change in changes]),
        np.array([change.first for change in changes], dtype=np.bool_),
        reading.sightings if any(change.hit for change in changes) else (),
    )
