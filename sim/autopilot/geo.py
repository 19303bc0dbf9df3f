"""Metres around home to latitude and longitude and back, with the WGS84 radii of curvature at home."""

from __future__ import annotations

import math

_A, _E2 = 6_378_137.0, 6.694_379_990_14e-3  # WGS84 semi-major axis [m], first eccentricity squared


class LocalFrame:
    """A flat frame at an origin; good to a centimetre over a kilometre, which is more than a mock needs."""

    __slots__ = ("latitude", "longitude", "metres_per_e7_east", "metres_per_e7_north")

    def __init__(self, latitude: float, longitude: float) -> None:
        self.latitude, self.longitude = latitude, longitude
        sine = math.sin(math.radians(latitude))
        root = math.sqrt(1.0 - _E2 * sine * sine)
        self.metres_per_e7_north = math.radians(_A * (1.0 - _E2) / root**3) * 1e-7
        self.metres_per_e7_east = math.radians(_A / root * math.cos(math.radians(latitude))) * 1e-7

    def to_e7(self, north: float, east: float) -> tuple[int, int]:
        """Latitude and longitude in 1e-7 degrees of a point metres north and east of the origin."""
        return (
            round(self.latitude * 1e7 + north / self.metres_per_e7_north),
            round(self.longitude * 1e7 + east / self.metres_per_e7_east),
        )

    def from_e7(self, latitude_e7: float, longitude_e7: float) -> tuple[float, float]:
        """Metres north and east of the origin."""
        return (
            (latitude_e7 - self.latitude * 1e7) * self.metres_per_e7_north,
            (longitude_e7 - self.longitude * 1e7) * self.metres_per_e7_east,
        )
