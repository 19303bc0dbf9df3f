"""The one WebSocket of the page: a scene once, then a moment four times a second, with what has changed.

Each watcher has a `Feed` of its own and gets the next moment only when the last one is on its way, so a slow
link gets fewer of them and nothing piles up. A watcher of a replay may say what time to show: {"at": seconds}.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import math
from typing import Any

from starlette.websockets import WebSocket, WebSocketDisconnect

from service.http.guard import SUBPROTOCOL
from service.http.run import Run
from service.view.feed import Feed

EVERY_S = 0.25
MOST_WATCHERS = 32
TRY_AGAIN_LATER = 1013  # RFC 6455's registry of close codes


class Watchers:
    """Who watches one run."""

    def __init__(self, run: Run, extra: dict[str, Any]) -> None:
        """`extra`: what else the page has to know at the start."""
        self._run, self._extra = run, extra
        self._count = 0

    async def serve(self, socket: WebSocket) -> None:
        """Serve one watcher until it leaves."""
        offered = socket.scope.get("subprotocols", [])
        await socket.accept(SUBPROTOCOL if SUBPROTOCOL in offered else None)
        if self._count >= MOST_WATCHERS:
            await socket.close(TRY_AGAIN_LATER, f"{MOST_WATCHERS} pages watch already")
            return
        self._count += 1
        wish = _Wish()
        listening = asyncio.create_task(wish.listen(socket))
        try:
            with contextlib.suppress(WebSocketDisconnect):
                await self._tell(socket, wish, listening)
        finally:
            self._count -= 1
            listening.cancel()
            await asyncio.gather(listening, return_exceptions=True)

    async def _tell(self, socket: WebSocket, wish: _Wish, listening: asyncio.Task[None]) -> None:
        scene = {"type": "scene", **self._run.scene(), **self._extra}
        await socket.send_text(json.dumps(scene, allow_nan=False))
        feed = Feed(self._run.searchable())
        while not listening.done():
            wish.changed.clear()
            moment = self._run.moment() if wish.at is None else await self._run.moment_at(wish.at)
            await socket.send_text(json.dumps(feed.message(moment), allow_nan=False))
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(EVERY_S):
                    await wish.changed.wait()


class _Wish:
    """What a watcher wants to see: now, or a time."""

    def __init__(self) -> None:
        self.at: float | None = None
        self.changed = asyncio.Event()

    async def listen(self, socket: WebSocket) -> None:
        """Take wishes until the watcher leaves; what is not one is passed over."""
        try:
            while True:
                with contextlib.suppress(ValueError, TypeError, KeyError):
                    wanted = json.loads(await socket.receive_text())
                    at = wanted["at"]
                    self.at = float(at) if at is not None and math.isfinite(float(at)) else None
                    self.changed.set()
        except (WebSocketDisconnect, RuntimeError):
            self.changed.set()
