"""The one WebSocket of the page: a scene once, then a moment four times a second, with what has changed.

Whenever the regions of interest have been drawn again, they go out before the moment.

Each watcher has a `Feed` of its own and gets the next moment only when the last one is on its way, so a slow
link gets fewer of them and nothing piles up. A watcher of a replay may say what time to show: {"at": seconds}.
"""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import json
import math
from collections import Counter
from typing import Any

from starlette.websockets import WebSocket, WebSocketDisconnect

from service.http.access import Scope
from service.http.guard import MAY, SUBPROTOCOL, client_of
from service.http.run import PastRun, ShownRun, Unanswered
from service.view.feed import Feed

EVERY_S = 0.25
"""Between two moments for one watcher, of now or of a replay's history, whatever it wishes and however often."""
WISHES_AT_ONCE = 16
MOST_WATCHERS = 32
MOST_OF_ONE = 16
TRY_AGAIN_LATER = 1013  # RFC 6455's registry of close codes


class Watchers:
    """Who watches one run."""

    def __init__(self, run: ShownRun, past: PastRun | None, extra: dict[str, Any]) -> None:
        """`past`: the run, when it is over; `extra`: what else the page has to know at the start."""
        self._run, self._past, self._extra = run, past, extra
        self._watching: Counter[str] = Counter()

    async def serve(self, socket: WebSocket) -> None:
        """Serve one watcher until it leaves."""
        offered = socket.scope.get("subprotocols", [])
        await socket.accept(SUBPROTOCOL if SUBPROTOCOL in offered else None)
        who = client_of(socket.scope)
        if self._watching.total() >= MOST_WATCHERS or self._watching[who] >= MOST_OF_ONE:
            await socket.close(TRY_AGAIN_LATER, "so many pages watch already")
            return
        self._watching[who] += 1
        wish = _Wish()
        listening = asyncio.create_task(wish.listen(socket))
        try:
            with contextlib.suppress(WebSocketDisconnect):
                await self._tell(socket, wish, listening)
        finally:
            self._watching[who] -= 1
            listening.cancel()
            await asyncio.gather(listening, return_exceptions=True)

    async def _tell(self, socket: WebSocket, wish: _Wish, listening: asyncio.Task[None]) -> None:
        may = socket.scope.get(MAY, Scope.COMMAND)
        scene = {"type": "scene", **self._run.scene(), **self._extra, "read_only": may is not Scope.COMMAND}
        drawn = scene["drawn"]
        await socket.send_text(json.dumps(scene, allow_nan=False))
        feed, loop = Feed(self._run.searchable()), asyncio.get_running_loop()
        while not listening.done():
            began, past = loop.time(), self._past
            sight = self._run if wish.at is None or past is None else past.at(wish.at)  # live knows only now
            try:
                moment = await sight.moment()
                if moment.state["drawn"]["number"] != drawn:
                    regions = await sight.regions()
                    drawn = regions["drawn"]
                    await socket.send_text(json.dumps({"type": "regions", **regions}, allow_nan=False))
            except Unanswered:
                await socket.close(TRY_AGAIN_LATER, "the flight does not answer")
                return
            await socket.send_text(json.dumps(feed.message(moment), allow_nan=False))
            await asyncio.wait([listening], timeout=max(0.0, began + EVERY_S - loop.time()))


class _Wish:
    """What a watcher wants to see: now, or a time."""

    def __init__(self) -> None:
        self.at: float | None = None

    async def listen(self, socket: WebSocket) -> None:
        """Take wishes until the watcher leaves; what is not one is passed over."""
        with contextlib.suppress(WebSocketDisconnect, RuntimeError):
            for number in itertools.count(1):
                text = await socket.receive_text()
                with contextlib.suppress(ValueError, TypeError, KeyError, RecursionError, OverflowError):
                    at = json.loads(text)["at"]
                    self.at = float(at) if at is not None and math.isfinite(float(at)) else None
                if number % WISHES_AT_ONCE == 0:
                    await asyncio.sleep(EVERY_S)  # who wishes faster waits: no more is read from its socket
