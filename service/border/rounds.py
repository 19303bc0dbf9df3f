"""One answer for all who ask at the same time: what is costly is done once for them, and not once for each."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from typing import Generic, TypeVar

T = TypeVar("T")


class Rounds(Generic[T]):
    """Does `work` again and again while somebody asks. Who asks while it is being done gets the next answer, which is
    then of a time after they asked; so at most two are ever under way or waited for."""

    def __init__(self, work: Callable[[], Awaitable[T]]) -> None:
        self._work = work
        self._next: asyncio.Future[T] | None = None
        self._working: asyncio.Task[None] | None = None

    async def next(self) -> T:
        """The answer of a round that begins from now on. Raises what the work raises."""
        if self._next is None:
            self._next = asyncio.get_running_loop().create_future()
        asked = self._next
        if self._working is None or self._working.done():
            self._working = asyncio.create_task(self._go_round())
        return await asyncio.shield(asked)

    async def _go_round(self) -> None:
        while self._next is not None:
            asked, self._next = self._next, None
            try:
                answer = await self._work()
            except asyncio.CancelledError:
                asked.cancel()
                raise
            except Exception as error:
                asked.set_exception(error)
                asked.exception()  # it is seen, even if all who asked have left
            else:
                asked.set_result(answer)
