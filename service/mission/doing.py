"""Actions that take time, but for waypoints, carried out with the vehicle."""

from __future__ import annotations

from service.mavlink import Vehicle
from service.mission.effects import (
    Action,
    Arm,
    Connect,
    EnterGuided,
    Land,
    ReturnToLaunch,
    SetSpeed,
    TakeOff,
    WaitReady,
)
from service.mission.news import Done


async def do(action: Action, vehicle: Vehicle, patience_s: float) -> Done:
    """Carry out an action; returns when the autopilot has confirmed it. Raises LinkError.

    `patience_s`: how long to wait for an aircraft that is not there, or not ready, yet.
    """
    match action:
        case Connect():
            await vehicle.connect(patience_s)
        case WaitReady():
            await vehicle.wait_ready(patience_s)
        case EnterGuided(there=there, out_of=mode):
            await vehicle.enter_guided(there=there, out_of=mode)
        case Arm():
            await vehicle.arm()
        case TakeOff(height_m=height):
            await vehicle.take_off(height)
        case SetSpeed(speed_mps=speed):
            await vehicle.set_speed(speed)
        case ReturnToLaunch():
            await vehicle.return_to_launch()
        case Land():
            await vehicle.land()
    return Done(action)
