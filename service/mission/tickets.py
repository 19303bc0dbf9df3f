"""Numbers for orders, and who waits to hear what became of them."""

from __future__ import annotations

import asyncio


class Tickets:
    """One for each order that was given."""

    def __init__(self) -> None:
        self._given = 0
        self._waiting: dict[int, asyncio.Future[str]] = {}

    def draw(self) -> tuple[int, asyncio.Future[str]]:
        """A number for an order, and what will hold why it was refused, empty if it was not."""
        self._given += 1
        done = self._waiting[self._given] = asyncio.get_running_loop().create_future()
        return self._given, done

    def answer(self, number: int, refused: str) -> None:
        """Say what became of an order; who does not wait any more is not told."""
        if (done := self._waiting.pop(number, None)) is not None and not done.done():
            done.set_result(refused)
