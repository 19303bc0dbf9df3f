"""Commands as values: what a COMMAND_LONG or COMMAND_INT asks for, whichever way it came."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntEnum
from typing import Any

from sim.autopilot.dialect import INT32_MAX, M


class Result(IntEnum):
    """MAV_RESULT."""

    ACCEPTED = 0
    TEMPORARILY_REJECTED = 1
    DENIED = 2
    UNSUPPORTED = 3
    FAILED = 4


Results = tuple[Result, ...]  # the acknowledgements sent, in order; empty is silence

ACCEPTED: Results = (Result.ACCEPTED,)
REJECTED: Results = (Result.TEMPORARILY_REJECTED,)
DENIED: Results = (Result.DENIED,)
UNSUPPORTED: Results = (Result.UNSUPPORTED,)
FAILED: Results = (Result.FAILED,)


def whole(value: float) -> int:
    """A parameter that means a whole number; 0 where it is none."""
    return int(value) if math.isfinite(value) else 0


@dataclass(frozen=True, slots=True)
class ReceivedCommand:
    """One command. `frame` is None when it came as COMMAND_LONG, whose place is in degrees."""

    number: int
    param1: float
    param2: float
    param3: float
    param4: float
    x: float
    y: float
    z: float
    frame: int | None

    @staticmethod
    def of(message: Any) -> ReceivedCommand:
        """The command in a COMMAND_LONG or COMMAND_INT message."""
        if message.get_msgId() == M.MAVLINK_MSG_ID_COMMAND_INT:
            place = (message.x, message.y, message.z, message.frame)
        else:
            place = (message.param5, message.param6, message.param7, None)
        return ReceivedCommand(
            message.command, message.param1, message.param2, message.param3, message.param4, *place
        )

    @property
    def place_e7(self) -> tuple[float, float] | None:
        """Latitude and longitude in 1e-7 degrees; None when it says "here" (NaN, or INT32_MAX)."""
        if self.frame is None:
            is_place = math.isfinite(self.x) and math.isfinite(self.y)
            return (self.x * 1e7, self.y * 1e7) if is_place else None
        return None if self.x == INT32_MAX or self.y == INT32_MAX else (self.x, self.y)
