"""What the services of a mock see of it, so that none of them needs the whole: a vehicle with a mind, and its lines.

`core.Autopilot` is the host and `link.Link` a line. The telemetry, the protocols and the faults are written against
these two, and the core puts all together.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from typing import Any, Protocol

from sim.autopilot.commands import Result
from sim.autopilot.firmware import Firmware
from sim.autopilot.settings import Settings
from sim.autopilot.trouble import Trouble
from sim.autopilot.vehicle import Vehicle
from sim.autopilot.voice import Voice


class Line(Protocol):
    """One connection of a mock."""

    def send(self, message: Any) -> None:
        """Say something."""

    def send_as(self, message: Any, system: int, component: int) -> None:
        """Carry what somebody else says on the same wire."""

    def interval_us(self, number: int) -> int:
        """Interval of a message in microseconds, -1 when it is off."""

    def set_interval(self, number: int, interval_us: int) -> None:
        """Send a message at an interval from now on; 0 is the flavour's default, below 0 is off."""

    def shake(self) -> None:
        """Use the radio while there is trouble."""


class Host(Protocol):
    """One mock autopilot."""

    settings: Settings
    firmware: Firmware
    vehicle: Vehicle
    trouble: Trouble  # of the radio
    chance: random.Random  # what is drawn for faults
    voice: Voice  # what its own messages go through
    frozen: bool  # a fault: only the heart still beats
    old_wire: bool  # a fault: it speaks MAVLink 1
    unknown_messages: set[int]  # a fault: ids that it does not know
    refusals: dict[int, tuple[Result, str]]  # a fault: commands it does not obey, its answer and what it says
    steps: int  # since the first boot

    @property
    def links(self) -> Sequence[Line]:
        """Its connections."""

    @property
    def clock(self) -> float:
        """Seconds since the first boot."""

    @property
    def time_ms(self) -> int:
        """Vehicle time since boot, milliseconds."""

    def take(self, link: Any, data: bytes) -> None:
        """Obey bytes that have made it through the radio."""

    def broadcast(self, message: Any) -> None:
        """Say something on every line."""

    def announce_current(self) -> None:
        """Tell every line the current mission item."""

    def reboot(self) -> None:
        """Start again, as after a brown-out."""

    def later(self, seconds: float, act: Callable[[], None]) -> None:
        """Do something after some seconds."""


Handler = Callable[[Line, Any], None]
"""Takes a message that came on a line: (line, message)."""
