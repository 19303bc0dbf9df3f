"""Frames, rounds and the counter, each alone."""

from __future__ import annotations

import asyncio
import contextlib
import json
import struct
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from service.border.asking import Asking
from service.border.counter import LAST_LOOK_S, LOOKING_SHARE, WATCHER_S, Counter
from service.border.frames import MOST_BYTES, Broken, Frames, frame
from service.border.limits import MOST_FRAMES, MOST_IN_A_FRAME
from service.border.memory import SharedMap
from service.border.rounds import Rounds
from service.http.run import Unanswered

from .flown import Flown

LOOK = {"what": "look", "moment": False, "arrays": False, "digest": False}


@given(st.lists(st.dictionaries(st.text(), st.integers() | st.text())), st.integers(1, 50))
def test_messages_come_out_as_they_went_in_however_they_are_cut(messages: list[Any], piece: int) -> None:
    data, frames, out = b"".join(frame(each) for each in messages), Frames(), []
    for start in range(0, len(data), piece):
        out += list(frames.feed(data[start : start + piece]))
    assert out == messages


@given(st.binary(max_size=300))
def test_any_bytes_are_messages_or_broken(data: bytes) -> None:
    with contextlib.suppress(Broken):
        assert all(isinstance(each, dict) for each in Frames().feed(data))


def test_a_frame_that_is_too_long_is_refused_before_it_is_gathered() -> None:
    with pytest.raises(Broken, match="are the most"):
        list(Frames().feed(struct.pack(">I", MOST_BYTES + 1)))
    with pytest.raises(ValueError, match="more than the border takes"):
        frame({"text": "x" * MOST_BYTES})


def test_who_asks_while_it_is_worked_out_shares_the_next_round() -> None:
    async def once() -> tuple[list[int], int]:
        count = 0
        go = asyncio.Event()

        async def work() -> int:
            nonlocal count
            count += 1
            mine = count
            await go.wait()
            return mine

        rounds = Rounds(work)
        asking = [asyncio.create_task(rounds.next())]
        await asyncio.sleep(0)
        await asyncio.sleep(0)
        asking += [asyncio.create_task(rounds.next()) for _ in range(50)]
        await asyncio.sleep(0)
        go.set()
        return list(await asyncio.gather(*asking)), count

    answers, count = asyncio.run(once())
    assert answers == [1] + [2] * 50
    assert count == 2


@pytest.mark.parametrize("asked_before", [True, False])
def test_nobody_waits_for_a_flight_that_is_ending(asked_before: bool) -> None:
    """Whoever asks then is told so at once, and not when the server gives up on them."""
    channel: Any = SimpleNamespace(send=lambda message: None)

    async def ask() -> None:
        asking = Asking(channel)
        if asked_before:
            asyncio.get_running_loop().call_soon(asking.end)
        else:
            asking.end()
        async with asyncio.timeout(20.0):
            await asking.ask("look", 1e9)

    with pytest.raises(Unanswered, match="the service is ending"):
        asyncio.run(ask())


def test_a_round_that_fails_tells_all_who_asked_and_the_next_goes_on() -> None:
    async def once() -> list[Any]:
        faults = iter([ZeroDivisionError("a mistake")])

        async def work() -> int:
            for fault in faults:
                raise fault
            return 7

        rounds = Rounds(work)
        first = await asyncio.gather(rounds.next(), rounds.next(), return_exceptions=True)
        return [*first, await rounds.next()]

    first, second, third = asyncio.run(once())
    assert isinstance(first, ZeroDivisionError)
    assert isinstance(second, ZeroDivisionError)
    assert third == 7


def counter(run: Flown) -> tuple[Counter, list[dict[str, Any]]]:
    said: list[dict[str, Any]] = []
    return Counter(run, SharedMap.create(run.ground.grid.frame.shape), said.append), said


async def answers(said: list[Any], count: int) -> None:
    async with asyncio.timeout(30):
        while len(said) < count:  # noqa: ASYNC110 - it is what the counter calls that is waited for
            await asyncio.sleep(0.001)


@pytest.mark.parametrize(
    "message",
    [
        {"ask": 1},
        {"ask": "1", "what": "look"},
        {"ask": 1, "what": "shutdown"},
        {"ask": 1, "what": ["look"]},
    ],
)
def test_what_is_no_question_breaks_the_border(message: dict[str, Any]) -> None:
    async def once() -> None:
        counter(Flown())[0].take(message)

    with pytest.raises(Broken):
        asyncio.run(once())


