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


BY_ITSELF = frozenset({ModeKind.TAKEOFF, ModeKind.RETURN, ModeKind.LAND})
"""What an autopilot flies by itself once it was ordered to, whatever waypoint it is sent."""

_TITLES = {
    "MANUAL": "Manual",
    "ALTCTL": "Altitude",
    "POSCTL": "Position",
    "ACRO": "Acro",
    "OFFBOARD": "Offboard",
    "STABILIZED": "Stabilized",
    "RATTITUDE": "Rattitude",
    "AUTO_READY": "Ready",
    "AUTO_TAKEOFF": "Takeoff",
    "AUTO_LOITER": "Hold",
    "AUTO_MISSION": "Mission",
    "AUTO_RTL": "Return",
    "AUTO_LAND": "Land",
    "AUTO_FOLLOW": "Follow Me",
    "AUTO_PRECLAND": "Precision Land",
    "AUTO_VTOL_TAKEOFF": "VTOL Takeoff",
}


def mode_title(mode: str) -> str:
    """What a ground station calls a mode. PX4's names are its own only in its code; ArduPilot's are what pilots say."""
    return _TITLES.get(mode, mode)
