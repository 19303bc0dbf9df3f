"""Half-open connections, many at a time, and an order that gets through all the same."""

from __future__ import annotations

import asyncio
import contextlib
import socket
import time
from typing import Any, get_args

import httpx
import pytest
from hypothesis import given
from hypothesis import strategies as st
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol
from websockets.asyncio.client import connect

from service.evidence.reports import OrderReceipt, OrderRequest
from service.http.address import split_address
from service.http.crowd import Crowd
from service.http.events import EVERY_S
from service.http.guard import STOPS
from service.mission.orders import STOPPING
from service.view.feed import Moment

from .door import FRAME, HOLD, FakeRun, on_a_socket


class Guest:
    def __init__(self, address: str, busy: bool, known: bool = False) -> None:
        self.address, self.busy, self.known, self.gone = address, busy, known, False

    def idle(self) -> bool:
        return not self.busy

    def asked(self) -> bool:
        return self.busy or self.known

    def hang_up(self) -> None:
        self.gone = True


@given(st.lists(st.tuples(st.sampled_from("abc"), st.booleans()), max_size=60))
def test_there_are_never_more_than_enough_and_the_busy_stay(guests: list[tuple[str, bool]]) -> None:
    crowd, here = Crowd(most=8, most_of_one=5), []
    for address, busy in guests:
        guest = Guest(address, busy)
        crowd.enter(guest, address)
        here = [each for each in [*here, guest] if not each.gone]
        assert len(here) == crowd.count <= 8
        assert sum(each.address == address for each in here) <= 5
        if guest.gone:  # a newcomer goes only where all the others are answered
            assert all(each.busy for each in here if each.address == address)


def test_who_has_asked_for_something_before_outlasts_those_who_never_did() -> None:
    crowd, operator = Crowd(most=8, most_of_one=5), Guest("a", busy=False, known=True)
    crowd.enter(operator, "a")
    for _ in range(20):
        crowd.enter(Guest("a", busy=False), "a")
    assert not operator.gone
    for _ in range(20):
        crowd.enter(Guest("a", busy=False, known=True), "a")
    assert operator.gone, "among their like, the longest silent goes"


