"""The flying process's side of the border: what the doors ask is answered here, at a price that is bounded.

- A look at the run takes at most a tenth of the flight's time, however many ask: after one that took a millisecond
  the next waits nine. It is always of a time after it was asked for.
- Reports come in frames of a few dozen, and only so many frames may wait to be taken in.
- An order waits for nothing: it is given as soon as it is read.
"""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import logging
import math
import time
from collections import Counter as Counted
from collections.abc import Callable, Coroutine, Sequence
from typing import Any, Protocol

from prometheus_client import CollectorRegistry, generate_latest
from pydantic import ValidationError

from service.border.frames import Broken
from service.border.limits import MOST_FRAMES, MOST_IN_A_FRAME, MOST_NEWS, MOST_ORDERS, MOST_ROWS
from service.border.memory import SharedMap
from service.errors import BadInput
from service.evidence.reports import OrderRequest, Report
from service.http.run import TakesWords
from service.journal import JournalLost
from service.news.request import NewsRequest
from service.view.feed import Moment
from service.view.state import RunState

log = logging.getLogger("roisearch")
LOOKING_SHARE = 0.1
"""Of the flight's time, which the doors may have for looking."""
WATCHER_S = 0.3
"""In such a time everybody looks who watches; a page does four times a second."""
LAST_LOOK_S = 1.0
"""So long a flight that is over waits for them, if there was anybody so lately."""


class FlownRun(TakesWords, Protocol):
    """A run as the border needs it, in the process that flies it."""

    registry: CollectorRegistry

    def state(self) -> RunState:
        """Where the search stands."""
        ...

    def moment(self) -> Moment:
        """What there is to see now."""
        ...

    def fingerprint(self) -> Callable[[], str]:
        """What works out the digest of the belief as it is now; it may be left to another thread."""
        ...

    def ready(self) -> bool:
        """True while a search can take reports."""
        ...


_Handler = Callable[[dict[str, Any]], Coroutine[Any, Any, dict[str, Any]]]


