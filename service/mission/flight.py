"""What a flight has been so far."""

from __future__ import annotations

from dataclasses import dataclass, field

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
