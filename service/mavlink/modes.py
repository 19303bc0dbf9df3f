"""What a flight mode means to a search, whatever the autopilot calls it."""

from __future__ import annotations

from enum import StrEnum


class ModeKind(StrEnum):
    """What a flight mode means to a search."""

    GUIDED = "guided"
    """Repositions are flown in it."""
    TAKEOFF = "takeoff"
    RETURN = "return"
    LAND = "land"
    PILOT = "pilot"
    """Somebody's hands are on the sticks."""
    OTHER = "other"
    """Somebody else's plan: a mission, another computer, a mode we do not know."""
