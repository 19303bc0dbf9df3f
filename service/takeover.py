"""When the aircraft is not ours to fly any more: what the pilot or the autopilot did that nobody here asked for."""

from __future__ import annotations

from collections import deque

from service.mavlink.events import ArmedChanged, ModeChanged, Rebooted, StatusText, VehicleEvent

_WARNING = 4  # MAV_SEVERITY: what the autopilot says at this level or worse explains its failsafe
_MEMORY_S = 10.0


class Takeovers:
    """Reads the vehicle's events and says which of them take the aircraft away."""

    def __init__(self) -> None:
        self._texts: deque[StatusText] = deque(maxlen=3)

    def read(self, event: VehicleEvent, *, landing: bool) -> str:
        """Why the aircraft is not ours any more after this event, for a person; nothing when it still is.

        `landing`: it is on its way home, where it disarms by itself.
        """
        if isinstance(event, StatusText) and event.severity <= _WARNING:
            self._texts.append(event)
        if isinstance(event, ModeChanged) and not event.commanded:
            if not event.failsafe:
                return f"the pilot or the autopilot selected {event.mode}"
            said = [text.text for text in self._texts if event.time - text.time < _MEMORY_S]
            return f"the autopilot's failsafe selected {event.mode}" + (
                f" ({'; '.join(said)})" if said else ""
            )
        if isinstance(event, Rebooted):
            return "the autopilot has rebooted"
        if isinstance(event, ArmedChanged) and not event.armed and not landing:
            return "the aircraft has disarmed"
        return ""