class Counter:
    """Answers one door process. `send` takes a message; the map goes through `shared`."""

    def __init__(self, run: FlownRun, shared: SharedMap, send: Callable[[dict[str, Any]], None]) -> None:
        self._run, self._shared, self._send = run, shared, send
        self._looking = asyncio.Lock()
        self._free_at = 0.0
        self._looked_at = -math.inf
        self._looked = asyncio.Event()
        self._handlers: dict[str, tuple[_Handler, int]] = {
            "order": (self._order, MOST_ORDERS),
            "hear": (self._hear, MOST_NEWS),
            "withdraw": (self._withdraw, MOST_NEWS),
            "reports": (self._reports, MOST_FRAMES),
            "look": (self._look, 1),
            "metrics": (self._metrics, 1),
        }
        self._under_way: Counted[str] = Counted()
        self._tasks: set[asyncio.Task[None]] = set()

    def take(self, message: dict[str, Any]) -> None:
        """Begin to answer what is asked. Raises Broken when it is no question."""
        number, what = message.get("ask"), message.get("what")
        if not isinstance(number, int) or not isinstance(what, str) or what not in self._handlers:
            raise Broken(f"the door asks for {str(what)[:40]!r}, which the flight does not know")
        handler, most = self._handlers[what]
        if self._under_way[what] >= most:  # the flight stood still, and the door asks again: it is too late
            self._send({"answer": number, "error": "the flight is behind with its answers", "kind": "busy"})
            return
        self._under_way[what] += 1
        task = asyncio.create_task(self._answer(number, what, handler(message)))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def last_look(self) -> None:
        """Let everybody who watches see how it has ended, before the doors are closed."""
        over = time.monotonic()
        if over - self._looked_at > LAST_LOOK_S:
            return
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(LAST_LOOK_S):
                while self._looked_at < over + WATCHER_S:
                    self._looked.clear()
                    await self._looked.wait()

    async def _answer(self, number: int, what: str, working: Coroutine[Any, Any, dict[str, Any]]) -> None:
        try:
            answer = await working
        except JournalLost as error:
            answer = {"error": str(error), "kind": "journal"}
        except BadInput as error:
            answer = {"error": str(error), "kind": "bad"}
        except (ValidationError, KeyError, TypeError, ValueError) as error:
            log.warning("the doors sent what they should have refused: %s", type(error).__name__)
            answer = {"error": "it was not understood", "kind": "fault"}
        except Exception as error:
            log.exception("what the doors asked could not be answered")
            answer = {"error": f"internal error, {error!r}"[:200], "kind": "fault"}
        finally:
            self._under_way[what] -= 1
        self._send({"answer": number, **answer})

    async def _order(self, asked: dict[str, Any]) -> dict[str, Any]:
        order = OrderRequest.model_validate(asked["order"])
        receipt = await self._run.order(order.command, order.place, order.aircraft, order.system_id)
        return {"receipt": receipt.model_dump()}

    async def _hear(self, asked: dict[str, Any]) -> dict[str, Any]:
        return {"heard": await self._run.hear(NewsRequest.model_validate(asked["news"]))}

    async def _withdraw(self, asked: dict[str, Any]) -> dict[str, Any]:
        return {"heard": await self._run.withdraw(str(asked["name"]))}

    async def _reports(self, asked: dict[str, Any]) -> dict[str, Any]:
        if len(asked["reports"]) > MOST_IN_A_FRAME:
            raise ValueError("too many reports in a frame")
        reports = [Report.model_validate_json(each) for each in asked["reports"]]
        return {"receipts": [receipt.model_dump() for receipt in await self._run.submit_all(reports)]}

    async def _metrics(self, asked: dict[str, Any]) -> dict[str, Any]:
        async with self._looking:
            await self._wait_for_a_turn()
            began = time.thread_time()
            text = generate_latest(self._run.registry).decode()
            self._spent(began)
        return {"text": text}

    async def _look(self, asked: dict[str, Any]) -> dict[str, Any]:
        """The state; with `moment` also what the page needs, with `arrays` the map, with `digest` its fingerprint."""
        fingerprint = None
        async with self._looking:
            await self._wait_for_a_turn()
            began, looked_at = time.thread_time(), time.monotonic()
            answer: dict[str, Any] = {"ready": self._run.ready()}
            if asked["moment"] or asked["arrays"]:
                moment = self._run.moment()
                answer |= {"state": moment.state, "total": moment.total}
                since = asked["since"]
                answer["rows"] = {
                    name: _rows(getattr(moment, name), int(since[name])) for name in ("hits", "curve")
                }
                known = itertools.chain(since["tracks"], itertools.repeat(0))
                answer["tracks"] = [
                    _rows(rows, int(count)) for rows, count in zip(moment.tracks, known, strict=False)
                ]
                if asked["arrays"]:
                    self._shared.write(moment.weights, moment.pod)
            else:
                answer["state"] = self._run.state()
            if asked["digest"]:
                fingerprint = self._run.fingerprint()
            self._spent(began)
        if fingerprint is not None:
            answer["digest"] = await asyncio.to_thread(fingerprint)
        self._looked_at = looked_at
        self._looked.set()  # who waits for it goes on after this answer is on its way
        return answer

    async def _wait_for_a_turn(self) -> None:
        await asyncio.sleep(max(0.0, self._free_at - time.perf_counter()))

    def _spent(self, began: float) -> None:
        """What a look has cost the flight is its processor time: one that only waited for a core, or for a thread that
        compiles, is not paid for by those who look next."""
        cost = time.thread_time() - began
        self._free_at = time.perf_counter() + cost * (1.0 / LOOKING_SHARE - 1.0)


def _rows(rows: Sequence[Sequence[float]], since: int) -> dict[str, Any]:
    start = since if 0 <= since <= len(rows) else 0
    return {"from": start, "rows": [list(row) for row in rows[start : start + MOST_ROWS]]}
