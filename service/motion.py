"""How the aircraft of a run moves: what the settings say of it, until it has flown and told."""

from __future__ import annotations

import logging
import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

from roisearch import Motion
from roisearch.motion import TURNS
from roisearch.motion_fit import Flown, learnt
from service.config import SPARE_M, FlightSettings
from service.evidence.mask import HIGHEST, LOWEST

log = logging.getLogger("roisearch")
CORNER_OF_CELL = 0.35
"""Farther from its middle than this part of a cell's side no turn begins: the cell has to be seen."""


class MotionLimits(NamedTuple):
    """What an autopilot's parameters allow over ground, and how fast they let it climb and sink; None: not told."""

    speed_mps: float | None = None
    acceleration_mps2: float | None = None
    climb_mps: float | None = None
    descent_mps: float | None = None


def motion_of(flight: FlightSettings, cell_m: float, *, diagonal: bool = True) -> Motion:
    """The motion by the settings, on cells of `cell_m` metres, to eight neighbours or to four."""
    return Motion(
        cell_m=cell_m,
        speed_mps=flight.speed_mps,
        acceleration_mps2=flight.acceleration_mps2,
        braking_mps2=flight.deceleration_mps2,
        corner_m=min(flight.corner_m, CORNER_OF_CELL * cell_m),
        climb_mps=flight.climb_mps,
        descent_mps=flight.descent_mps,
        slack_m=_slack(flight),
        diagonal=diagonal,
    )


def _slack(flight: FlightSettings) -> tuple[float, float]:
    """How far below and above the height of the search a look still counts, and the ground and the law allow."""
    below = min((1.0 - LOWEST) * flight.altitude_m, flight.altitude_m - flight.clearance_m - SPARE_M)
    above = min((HIGHEST - 1.0) * flight.altitude_m, flight.max_height_m - flight.altitude_m)
    return max(0.0, below), max(0.0, above)


def within(motion: Motion, limits: MotionLimits) -> Motion:
    """`motion`, no faster and no livelier than the autopilot allows; it is never livelier than it was.

    An autopilot's parameter is a limit and not what the airframe does, so it can only take away. Braking stays as it
    is: how hard an autopilot brakes for a waypoint no parameter says, and the distance it needs hangs on it.

    Up and down nobody tells it how fast to go but its parameters, and a multicopter flies what they say: once they are
    told they count, be it more or less than the settings.
    """
    speed, acceleration, climb, descent = limits
    return replace(
        motion,
        speed_mps=min(motion.speed_mps, speed or math.inf),
        acceleration_mps2=min(motion.acceleration_mps2, acceleration or math.inf),
        climb_mps=climb or motion.climb_mps,
        descent_mps=descent or motion.descent_mps,
    )


def learnt_in_flight(motion: Motion, flights: Sequence[Flown]) -> Motion | None:
    """How the aircraft moves by these flown paths, which `motion` is what is known of before; says so. None when they
    do not tell."""
    try:
        found = learnt(motion, flights)
    except ValueError as error:
        log.warning("how the aircraft moves could not be learnt: %s", error)
        return None
    corners = ", ".join(f"{found.corner_speed(degrees):.1f}" for degrees in TURNS[:3])
    log.info(
        "learnt in flight: %.1f m/s, speeds up with %.1f and brakes with %.1f m/s²; corners of 45, 90 and 135° at "
        "%s m/s",
        found.speed_mps,
        found.acceleration_mps2,
        found.pace.brake,
        corners,
    )
    return found


def limits_note(motion: Motion, limits: MotionLimits) -> str:
    """What the limits take away from `motion`, for the log; nothing when they take nothing."""
    bound = within(motion, limits)
    said = []
    if bound.speed_mps < motion.speed_mps:
        said.append(f"flies at most {bound.speed_mps:g} m/s, not flight.speed_mps = {motion.speed_mps:g}")
    if bound.acceleration_mps2 < motion.acceleration_mps2:
        asked = f"flight.acceleration_mps2 = {motion.acceleration_mps2:g}"
        said.append(f"speeds up with at most {bound.acceleration_mps2:g} m/s², not {asked}")
    return f"by its parameters the aircraft {' and '.join(said)}: the plan reckons with that" if said else ""
