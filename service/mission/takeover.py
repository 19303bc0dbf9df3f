"""When the aircraft is not ours to fly any more: what the pilot or the autopilot did that nobody here asked for."""

from __future__ import annotations

import math
from collections import deque

from service.mavlink.events import ArmedChanged, ModeChanged, Rebooted, StatusText, VehicleEvent

_WARNING = 4  # MAV_SEVERITY: what the autopilot says at this level or worse explains its failsafe
_MEMORY_S = 10.0


class Takeovers:
    """Reads the vehicle's events and says which of them take the aircraft away."""

    def __init__(self) -> None:
        self._texts: deque[StatusText] = deque(maxlen=6)
        self._taken_at = math.inf

    def read(self, event: VehicleEvent, *, landing: bool) -> str:
        """Why the aircraft is not ours any more after this event, for a person; nothing when it still is.

        `landing`: it is on its way home, where it disarms by itself.
        """
        if isinstance(event, StatusText) and event.severity <= _WARNING:
            self._texts.append(event)
        if isinstance(event, ModeChanged) and not event.commanded:
            self._taken_at = event.time
            who = "the autopilot's failsafe" if event.failsafe else "the pilot or the autopilot"
            return f"{who} selected {event.mode}{self.said()}"
        if isinstance(event, Rebooted):
            return "the autopilot has rebooted"
        if isinstance(event, ArmedChanged) and not event.armed and not landing:
            return "the aircraft has disarmed"
        return ""

    def said(self) -> str:
        """What the autopilot said around the last change of mode that we did not ask for, in brackets."""
        said = [text.text for text in self._texts if abs(text.time - self._taken_at) < _MEMORY_S]
        return f" ({'; '.join(said)})" if said else ""