def test_who_watches_sees_how_it_ended_before_the_doors_are_closed() -> None:
    """A look that was asked for before the end is not enough, nor is one of another page just after it."""

    async def once() -> tuple[bool, bool]:
        taking, said = counter(Flown())
        for number in (1, 2):
            taking.take({"ask": number, **LOOK})
            await answers(said, number)
            if number == 1:
                closing = asyncio.create_task(taking.last_look())
                await asyncio.sleep(0)
        await asyncio.sleep(0)
        too_early = closing.done()
        await asyncio.sleep(WATCHER_S)
        taking.take({"ask": 3, **LOOK})
        await answers(said, 3)
        await asyncio.wait([closing], timeout=LAST_LOOK_S / 4)
        return too_early, closing.done()

    assert asyncio.run(once()) == (False, True)


def test_a_flight_that_nobody_watches_is_over_at_once() -> None:
    async def once() -> None:
        async with asyncio.timeout(LAST_LOOK_S / 2):
            await counter(Flown())[0].last_look()

    asyncio.run(once())


def test_more_reports_at_a_time_than_agreed_are_not_taken_in() -> None:
    class Slow(Flown):
        async def submit_all(self, reports: Any) -> Any:
            await asyncio.get_running_loop().create_future()

    async def once() -> list[dict[str, Any]]:
        taking, said = counter(Slow())
        for number in range(MOST_FRAMES + 1):
            taking.take({"ask": number, "what": "reports", "reports": []})
        return said

    (answer,) = asyncio.run(once())
    assert (answer["answer"], answer["kind"]) == (MOST_FRAMES, "busy")


@pytest.mark.parametrize(
    "message",
    [
        {"what": "order", "order": {"command": "arm"}},
        {"what": "order"},
        {"what": "reports", "reports": ["{}"]},
        {"what": "reports", "reports": [3]},
        {"what": "reports", "reports": ['{"id": "a", "captured_at": 1.0}'] * (MOST_IN_A_FRAME + 1)},
        {"what": "look"},
    ],
)
def test_nothing_unchecked_reaches_the_flight(message: dict[str, Any]) -> None:
    run = Flown()

    async def once() -> dict[str, Any]:
        taking, said = counter(run)
        taking.take({"ask": 1, **message})
        await answers(said, 1)
        return said[0]

    answer = asyncio.run(once())
    assert answer["kind"] == "fault"
    assert json.dumps(answer)
    assert run.orders == []
    assert run.reports == []


def test_a_look_brings_what_is_new_of_each_track_and_all_of_one_that_was_not_known() -> None:
    run = Flown()
    run.tracks = [[(47.0 + i, 8.0) for i in range(4)], [(46.0, 8.0)], [(45.0, 8.0), (45.1, 8.0)]]

    async def once() -> dict[str, Any]:
        taking, said = counter(run)
        since = {"tracks": [3, 1], "hits": 0, "curve": 1}
        taking.take({"ask": 1, **LOOK, "moment": True, "since": since})
        await answers(said, 1)
        return said[0]

    assert asyncio.run(once())["tracks"] == [
        {"from": 3, "rows": [[50.0, 8.0]]},
        {"from": 1, "rows": []},
        {"from": 0, "rows": [[45.0, 8.0], [45.1, 8.0]]},
    ]


def test_looking_takes_no_more_than_its_share_of_the_flights_time() -> None:
    class Costly(Flown):
        spent = 0.0

        def state(self) -> dict[str, Any]:
            began = time.thread_time()  # not by the clock: another program may have the core meanwhile
            while time.thread_time() - began < 0.01:
                pass
            self.spent += time.thread_time() - began
            return super().state()

    async def once() -> float:
        run = Costly()
        taking, said = counter(run)
        loop = asyncio.get_running_loop()
        began = loop.time()
        for number in range(10):
            taking.take({"ask": number, **LOOK})
            await answers(said, number + 1)
        return run.spent / (loop.time() - began)

    assert asyncio.run(once()) < 1.5 * LOOKING_SHARE


def test_both_sides_see_the_same_map(tmp_path: Path) -> None:
    ours = SharedMap.create((3, 4))
    theirs = SharedMap(ours.file, (3, 4))
    weights, pod = np.arange(12.0), np.arange(12.0).reshape(3, 4) / 12
    ours.write(weights, pod)
    read = theirs.read()
    ours.write(weights * 2, pod * 2)
    assert np.array_equal(read[0], weights)
    assert np.array_equal(read[1], pod)
