"""What a flight has been so far, and what it has found."""

from __future__ import annotations

from dataclasses import dataclass, field

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


@dataclass(frozen=True)
class Found:
    """The target's place: position in degrees, probability of the neighbourhood, 1-sigma in metres."""

    lat: float
    lon: float
    probability: float
    sigma_m: float