def test_a_storm_of_newcomers_has_few_turns_before_who_is_connected_has_one(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """asyncio accepts as many at once as may wait; with two thousand of them, an order waited for eight seconds."""
    entered: list[str] = []
    monkeypatch.setattr(Crowd, "enter", lambda crowd, connection, address: entered.append(address))

    async def talk() -> list[int]:
        turns: list[int] = []
        async with on_a_socket(FakeRun()) as door, contextlib.AsyncExitStack() as storm:
            for _ in range(200):  # the kernel lets them in, the loop stands still meanwhile
                storm.enter_context(socket.create_connection(split_address(door.url.removeprefix("http://"))))
            while sum(turns) < 200:
                before = len(entered)
                await asyncio.sleep(0)
                turns.append(len(entered) - before)
        return turns

    assert max(asyncio.run(talk())) <= 8


def test_a_watcher_is_read_little_at_a_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """It has nothing to say but a time; sixteen that wish thousands of times a second kept an order waiting."""
    sizes: list[int] = []
    read = WebSocketsSansIOProtocol.data_received

    def noted(self: WebSocketsSansIOProtocol, data: bytes) -> None:
        sizes.append(len(data))
        read(self, data)

    async def talk() -> None:
        async with (
            on_a_socket(FakeRun()) as door,
            connect(door.url.replace("http", "ws", 1) + "/api/events") as watcher,
        ):
            await watcher.recv()
            monkeypatch.setattr(WebSocketsSansIOProtocol, "data_received", noted)
            watcher.transport.write(b"\x8a\x80\x00\x00\x00\x00" * 2000)  # pongs, which nobody asked for
            async with asyncio.timeout(30.0):
                while sum(sizes) < 12_000:  # noqa: ASYNC110 - the other end
                    await asyncio.sleep(0.01)

    asyncio.run(talk())
    assert max(sizes) <= 1024


def test_a_watcher_gets_a_moment_each_quarter_second_at_most_however_often_it_wishes() -> None:
    asked: list[float] = []

    class Counted(FakeRun):
        async def moment(self) -> Moment:
            asked.append(time.monotonic())
            return await super().moment()

    async def talk() -> None:
        async with (
            on_a_socket(Counted()) as door,
            connect(door.url.replace("http", "ws", 1) + "/api/events") as watcher,
        ):
            for number in range(1000):
                await watcher.send(f'{{"at": {number}}}')
            while len(asked) < 5:
                await watcher.recv()

    asyncio.run(talk())
    assert asked[-1] - asked[0] > 0.9 * EVERY_S * (len(asked) - 1)


def test_an_order_gets_through_four_hundred_half_open_connections() -> None:
    run = FakeRun()

    async def talk() -> int:
        async with on_a_socket(run, body_timeout_s=60.0) as door:
            port = door.listener.getsockname()[1]
            half_open = [await asyncio.open_connection("127.0.0.1", port) for _ in range(400)]
            for _, writer in half_open[::2]:
                writer.write(b"POST /api/commands HTTP/1.1\r\nHost: 127.0.0.1\r\n")
            async with httpx.AsyncClient(base_url=door.url, timeout=30.0) as client:
                answer = await client.post("/api/commands", json=HOLD)
            for _, writer in half_open:
                writer.close()
            return answer.status_code

    assert asyncio.run(talk()) == 200
    assert run.orders == ["hold"]


def test_an_order_gets_through_where_reports_take_every_slot() -> None:
    """A report without the end of its body holds its slot until its time is up; orders have slots of their own."""
    run = FakeRun()

    async def talk() -> list[int]:
        async with on_a_socket(run, body_timeout_s=60.0) as door:
            port = door.listener.getsockname()[1]
            head = (
                b"POST /api/reports HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: application/json\r\n"
                b"Content-Length: 1000\r\n\r\n{"
            )
            slow = [await asyncio.open_connection("127.0.0.1", port) for _ in range(80)]
            for _, writer in slow:
                writer.write(head)
                await writer.drain()
            async with httpx.AsyncClient(base_url=door.url, timeout=30.0) as client:
                codes = [(await client.post("/api/reports", json=FRAME)).status_code]
                codes.append((await client.post("/api/commands", json=HOLD)).status_code)
            for _, writer in slow:
                writer.close()
            return codes

    assert asyncio.run(talk()) == [503, 200]
    assert run.orders == ["hold"]


@pytest.mark.parametrize("command", STOPS)
def test_orders_that_are_not_answered_keep_none_waiting_that_stops_the_aircraft(command: str) -> None:
    class Slow(FakeRun):
        async def order(self, command: str, *more: Any, **others: Any) -> OrderReceipt:
            if command == "launch":
                await asyncio.sleep(3600.0)
            return await super().order(command, *more, **others)

    run = Slow()

    async def talk() -> list[int]:
        async with (
            on_a_socket(run, commands_per_s=1000.0) as door,
            httpx.AsyncClient(base_url=door.url, timeout=30.0, limits=httpx.Limits()) as client,
        ):
            path, launch = "/api/commands", {"command": "launch"}
            hung = [asyncio.create_task(client.post(path, json=launch)) for _ in range(40)]
            done, _ = await asyncio.wait(hung, timeout=2.0)
            codes = [*{each.result().status_code for each in done}]
            codes.append((await client.post(path, json={"command": command})).status_code)
            for each in hung:
                each.cancel()
            return codes

    assert asyncio.run(talk()) == [503, 200]  # eight too many, and then the one that counts
    assert run.orders == [command]
    assert set(STOPS) == set(STOPPING) & set(get_args(OrderRequest.model_fields["command"].annotation))
