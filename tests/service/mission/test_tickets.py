"""What became of an order is told to who gave it, once."""

from __future__ import annotations

import asyncio

from service.mission.tickets import Tickets


def test_each_order_hears_what_became_of_it() -> None:
    async def once() -> tuple[str, str]:
        tickets = Tickets()
        (first, of_first), (second, of_second) = tickets.draw(), tickets.draw()
        tickets.answer(second, "it flies already")
        tickets.answer(first, "")
        tickets.answer(first, "said twice")
        return await of_first, await of_second

    assert asyncio.run(once()) == ("", "it flies already")


def test_who_has_gone_and_who_never_was_are_not_told() -> None:
    async def once() -> None:
        tickets = Tickets()
        number, done = tickets.draw()
        done.cancel()
        tickets.answer(number, "too late")
        tickets.answer(99, "nobody's")

    asyncio.run(once())
