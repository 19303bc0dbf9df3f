"""From a detector report to an observation: which cells were looked at, and which of them had a hit.

What a frame shows and says is for the sensor's profile to work out (`service.evidence.mask`, `service.camera.sensor`);
how many looks the frames of the same ground are, `service.evidence.passes` decides.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from service.evidence.passes import CellLook, Passes
from service.geometry import Cell

HEADINGS = ("north", "east", "south", "west")
COURSE_FROM_MPS = 2.0  # ground speed from which the course is taken for the heading when that is not known


@dataclass(frozen=True)
class FramePose:
    """Where the aircraft was: degrees, metres above launch, seconds; nose from true north (NaN: not known), up, and
    right wing down, as `service.evidence.reports` says."""

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
    is enough for a look; p_tp and p_tn float [k], the likelihoods of such a look. `why_not`: why no cell counts, for
    people, where none does.
    """

    cells: NDArray[np.int64]
    covered: NDArray[np.float64]
    counts: NDArray[np.bool_]
    p_tp: NDArray[np.float64]
    p_tn: NDArray[np.float64]
    why_not: str = ""

    @classmethod
    def alike(
        cls,
        cells: NDArray[np.int64],
        *,
        covered: float,
        counts: bool,
        p_tp: float,
        p_tn: float,
        why_not: str = "",
    ) -> Footprint:
        """A footprint with the same for every cell."""
        k = len(cells)
        each = np.full(k, covered), np.full(k, counts), np.full(k, p_tp), np.full(k, p_tn)
        return cls(cells, *each, why_not)

    def in_vain(self, why_not: str) -> Footprint:
        """The same ground, of which nothing counts as a look."""
        return replace(self, counts=np.zeros(len(self.cells), dtype=np.bool_), why_not=why_not)


@dataclass(frozen=True)
class Reading:
    """What a sensor makes of one report: the cells that the frame shows, and for each of them with a hit the
    likelihood ratio of it, P(hit | target there) / P(hit | target not there), above 0; and where its detections
    are. `note`: what of the report does not count, for who sent it."""

    footprint: Footprint
    hits: Mapping[Cell, float]
    sightings: tuple[Sighting, ...] = ()
    note: str = ""


@dataclass(frozen=True)
class Sighting:
    """One detection as the service places it: degrees, and the covariance of it in the grid's square metres as
    (east-east, east-south, south-south), or None when nothing is known about its error; where a picture of it is, and
    the detector's score from 0 to 1."""

    lat: float
    lon: float
    covariance: tuple[float, float, float] | None = None
    thumbnail: str | None = None
    score: float | None = None


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


def heading_or_course(heading_deg: float, north_mps: float, east_mps: float) -> float:
    """Where the nose points; unless that is known the course over ground of an aircraft that moves, else NaN."""
    if math.isfinite(heading_deg) or not math.hypot(north_mps, east_mps) >= COURSE_FROM_MPS:
        return heading_deg
    return math.degrees(math.atan2(east_mps, north_mps)) % 360.0


def finite_or_level(angle_deg: float) -> float:
    """An angle of attitude; level until the vehicle has told it."""
    return angle_deg if math.isfinite(angle_deg) else 0.0


def _sighting(row: dict[str, Any]) -> Sighting:
    c = row["covariance"]
    covariance = None if c is None else (c[0], c[1], c[2])
    return Sighting(row["lat"], row["lon"], covariance, row["thumbnail"], row.get("score"))


def grid_heading(heading_deg: float, bearing_deg: float) -> str:
    """The grid direction nearest to a true heading, for a grid whose north points to `bearing_deg`.

    A heading that is not known counts as the grid's north: whoever needs to know it asks before.
    """
    if not math.isfinite(heading_deg):
        return HEADINGS[0]
    return HEADINGS[round(((heading_deg - bearing_deg) % 360.0) / 90.0) % 4]


def observe(passes: Passes, source: str, time: float, reading: Reading) -> Observation | None:
    """The observation that a source's frame of that time adds, or None when it adds nothing new."""
    footprint = reading.footprint
    looks: dict[Cell, CellLook] = {}
    columns = (footprint.cells, footprint.counts, footprint.p_tp, footprint.p_tn)
    for (row, col), counts, p_tp, p_tn in zip(*(column.tolist() for column in columns), strict=True):
        looks[row, col] = CellLook(counts, p_tp, p_tn, reading.hits.get((row, col)))
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
