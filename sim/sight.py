"""Whether the ground lets an aircraft see a place: a straight line over a height model, apart from the service."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from sim.autopilot.geo import LocalFrame
from sim.autopilot.ground import Ground, read_ground

Point = tuple[float, float]
STEP_M = 2.0
EYE_LEVEL_M = 0.5
"""Who lies on the ground is seen from half a metre above it."""


class Sight:
    """Lines of sight over a ground whose heights count from home (latitude, longitude)."""

    def __init__(self, ground: Ground, home: Point) -> None:
        self._ground, self._frame = ground, LocalFrame(*home)

    @classmethod
    def over(cls, file: Path, home: Point) -> Sight:
        """Over the heights of a raster file; ValueError says in one sentence why they cannot be had."""
        return cls(read_ground(file, (*home, 0.0)), home)

    def reaches(self, pose: dict[str, Any], place: Point) -> bool:
        """True when no ground stands between an aircraft (`lat`, `lon`, `height_m` above home) and a place."""
        (north, east), (north2, east2) = self._at((pose["lat"], pose["lon"])), self._at(place)
        up, up2 = pose["height_m"], self._ground.height(north2, east2) + EYE_LEVEL_M
        pieces = max(1, math.ceil(math.hypot(north2 - north, east2 - east) / STEP_M))
        for i in range(pieces):
            share = i / pieces
            below = self._ground.height(north + share * (north2 - north), east + share * (east2 - east))
            if up + share * (up2 - up) < below:
                return False
        return True

    def _at(self, place: Point) -> Point:
        """Metres north and east of home."""
        return self._frame.from_e7(place[0] * 1e7, place[1] * 1e7)
