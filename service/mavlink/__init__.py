"""The MAVLink link to the aircraft.

`vehicle.Vehicle` is what the rest of the service uses. Behind it are `core` (the protocol, without sockets
and without a clock of its own), `transports` (the wires), and `autopilots` (what differs between PX4 and
ArduPilot).
"""

from service.mavlink.errors import CommandFailed, LinkError, NotPermitted, NoVehicle
from service.mavlink.history import Pose, PoseHistory
from service.mavlink.modes import ModeKind
from service.mavlink.settings import LinkSettings
from service.mavlink.signing import read_signing_key
from service.mavlink.telemetry import Home, Telemetry, Wind
from service.mavlink.vehicle import Vehicle

__all__ = [
    "CommandFailed",
    "Home",
    "LinkError",
    "LinkSettings",
    "ModeKind",
    "NoVehicle",
    "NotPermitted",
    "Pose",
    "PoseHistory",
    "Telemetry",
    "Vehicle",
    "Wind",
    "read_signing_key",
]
