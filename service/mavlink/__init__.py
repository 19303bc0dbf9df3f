"""The MAVLink link to the aircraft.

`vehicle.Vehicle` is what the rest of the service uses. Behind it are `core` (the protocol, without sockets
and without a clock of its own), `transports` (the wires), and `autopilots` (what differs between PX4 and
ArduPilot).
"""

from service.mavlink.checking import check_links
from service.mavlink.errors import CommandFailed, LinkError, NotAnswered, NotPermitted, NoVehicle
from service.mavlink.events import Home
from service.mavlink.history import PastPose, PoseHistory
from service.mavlink.modes import ModeKind
from service.mavlink.settings import MavlinkSettings
from service.mavlink.signing import read_signing_key
from service.mavlink.telemetry import Telemetry, Wind
from service.mavlink.vehicle import Vehicle

__all__ = [
    "CommandFailed",
    "Home",
    "LinkError",
    "MavlinkSettings",
    "ModeKind",
    "NoVehicle",
    "NotAnswered",
    "NotPermitted",
    "PastPose",
    "PoseHistory",
    "Telemetry",
    "Vehicle",
    "Wind",
    "check_links",
    "read_signing_key",
]
