"""When the aircraft is not ours to fly any more: what the pilot or the autopilot did that nobody here asked for."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

from service.geometry import LatLon
from service.mavlink.events import (
    ArmedChanged,
    ModeChanged,
    Rebooted,
    StatusText,
    TargetReplaced,
    VehicleEvent,
)
from service.mavlink.modes import mode_title

_WARNING = 4  # MAV_SEVERITY: what the autopilot says at this level or worse explains its failsafe
_MEMORY_S = 10.0


class Takeovers:
    """Reads the vehicle's events and says which of them take the aircraft away."""

    def __init__(self) -> None:
        self._texts: deque[StatusText] = deque(maxlen=6)
        self._taken_at: deque[float] = deque(maxlen=6)

    def read(self, event: VehicleEvent, *, landing: bool, written: Callable[[LatLon], str]) -> str:
        """Why the aircraft is not ours any more after this event, for a person; nothing when it still is.

        `landing`: it is on its way home, where it disarms by itself. `written`: a place as the team writes places.
        """
        if isinstance(event, StatusText) and event.severity <= _WARNING:
            self._texts.append(event)
        if isinstance(event, ModeChanged) and not event.commanded:
            self._taken_at.append(event.time)
            who = "the autopilot's failsafe" if event.failsafe else "the pilot or the autopilot"
            return f"{who} selected {mode_title(event.mode)}{self.said(event.time)}"
        if isinstance(event, TargetReplaced):
            if event.found is None:
                return f"{event.by} commands the aircraft"
            return f"{event.by} sends the aircraft to {written((event.found.lat, event.found.lon))}"
        if isinstance(event, Rebooted):
            return "the autopilot has rebooted"
        if isinstance(event, ArmedChanged) and not event.armed and not landing:
            return "the aircraft has disarmed"
        return ""

    def said(self, since: float) -> str:
        """What the autopilot said around the changes of mode that we did not ask for, from a time on, in brackets.

        Around all of them: a failsafe whose words come after it is followed by the mode of an aircraft that has landed.
        """
        taken = [at for at in self._taken_at if at > since - _MEMORY_S]
        said = [text.text for text in self._texts if any(abs(text.time - at) < _MEMORY_S for at in taken)]
        return f" ({'; '.join(said)})" if said else ""
