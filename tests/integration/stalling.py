"""The service with two switches, run with `python -m`: its event loop stands still for five seconds at SIGUSR1, and
there is a mistake in its mission from SIGUSR2 on."""

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
    print("standing still", flush=True)
    time.sleep(STALL_S)


def go_wrong(number: int, frame: FrameType | None) -> None:
    """From now on the mission runs into a mistake that nobody has thought of."""

    def tick(self: MissionCore, seen: Situation, now: float) -> list[Effect]:
        raise ZeroDivisionError("a mistake")

    MissionCore.tick = tick  # type: ignore[method-assign]


if __name__ == "__main__":
    signal.signal(signal.SIGUSR1, stand_still)
    signal.signal(signal.SIGUSR2, go_wrong)
    sys.exit(main())
