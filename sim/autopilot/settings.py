"""What one mock autopilot is told when it boots."""

from __future__ import annotations

from dataclasses import dataclass, field

from sim.autopilot.ground import Flat, Ground

STEP_S = 0.02  # vehicle time of one step of the physics, whatever the speed-up


@dataclass(frozen=True, slots=True)
class Settings:
    """The vehicle and its world; every field has the default of `roisearch-sim autopilot`."""

    flavor: str = "px4"  # "px4" or "ardupilot"
    home: tuple[float, float, float] = (47.397742, 8.545594, 489.0)  # latitude, longitude, metres AMSL
    sysid: int = 1
    seed: int = 0
    heading_deg: float = 0.0
    speedup: float = 1.0
    ready_after_s: float = 15.0  # boot until the pre-arm check is healthy
    endurance_s: float = 35.0 * 60.0  # hovering, from full to empty
    wind_mps: tuple[float, float] = (0.0, 0.0)  # air moves towards north, east
    gust_mps: float = 0.0  # standard deviation of the gusts on top
    ground: Ground = field(default_factory=Flat)
    rangefinder: bool = False  # a lidar that looks down
    swap_battery_s: float | None = None  # disarmed for so long it gets a full one, which starts it again
    epoch_s: float = 1_800_000_000.0  # time of day at boot, seconds since 1970
