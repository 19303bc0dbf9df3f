"""The door process's way to ask the flight: a question, a number, an answer with that number."""

from __future__ import annotations

import asyncio
import itertools
from typing import Any

from service.border.channel import Channel
from service.errors import BadInput
from service.http.run import Unanswered
from service.journal import JournalLost

LOOK_S = 5.0
"""How long a look may take before the door says that nobody answers."""
DEED_S = 60.0
"""How long reports and orders may: a slow disk takes its time, and it is done all the same."""
_ENDING = "the service is ending"


class Asking:
    """Questions under way over a channel."""

    def __init__(self, channel: Channel) -> None:
        self._channel = channel
        self._numbers = itertools.count(1)
        self._open: dict[int, asyncio.Future[dict[str, Any]]] = {}
        self._ended = False

    async def ask(self, what: str, patience_s: float, **more: Any) -> dict[str, Any]:
        """Ask and wait. Raises Unanswered, JournalLost, or RuntimeError when the flight could not do it."""
        if self._ended:
            raise Unanswered(_ENDING)
        number = next(self._numbers)
        answer = self._open[number] = asyncio.get_running_loop().create_future()
        try:
            self._channel.send({"ask": number, "what": what, **more})
            async with asyncio.timeout(patience_s):
                said: dict[str, Any] = await answer
        except TimeoutError:
            raise Unanswered(f"the flight has not answered for {patience_s:g} s") from None
        finally:
            del self._open[number]
        if "error" not in said:
            return said
        kinds = {"journal": JournalLost, "busy": Unanswered, "bad": BadInput}
        raise kinds.get(said.get("kind", ""), RuntimeError)(said["error"])

    def answered(self, message: dict[str, Any]) -> None:
        """Take an answer in; one that nobody waits for any more is dropped."""
        waiting = self._open.get(message["answer"])
        if waiting is not None and not waiting.done():
            waiting.set_result(message)

    def end(self) -> None:
        """The flight is gone: nobody will answer, neither now nor later."""
        self._ended = True
        for waiting in self._open.values():
            if not waiting.done():
                waiting.set_exception(Unanswered(_ENDING))
