"""Keeps a door process running beside the flight: starts it, answers it, and starts it again when it ends."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import os
import signal
import socket
import sys
from asyncio.subprocess import DEVNULL, Process
from collections.abc import AsyncIterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from service.border.channel import Channel
from service.border.counter import Counter, FlownRun
from service.border.frames import Broken
from service.border.hello import Hello
from service.border.memory import SharedMap
from service.doors import Doors
from service.http import Door
from service.telling import TellingPlan
from service.view.scene import SearchGround
from service.view.state import RunState

log = logging.getLogger("roisearch")
OPEN_S = 120.0
"""How long the process may take to open: it imports much, and the machine may be busy compiling."""
SILENT_BEATS = 15
"""After so many seconds without a sign of life the process is ended, and another is started."""
LONGEST_PAUSE_S = 10.0
END_S = 12.0
"""How long a door process may take to say goodbye, to whoever is connected and whoever is to be told."""
NOBODY = TellingPlan()


@contextlib.asynccontextmanager
async def serving(
    door: Door,
    doors: Doors,
    run: FlownRun,
    ground: SearchGround,
    journal: Path,
    telling: TellingPlan = NOBODY,
) -> AsyncIterator[None]:
    """Serve strangers in a process of their own until the block ends; it has opened when the block begins.

    Raises RuntimeError when it does not open.
    """
    shared = SharedMap.create(ground.grid.frame.shape)
    hello = Hello.of(door, doors, replace(telling, run=journal.parent.name), ground, journal, shared.file)
    try:
        first = await _Doorkeeper.start(hello, run, shared)
        keeping = asyncio.create_task(_keep(first, hello, run, shared))
        try:
            yield
        finally:
            keeping.cancel()
            await asyncio.wait([keeping])
    finally:
        os.close(shared.file)


async def _keep(keeper: _Doorkeeper, hello: Hello, run: FlownRun, shared: SharedMap) -> None:
    """Start another process whenever one ends, after a pause that grows, until cancelled."""
    pause_s = 0.5
    while True:
        try:
            why = await keeper.ended()
        except asyncio.CancelledError:
            await keeper.end()
            raise
        log.error("the door process has ended (%s): it is started again, and the flight goes on", why)
        while True:
            await asyncio.sleep(pause_s)
            pause_s = min(2.0 * pause_s, LONGEST_PAUSE_S)
            try:
                keeper = await _Doorkeeper.start(hello, run, shared)
            except RuntimeError as error:
                log.error("%s: trying again", error)
            else:
                log.info("the doors are open again")
                break


class _Doorkeeper:
    """One door process, and the answers it gets."""

    def __init__(
        self, process: Process, channel: Channel, run: FlownRun, shared: SharedMap, tells: bool
    ) -> None:
        self._process, self._channel, self._run, self._tells = process, channel, run, tells
        self._counter = Counter(run, shared, channel.send)
        self._open = asyncio.Event()
        self._silent = 0
        self._why = ""
        self._talking = asyncio.create_task(self._talk())

    @classmethod
    async def start(cls, hello: Hello, run: FlownRun, shared: SharedMap) -> _Doorkeeper:
        """Start a process and wait until it has opened. Raises RuntimeError when it does not."""
        ours, theirs = socket.socketpair()
        file = hello.write()
        ours.setblocking(False)
        # no token of ours goes along: the process needs none
        environment = {name: value for name, value in os.environ.items() if not name.startswith("ROISEARCH_")}
        with theirs:
            try:
                process = await asyncio.create_subprocess_exec(
                    sys.executable,
                    "-m",
                    "service.border",
                    str(theirs.fileno()),
                    str(file),
                    pass_fds=[theirs.fileno(), file, *hello.inherited],
                    env=environment,
                    stdin=DEVNULL,
                    # Ctrl-C is for the flight, which needs its doors on the way home. No session of its own: that
                    # is a group by itself to the kernel's scheduler, and waited up to a second for a busy core
                    process_group=0,
                )
            finally:
                os.close(file)
        keeper = cls(process, await Channel.over(ours), run, shared, hello.telling.anybody)
        try:
            await keeper._opened()
        except BaseException:
            await keeper.end()
            raise
        return keeper

    async def _opened(self) -> None:
        waits = {asyncio.create_task(self._open.wait()), asyncio.create_task(self._process.wait())}
        try:
            await asyncio.wait(waits, timeout=OPEN_S, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for wait in waits:
                wait.cancel()
        if not self._open.is_set():
            code = self._process.returncode
            why = f"it has ended, {_how(code)}" if code is not None else f"it took longer than {OPEN_S:g} s"
            raise RuntimeError(f"the doors could not be opened ({why})")

    async def ended(self) -> str:
        """Wait until the process ends, or says nothing for long and is ended; returns why."""
        waiting = asyncio.create_task(self._process.wait())
        try:
            while not waiting.done():
                await asyncio.wait([waiting, self._talking], timeout=1.0, return_when=asyncio.FIRST_COMPLETED)
                self._silent += 1
                if self._silent > SILENT_BEATS:
                    self._why = f"no sign of life for {SILENT_BEATS} s"
                if self._talking.done():  # it is ending: how, is told by the process itself
                    await asyncio.wait([waiting], timeout=END_S)
                if self._why or self._talking.done():
                    self._kill()
                    await waiting
        finally:
            waiting.cancel()
        self._channel.close()
        return self._why or _how(self._process.returncode)

    async def end(self) -> None:
        """Let the process say goodbye to whoever is connected, and be gone."""
        await self._counter.last_look()
        self._channel.send({"note": "end", "state": self._last_state()})
        try:
            async with asyncio.timeout(END_S):
                await self._process.wait()
        except TimeoutError:
            self._kill()
            await self._process.wait()
        self._talking.cancel()
        await asyncio.wait([self._talking])
        self._channel.close()

    def _kill(self) -> None:
        """End it at once. Not by asyncio's own `kill`, which reaps a process that has just ended, and then nobody knows
        how it did."""
        if self._process.returncode is None:
            with contextlib.suppress(ProcessLookupError):
                os.kill(self._process.pid, signal.SIGKILL)

    def _last_state(self) -> RunState | None:
        """How it has ended, for those who are told; the flight is over, and nothing of it may fail for them."""
        try:
            return self._run.state() if self._tells else None
        except Exception:
            log.exception("the end cannot be told")
            return None

    async def _talk(self) -> None:
        """Answer what is asked, until the process is gone."""
        try:
            async for message in self._channel.messages():
                self._silent = 0
                if "ask" in message:
                    self._counter.take(message)
                else:
                    self._note(message)
        except Broken as error:
            self._why = str(error)

    def _note(self, message: dict[str, Any]) -> None:
        if message.get("note") == "open":
            self._open.set()
        elif message.get("note") == "log":
            level = message.get("level")
            log.log(level if isinstance(level, int) else logging.WARNING, "%s", message.get("text"))


def _how(code: int | None) -> str:
    """How a process ended, in words."""
    if code is not None and code < 0:
        with contextlib.suppress(ValueError):
            return f"by {signal.Signals(-code).name}"
    return f"exit code {code}"
