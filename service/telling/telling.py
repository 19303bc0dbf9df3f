"""All who are told, kept up to date with the state of the run."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import time
from collections.abc import Awaitable, Callable, Coroutine, Sequence
from typing import Any, cast

from service.http.run import Unanswered
from service.telling.mqtt import StateTopics
from service.telling.news import Newsdesk
from service.telling.searched import Outline
from service.telling.settings import TellingPlan
from service.telling.tak import TakTeller
from service.telling.webhook import Webhook
from service.view.state import RunState

log = logging.getLogger("roisearch")
EVERY_S, GROUND_EVERY_S = 0.5, 15.0
GOODBYE_S = 6.0
"""How long the last news may take when the run is over."""


class Telling:
    """Asks for the state twice a second, and tells what is new. Nothing in here waits for a receiver."""

    def __init__(self, plan: TellingPlan) -> None:
        self.plan = plan
        self._watch = Newsdesk(plan.run)
        self._hook = None if plan.hook is None else Webhook(plan.hook)
        self._mqtt = None if plan.mqtt is None else StateTopics(plan.mqtt)
        self._tak = None if plan.tak is None else TakTeller(plan.tak, plan.run)
        self._tasks: list[asyncio.Task[None]] = []

    def start(
        self,
        ask: Callable[[], Awaitable[RunState]],
        see: Callable[[], Awaitable[Sequence[Outline]]] | None = None,
    ) -> None:
        """Begin; `ask` gives the state, `see` the ground that was searched."""
        if not self.plan.anybody:
            return
        tellers = [each for each in (self._hook, self._mqtt, self._tak) if each is not None]
        self._tasks = [asyncio.create_task(_kept(type(each).__name__, each.run())) for each in tellers]
        self._tasks.append(asyncio.create_task(_kept("telling", self._follow(ask))))
        if self._tak is not None and see is not None:
            self._tasks.append(asyncio.create_task(_kept("telling", self._outline(self._tak, see))))

    def tell(self, state: RunState) -> None:
        """Hand a state to all."""
        news = self._watch.news(state, time.time())
        if self._hook is not None:
            for each in news:
                self._hook.tell(each)
        if self._mqtt is not None:
            self._mqtt.tell(state, news)
        if self._tak is not None:
            self._tak.tell(state)

    async def end(self, last: dict[str, Any] | None, patience_s: float = GOODBYE_S) -> None:
        """Tell the last state, wait a while until it is out, and stop."""
        if not self._tasks:
            return
        try:
            if last is not None:
                self.tell(cast(RunState, last))
            async with asyncio.timeout(patience_s):
                for each in (self._hook, self._mqtt, self._tak):
                    if each is not None:
                        await each.told()
        except TimeoutError:
            log.warning("not all who are to be told could be told the end within %g s", patience_s)
        finally:
            for task in self._tasks:
                task.cancel()
            await asyncio.wait(self._tasks, timeout=2.0)

    async def _follow(self, ask: Callable[[], Awaitable[RunState]]) -> None:
        while True:
            with contextlib.suppress(
                Unanswered, RuntimeError
            ):  # the flight is behind: a later look sees more
                state = await ask()
                if "suspects" in state:
                    self.tell(state)
            await asyncio.sleep(EVERY_S)

    async def _outline(self, tak: TakTeller, see: Callable[[], Awaitable[Sequence[Outline]]]) -> None:
        while True:
            with contextlib.suppress(Unanswered, RuntimeError):
                tak.show(await see())
            await asyncio.sleep(GROUND_EVERY_S)


async def _kept(name: str, working: Coroutine[None, None, None]) -> None:
    try:
        await working
    except Exception:
        log.exception("%s has failed and is over", name)
