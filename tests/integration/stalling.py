"""The service with switches, run with `python -m`: its event loop stands still for five seconds at SIGUSR1, there is a
mistake in its mission from SIGUSR2 on, nobody reads what it says from SIGRTMIN on, and its terminal is gone from
SIGRTMIN + 1 on."""

import contextlib
import os
import signal
import sys
import time
from types import FrameType

from service.cli import main
from service.mission.core import MissionCore
from service.mission.effects import Effect
from service.mission.situation import Situation

STALL_S = 5.0


def stand_still(number: int, frame: FrameType | None) -> None:
    """A signal's handler runs in the thread of the event loop, and only there: the other threads go on."""
    os.write(1, b"standing still\n")
    time.sleep(STALL_S)


def go_wrong(number: int, frame: FrameType | None) -> None:
    """From now on the mission runs into a mistake that nobody has thought of."""

    def tick(self: MissionCore, seen: Situation, now: float) -> list[Effect]:
        raise ZeroDivisionError("a mistake")

    MissionCore.tick = tick  # type: ignore[method-assign]


def unread(number: int, frame: FrameType | None) -> None:
    """Both outputs become a pipe that is full, and that nobody ever reads."""
    os.write(1, b"nobody reads on\n")
    _, end = os.pipe()
    os.set_blocking(end, False)
    with contextlib.suppress(BlockingIOError):
        while True:
            os.write(end, bytes(4096))
    os.set_blocking(end, True)
    for output in (1, 2):
        os.dup2(end, output)


def hung_up(number: int, frame: FrameType | None) -> None:
    """Both outputs become a terminal that nobody has open any more."""
    os.write(1, b"hung up\n")
    other, terminal = os.openpty()
    os.close(other)
    for output in (1, 2):
        os.dup2(terminal, output)


if __name__ == "__main__":
    signal.signal(signal.SIGUSR1, stand_still)
    signal.signal(signal.SIGUSR2, go_wrong)
    signal.signal(signal.SIGRTMIN, unread)
    signal.signal(signal.SIGRTMIN + 1, hung_up)
    sys.exit(main())
