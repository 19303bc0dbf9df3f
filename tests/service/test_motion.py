"""The motion of a run: the settings, and what the autopilot's parameters take away from it."""

from __future__ import annotations

import pytest

from service.config import FlightSettings
from service.motion import MotionLimits, limits_note, motion_of, within

MOTION = motion_of(FlightSettings(speed_mps=8.0, acceleration_mps2=2.0, deceleration_mps2=0.45), 25.0)


@pytest.mark.parametrize(
    ("limits", "speed", "acceleration"),
    [
        (MotionLimits(), 8.0, 2.0),
        (MotionLimits(12.0, 3.0), 8.0, 2.0),
        (MotionLimits(6.0, None), 6.0, 2.0),
        (MotionLimits(None, 1.0), 8.0, 1.0),
    ],
)
def test_a_limit_only_takes_away(limits: MotionLimits, speed: float, acceleration: float) -> None:
    bound = within(MOTION, limits)
    assert (bound.speed_mps, bound.acceleration_mps2) == (speed, acceleration)
    assert bound.pace.brake == MOTION.pace.brake
    assert bool(limits_note(MOTION, limits)) == (bound != MOTION)


def test_the_log_says_what_is_less_than_asked() -> None:
    assert limits_note(MOTION, MotionLimits(6.0, 1.0)) == (
        "by its parameters the aircraft flies at most 6 m/s, not flight.speed_mps = 8 and speeds up with at most "
        "1 m/s², not flight.acceleration_mps2 = 2: the plan reckons with that"
    )
