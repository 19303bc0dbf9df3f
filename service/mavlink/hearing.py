"""Whether the vehicle hears us and in what version of MAVLink, and what it lacks: found out before the ground is left.

MAVLink 2 is spoken first, as PX4 changes over to it when it hears it. A vehicle that goes on speaking MAVLink 1, and
answers nothing, is spoken to in MAVLink 1. Whoever has answered a single command hears us.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

_PATIENCE_S = 6.0
_NEEDED = {
    "GLOBAL_POSITION_INT": "where it is",
    "EXTENDED_SYS_STATE": "whether it is in the air",
    "SYS_STATUS": "its battery and its health",
}


class Hearing:
    """What is known of the way from us to the vehicle."""

    def __init__(self) -> None:
        self._since = math.inf
        self._answered = False
        self._spoke_v2 = False

    def began(self, now: float) -> None:
        """The vehicle was heard for the first time."""
        self._since = now

    def on_message(self, *, v2: bool) -> None:
        """A message of it came, in MAVLink 2 or 1."""
        self._spoke_v2 |= v2

    def on_answer(self) -> None:
        """It has answered a command."""
        self._answered = True

    def wants_v1(self, now: float) -> bool:
        """Whether to speak MAVLink 1 to it: it speaks nothing else, and has not answered."""
        return not self._spoke_v2 and not self._answered and now - self._since > _PATIENCE_S

    def missing(self, told: Mapping[str, float]) -> list[str]:
        """What must be there before the ground is left, and is not: sentences' ends."""
        lacks = [f"it does not tell {what} ({name})" for name, what in _NEEDED.items() if name not in told]
        if not self._answered:
            lacks.insert(0, "it answers nothing that is sent to it: the link may carry only one way")
        return lacks
