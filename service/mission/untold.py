"""What nobody tells, and a person must know for that: the level of the battery, home, the health of the autopilot's
position estimate, and the wind."""

from __future__ import annotations

import logging
import math
from collections.abc import Iterator

from service.mavlink.telemetry import Wind
from service.mission.effects import Note, Tell
from service.mission.phase import Wish
from service.mission.situation import on_ground
from service.mission.standing import Look

BATTERY_S = 15.0  # after so long in the air a battery that was not told yet is one that is not told
HOME_S = 15.0  # home is asked for every two seconds, and set anew with the arming
HEALTH_S = 15.0
ESTIMATES = {"ESTIMATOR_STATUS", "EKF_STATUS_REPORT"}
WIND_S = 60.0  # after so long in the air the wind is told, or has been reckoned
_WARNING = 4  # MAV_SEVERITY


class Untold:
    """Says each once: to the pilot, on the console, and (the battery) on the page for as long as it is so."""

    def __init__(self) -> None:
        self.battery = ""
        """What is reckoned of the battery's level, or nothing while that is told."""
        self._wind_said = self._home_said = self._health_said = False
        self._heard_at = math.inf  # first, by this process

    def tick(self, look: Look, wind: Wind | None) -> Iterator[Wish]:
        """Look at the battery's level, and at the wind as it is told or reckoned (None: not known)."""
        if look.heard():
            self._heard_at = min(self._heard_at, look.now)
        aloft_s = min(look.flight.aloft_s(look.now), look.now - self._heard_at)
        if not on_ground(look.seen.telemetry):
            doubt = look.energy.warning() if aloft_s > BATTERY_S else ""
            if doubt and not self.battery:
                yield from self._say(doubt)
            self.battery = doubt
        if look.seen.telemetry.home is None and not self._home_said and aloft_s > HOME_S:
            self._home_said = True
            yield from self._say("home is not told: the launch point of the area is taken for it")
        told = look.seen.telemetry.told.keys() & ESTIMATES
        if not told and not self._health_said and aloft_s > HEALTH_S:
            self._health_said = True
            yield from self._say("the health of its position estimate is not told: the GPS is all to go by")
        if not look.standing.flying:
            return
        self._wind_said &= wind is None
        if wind is None and not self._wind_said and aloft_s > WIND_S:
            self._wind_said = True
            said = "the wind is not known, neither told nor reckoned from the lean: max_wind_mps does nothing"
            yield Note(said, logging.WARNING)
            yield Tell("search: wind is not known, look at it yourself", _WARNING)

    @staticmethod
    def _say(what: str) -> Iterator[Wish]:
        yield Note(what, logging.WARNING)
        yield Tell(f"search: {what}", _WARNING)
