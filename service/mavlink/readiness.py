"""When the vehicle can be armed.

The sign is MAV_SYS_STATUS_PREARM_CHECK in SYS_STATUS.health (PX4 sets it in health only). ArduCopter was seen
to report it healthy 18 seconds before it had a position, so it is believed only once it has stayed set for a
while, no text has said otherwise in that time, and position, home and a 3D fix are there.
"""

from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.mavlink.settings import MavlinkSettings
from service.mavlink.telemetry import Telemetry

_STATUS_FRESH_S = 5.0


class Readiness:
    """Since when the pre-arm check has been healthy."""

    def __init__(self, settings: MavlinkSettings) -> None:
        self._hold_s = settings.ready_hold_s
        self._fresh_s = max(_STATUS_FRESH_S, settings.link_lost_s)
        self._since: float | None = None

    def on_status(self, prearm_ok: bool, now: float) -> None:
        """A SYS_STATUS has arrived."""
        if not prearm_ok:
            self._since = None
        elif self._since is None:
            self._since = now

    def on_complaint(self, now: float) -> None:
        """A text says that the vehicle cannot be armed: whatever the bit says, wait anew."""
        if self._since is not None:
            self._since = now

    def forget(self) -> None:
        """The vehicle has rebooted."""
        self._since = None

    def ready(self, telemetry: Telemetry, now: float) -> bool:
        """Whether to believe it now."""
        return (
            self._since is not None
            and now - self._since >= self._hold_s
            and now - telemetry.status_time <= self._fresh_s
            and telemetry.position_known
            and telemetry.home is not None
            and telemetry.fix >= mavlink.GPS_FIX_TYPE_3D_FIX
        )
