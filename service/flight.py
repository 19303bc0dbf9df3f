"""What a flight has been so far, and what it has found."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from roisearch.place import Place
from service.area.frame import GridFrame
from service.mavlink.telemetry import Telemetry

LatLon = tuple[float, float]


@dataclass
class Flight:
    """What the flight has been so far; times in the service's clock, distances in metres."""

    began: float = 0.0
    ended: float = 0.0
    steps: int = 0
    decisions: int = 0
    waypoints: int = 0
    track: list[tuple[float, float, float, float]] = field(default_factory=list)  # time, lat, lon, height
    hits: list[LatLon] = field(default_factory=list)
    latencies_s: list[float] = field(default_factory=list)

    def record(self, t: Telemetry, now: float) -> None:
        """Add the aircraft's place to the track while it flies."""
        if t.armed and t.position_known:
            self.track.append((now, t.lat, t.lon, t.alt_home_m))


@dataclass(frozen=True)
class Found:
    """The target's place: position in degrees, probability of the neighbourhood, 1-sigma in metres."""

    lat: float
    lon: float
    probability: float
    sigma_m: float

    @classmethod
    def at(cls, frame: GridFrame, place: Place) -> Found:
        """From a place of the grid."""
        lat, lon = frame.to_latlon(np.array([place.centroid]))[0]
        sigma = math.sqrt(float(np.linalg.eigvalsh(place.covariance)[-1])) * frame.cell_m
        return cls(float(lat), float(lon), place.probability, sigma)
