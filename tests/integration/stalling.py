"""The service, with an event loop that stands still for five seconds at SIGUSR1; run it with `python -m`."""

import signal
import sys
import time
from types import FrameType

from service.cli import main

STALL_S = 5.0


def stand_still(number: int, frame: FrameType | None) -> None:
    """A signal's handler runs in the thread of the event loop, and only there: the other threads go on."""
    print("standing still", flush=True)
    time.sleep(STALL_S)


if __name__ == "__main__":
    signal.signal(signal.SIGUSR1, stand_still)
    sys.exit(main())
