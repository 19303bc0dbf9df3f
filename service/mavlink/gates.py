"""The gates that everything which moves the aircraft passes, right before it is sent.

Each returns the reason why not, as a sentence's end, or None. They are pure: what is known, and the time.
"""

from __future__ import annotations

import math

from service.mavlink.autopilots.base import Autopilot
from service.mavlink.events import Target
from service.mavlink.modes import mode_title
from service.mavlink.settings import MavlinkSettings
from service.mavlink.target import distance_m
from service.mavlink.telemetry import Telemetry

_AFTER_STALL_S = 0.25


def why_not_command(
    autopilot: Autopilot | None,
    telemetry: Telemetry,
    settings: MavlinkSettings,
    *,
    now: float,
    stalled_at: float,
    ordered: bool,
) -> str | None:
    """Why nothing that moves the aircraft may be sent now.

    Args:
        stalled_at: when our process last woke from standing still. What was received at that moment had been
            waiting in a buffer and may be as old as the pause, so a later heartbeat is wanted.
        ordered: an operator has just ordered it, so control need not be ours yet.
    """
    if autopilot is None:
        return "no vehicle has been heard"
    age = now - telemetry.heartbeat_time
    if age > settings.heartbeat_fresh_s:
        return f"the vehicle has not been heard for {age:.1f} s"
    if telemetry.heartbeat_time < stalled_at + _AFTER_STALL_S:
        return "the service stood still and has not heard the vehicle since"
    if not ordered and not telemetry.in_control:
        return telemetry.control_reason
    return None


def why_not_guided(autopilot: Autopilot, telemetry: Telemetry) -> str | None:
    """Why no target would be flown in this mode."""
    if telemetry.guided:
        return None
    return f"the mode is {mode_title(telemetry.mode)}, not {autopilot.guided_title}"


def why_not_flying(telemetry: Telemetry, settings: MavlinkSettings, *, now: float) -> str | None:
    """Why this is not an aircraft in the air at a known place."""
    if not telemetry.armed:
        return "the aircraft is not armed"
    if telemetry.landed_state != "in_air":
        return f"the aircraft is not in the air but says {telemetry.landed_state!r}"
    if now - telemetry.position_time > settings.position_fresh_s:
        return "the position of the aircraft is not known or too old"
    return None


def why_not_there(telemetry: Telemetry, settings: MavlinkSettings, target: Target) -> str | None:
    """Why this is not a place to fly to. PX4 accepts latitude 95, 0/0, and 5 km under the ground."""
    lat, lon, alt = target.lat, target.lon, target.alt_amsl_m
    if not (math.isfinite(lat) and math.isfinite(lon) and math.isfinite(alt)):
        return f"latitude {lat}, longitude {lon}, altitude {alt} m is not a place"
    if not (abs(lat) <= 90.0 and abs(lon) <= 180.0):
        return f"latitude {lat:.7f}, longitude {lon:.7f} is not on earth"
    away = distance_m(Target(telemetry.lat, telemetry.lon, telemetry.alt_amsl_m), target)
    if not away <= settings.max_hop_m:
        return f"it is {away:.0f} m away, and {settings.max_hop_m:g} m is the most"
    climb = alt - telemetry.alt_amsl_m
    if not abs(climb) <= settings.max_height_change_m:
        return (
            f"its altitude of {alt:.0f} m above sea level is {climb:+.0f} m from the aircraft's, "
            f"and {settings.max_height_change_m:g} m is the most"
        )
    return None
