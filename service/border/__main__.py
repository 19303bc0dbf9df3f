"""The door process: `python -m service.border CHANNEL HELLO`, two file descriptors that it inherits.

It serves strangers until the flight says that it is over, or is gone. Signals are for the flight, which needs its
doors on the way home; the kernel ends this process with its parent, so a killed service leaves no address taken.
"""

from __future__ import annotations

import asyncio
import contextlib
import ctypes
import faulthandler
import gc
import logging
import os
import signal
import socket
import sys
from pathlib import Path
from typing import Any

from service.border.asking import Asking
from service.border.channel import Channel
from service.border.distant import DistantRun
from service.border.hello import Hello
from service.border.memory import SharedMap
from service.outlet import OF_A_TERMINAL, nobody_waits
from service.telling import Telling

BEAT_S = 1.0
_MOST_UNSENT = 1 << 16
_PR_SET_PDEATHSIG = 1
_OOM, _ENDED_FIRST = Path("/proc/self/oom_score_adj"), 500
"""Where memory runs out, the kernel ends this process, which is started again, and not the flight."""
_MOST_CHARACTERS = 4000


class _ToTheFlight(logging.Handler):
    """Log lines are said by the flight, which knows the terminal; what it does not take in time is dropped."""

    def __init__(self, channel: Channel) -> None:
        super().__init__()
        self._channel = channel
        self.setFormatter(logging.Formatter("%(message)s"))

    def emit(self, record: logging.LogRecord) -> None:
        """Send a line."""
        if self._channel.waiting < _MOST_UNSENT:
            text = self.format(record)[:_MOST_CHARACTERS]
            self._channel.send({"note": "log", "level": record.levelno, "text": text})


async def serve(end: socket.socket, hello: Hello) -> None:
    """Serve the doors until the other side of the channel says so, or is gone."""
    channel = await Channel.over(end)
    log = logging.getLogger("roisearch")
    log.handlers, log.propagate = [_ToTheFlight(channel)], False
    log.setLevel(logging.INFO)
    asking = Asking(channel)
    shared = SharedMap(hello.memory, hello.ground.grid.frame.shape)
    run = DistantRun(asking, shared, hello.ground, hello.journal)
    door, doors = hello.doors()
    server = door.server(run)
    serving = asyncio.create_task(server.run_until_told())
    listening = asyncio.create_task(doors.serve(run.submit_all))
    telling = Telling(hello.telling)
    telling.start(run.state, run.searched)
    hearing = asyncio.create_task(_hear(channel, asking))
    beating = asyncio.create_task(_beat(channel))
    try:
        while not server.started and not serving.done():  # noqa: ASYNC110 - uvicorn has nothing to wait for
            await asyncio.sleep(0.01)
        if server.started:
            gc.collect()
            gc.freeze()  # what stays for good is not gone through again and again, which takes a tenth of a second
            channel.send({"note": "open"})
        await asyncio.wait([serving, hearing], return_when=asyncio.FIRST_COMPLETED)
    finally:
        asking.end()
        if hearing.done() and not hearing.cancelled() and hearing.exception() is None:
            await telling.end(hearing.result())
        server.should_exit = True
        for task in (listening, beating):
            task.cancel()
        await asyncio.wait([serving, listening, beating])
        run.end()
        channel.close()
    serving.result()


async def _hear(channel: Channel, asking: Asking) -> dict[str, Any] | None:
    """Take answers in until the flight says that it is over, or is gone; the last state, if it told it."""
    async for message in channel.messages():
        if "answer" in message:
            asking.answered(message)
        elif message.get("note") == "end":
            state = message.get("state")
            return state if isinstance(state, dict) else None
    return None


async def _beat(channel: Channel) -> None:
    """Say that this process is alive."""
    while True:
        channel.send({"note": "beat"})
        await asyncio.sleep(BEAT_S)


def main() -> None:
    """Serve the doors that the first two arguments describe."""
    if sys.stderr is not None:
        faulthandler.enable()
    parent = os.getppid()
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    with contextlib.suppress(OSError):
        _OOM.write_text(str(_ENDED_FIRST))
    for number in (signal.SIGINT, signal.SIGTERM, *OF_A_TERMINAL):
        signal.signal(number, signal.SIG_IGN)
    end = socket.socket(fileno=int(sys.argv[1]))
    hello = Hello.read(int(sys.argv[2]))
    if os.getppid() == parent:  # else it died before the kernel knew that we go with it
        with nobody_waits():
            asyncio.run(serve(end, hello))


if __name__ == "__main__":
    main()
