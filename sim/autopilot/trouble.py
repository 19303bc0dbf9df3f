"""What a bad radio does to one link: silence, loss, doubling, disorder, delay, damage.

Works on whole pieces: a frame on the way out, what one read of the socket gave on the way in. All chance
comes from a generator that is handed in, all times are vehicle time.
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from dataclasses import dataclass

from sim.autopilot.dialect import M

_ACK = int(M.MAVLINK_MSG_ID_COMMAND_ACK)
_MAVLINK1 = 0xFE
_REORDER_S = 0.15  # how late a piece comes that is overtaken


@dataclass(slots=True)
class Trouble:
    """Rates are shares from 0 to 1 of the pieces of either direction; `delay_s` is there for every piece."""

    lost: bool = False
    drop: float = 0.0
    duplicate: float = 0.0
    reorder: float = 0.0
    delay_s: float = 0.0
    corrupt: float = 0.0
    acks_lost: bool = False
    deaf: bool = False  # nothing reaches the vehicle
    mute: bool = False  # nothing it says is carried

    @property
    def any(self) -> bool:
        """Is anything wrong at all?"""
        return self != _NONE


_NONE = Trouble()


class Radio:
    """One direction of a link under a Trouble: pieces go in, later come out, or do not."""

    def __init__(self, trouble: Trouble, source: random.Random, deliver: Callable[[bytes], None]) -> None:
        self.trouble, self._random, self._deliver = trouble, source, deliver
        self._waiting: list[tuple[float, bytes]] = []
        self._free_at = -math.inf  # when what was put in before has come out, but for what is overtaken

    @property
    def busy(self) -> bool:
        """Is something still on its way?"""
        return bool(self._waiting)

    def put(self, piece: bytes, now: float) -> None:
        """Carry one piece."""
        trouble, chance = self.trouble, self._random.random
        if trouble.lost or (trouble.drop and chance() < trouble.drop):
            return
        if trouble.corrupt and chance() < trouble.corrupt:
            where = self._random.randrange(len(piece))
            piece = (
                piece[:where] + bytes([piece[where] ^ (1 + self._random.randrange(255))]) + piece[where + 1 :]
            )
        # a link that is fast again has a queue yet
        due = self._free_at = max(now + trouble.delay_s, self._free_at)
        if trouble.reorder and chance() < trouble.reorder:
            due += _REORDER_S
        for _ in range(2 if trouble.duplicate and chance() < trouble.duplicate else 1):
            if due > now or self._waiting:
                self._waiting.append((due, piece))
            else:
                self._deliver(piece)

    def release(self, now: float) -> None:
        """Deliver what has become due."""
        if self._waiting:
            due = [each for each in self._waiting if each[0] <= now]
            if due:
                self._waiting = [each for each in self._waiting if each[0] > now]
                for _, piece in sorted(due, key=lambda each: each[0]):
                    self._deliver(piece)


def is_ack(frame: bytes) -> bool:
    """Is a frame, of either version, a COMMAND_ACK?"""
    if frame[0] == _MAVLINK1:
        return frame[5] == _ACK
    return len(frame) > 10 and int.from_bytes(frame[7:10], "little") == _ACK
