"""A webhook: each piece of news as a POST of JSON, again and again until it is taken, in order."""

from __future__ import annotations

import asyncio
import logging

import httpx

from service.telling.news import Announcement
from service.telling.settings import Hook

log = logging.getLogger("roisearch")
TIMEOUT_S = 10.0
FIRST_PAUSE_S, LONGEST_PAUSE_S = 1.0, 60.0
MOST_WAITING = 300
_MOST_ANSWER = 4096


class Webhook:
    """Posts what it is given. An answer of 2xx takes it; one of NEVER never will, and it is dropped."""

    NEVER = frozenset({400, 401, 403, 404, 405, 410, 413, 422})

    def __init__(self, hook: Hook, *, first_pause_s: float = FIRST_PAUSE_S) -> None:
        self._hook, self._first_pause_s = hook, first_pause_s
        self._waiting: asyncio.Queue[Announcement] = asyncio.Queue(MOST_WAITING)

    def tell(self, news: Announcement) -> None:
        """Take news in; what is too much is dropped, and said."""
        try:
            self._waiting.put_nowait(news)
        except asyncio.QueueFull:
            log.warning("the webhook is %d messages behind: '%s' is dropped", MOST_WAITING, news.text)

    async def told(self) -> None:
        """Wait until all is out."""
        await self._waiting.join()

    async def run(self) -> None:
        """Post until cancelled."""
        headers = {"Authorization": f"Bearer {self._hook.token}"} if self._hook.token else {}
        async with httpx.AsyncClient(timeout=TIMEOUT_S, headers=headers, follow_redirects=False) as client:
            while True:
                news = await self._waiting.get()
                try:
                    await self._post(client, news)
                finally:
                    self._waiting.task_done()

    async def _post(self, client: httpx.AsyncClient, news: Announcement) -> None:
        pause_s, said = self._first_pause_s, ""
        while True:
            try:
                async with asyncio.timeout(2.0 * TIMEOUT_S):  # an answer that drips ends too
                    status = await self._once(client, news)
            except (httpx.HTTPError, OSError, TimeoutError) as error:
                why = type(error).__name__
            else:
                if 200 <= status < 300:
                    return
                why = f"it answers {status}"
                if status in self.NEVER:
                    log.warning("the webhook %s does not take '%s' (%s)", self._hook.shown, news.text, why)
                    return
            if why != said:
                log.warning("the webhook %s cannot be told (%s): trying again", self._hook.shown, why)
                said = why
            await asyncio.sleep(pause_s)
            pause_s = min(2.0 * pause_s, LONGEST_PAUSE_S)

    async def _once(self, client: httpx.AsyncClient, news: Announcement) -> int:
        headers = {"Idempotency-Key": news.id}
        async with client.stream("POST", self._hook.url, json=news.body(), headers=headers) as answer:
            read = 0
            async for chunk in answer.aiter_raw():
                read += len(chunk)
                if read > _MOST_ANSWER:  # nobody reads what it says
                    break
            return answer.status_code
