"""The doors of this machine: real datagrams and a real Unix socket; lines in, receipts out."""

from __future__ import annotations

import asyncio
import contextlib
import json
import socket
import stat
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from service.config import DoorSettings
from service.doors import open_doors
from service.errors import BadInput
from service.evidence.reports import Receipt, Report

from .taking import PATIENCE_S, Taker, frames, lines, said, served

# ---- UDP


async def exchange(port: int, data: bytes, count: int) -> list[dict[str, Any]]:
    """Send one datagram and collect the receipts."""
    loop = asyncio.get_running_loop()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as client:
        client.setblocking(False)
        client.connect(("127.0.0.1", port))
        await loop.sock_sendall(client, data)
        receipts: list[dict[str, Any]] = []
        async with asyncio.timeout(PATIENCE_S):
            while len(receipts) < count:
                receipts += said(await loop.sock_recv(client, 1 << 16))
        return receipts


def test_a_datagram_is_answered_by_a_datagram_to_its_sender() -> None:
    async def talk() -> None:
        taker = Taker()
        async with served(taker, udp="127.0.0.1:0") as doors:
            assert doors.udp is not None
            port = doors.udp.getsockname()[1]
            assert [each["status"] for each in await exchange(port, lines(*frames(1)), 1)] == ["accepted"]
            mixed = await exchange(port, lines(*frames(2)) + b"nonsense", 3)
            assert [each["status"] for each in mixed] == ["duplicate", "accepted", "refused"]
            many = await exchange(port, lines(*frames(1200, "n")), 1200)  # more than one datagram of receipts
            assert [each["id"] for each in many] == [f"n{number}" for number in range(1200)]
        assert len(taker.ids) == 1202

    asyncio.run(talk())


@pytest.mark.parametrize(
    ("address", "words"),
    [
        ("0.0.0.0:0", "not on loopback, and a datagram has no token"),
        ("[::]:0", "not on loopback"),
        ("14600", "HOST:PORT"),
        ("nowhere.invalid:14600", "cannot be listened on"),
    ],
)
def test_udp_beyond_loopback_or_nowhere_is_refused(address: str, words: str) -> None:
    with pytest.raises(BadInput) as caught:
        open_doors(DoorSettings(udp=address))
    assert words in str(caught.value)


def test_an_address_without_a_host_is_on_loopback() -> None:
    with contextlib.closing(open_doors(DoorSettings(udp=":0"))) as doors:
        assert doors.udp is not None
        assert doors.udp.getsockname()[0] == "127.0.0.1"


def test_datagrams_that_cannot_wait_are_dropped_and_the_door_goes_on(
    caplog: pytest.LogCaptureFixture,
) -> None:
    """Nothing piles up behind a slow flight; whoever gets no receipt sends again."""

    async def talk() -> int:
        taker, go, waiting = Taker(), asyncio.Event(), 0

        async def submit_all(reports: Sequence[Report]) -> list[Receipt]:
            nonlocal waiting
            waiting += 1
            await go.wait()
            return await taker.submit_all(reports)

        with contextlib.closing(open_doors(DoorSettings(udp="127.0.0.1:0"))) as doors:
            serving = asyncio.create_task(doors.serve(submit_all))
            assert doors.udp is not None
            port = doors.udp.getsockname()[1]
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as client:
                client.connect(("127.0.0.1", port))
                for frame in frames(400):
                    client.send(lines(frame))
                async with asyncio.timeout(PATIENCE_S):
                    while "some are dropped" not in caplog.text:  # noqa: ASYNC110 - a line of the log
                        await asyncio.sleep(0.01)
            at_once = waiting
            go.set()
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as client:
                client.setblocking(False)
                client.connect(("127.0.0.1", port))
                receipt: list[dict[str, Any]] = []
                while not receipt:  # what is dropped is sent again
                    client.send(lines(*frames(1, "later")))
                    with contextlib.suppress(TimeoutError):
                        async with asyncio.timeout(0.5):
                            receipt = said(await asyncio.get_running_loop().sock_recv(client, 1 << 16))
            assert receipt[0]["id"] == "later0"
            serving.cancel()
            await asyncio.wait([serving])
            return at_once

    assert asyncio.run(talk()) <= 256


def test_a_flood_of_datagrams_has_few_turns_before_anything_else_has_its_next() -> None:
    """With a task for each, two hundred datagrams were read between two steps of an order."""

    async def talk() -> int:
        begun, most = 0, 0
        go = asyncio.Event()

        async def submit_all(reports: Sequence[Report]) -> list[Receipt]:
            nonlocal begun, most
            begun += 1
            most = max(most, begun)
            await go.wait()
            begun -= 1
            return [Receipt(id=each.id, status="accepted") for each in reports]

        with contextlib.closing(open_doors(DoorSettings(udp="127.0.0.1:0"))) as doors:
            serving = asyncio.create_task(doors.serve(submit_all))
            assert doors.udp is not None
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as client:
                client.setblocking(False)
                client.connect(doors.udp.getsockname())
                for frame in frames(100):
                    client.send(lines(frame))
                for _ in range(200):
                    await asyncio.sleep(0)
                go.set()
                answered: list[dict[str, Any]] = []
                async with asyncio.timeout(PATIENCE_S):
                    while len(answered) < 100:
                        answered += said(await asyncio.get_running_loop().sock_recv(client, 1 << 16))
            serving.cancel()
            await asyncio.wait([serving])
        return most

    assert asyncio.run(talk()) == 2


# ---- the Unix socket


def test_the_unix_socket_answers_each_line_and_takes_what_comes_in_pieces(tmp_path: Path) -> None:
    async def talk() -> None:
        taker, path = Taker(), tmp_path / "reports.sock"
        async with served(taker, unix=str(path)):
            assert stat.S_IMODE(path.stat().st_mode) == 0o660
            reader, writer = await asyncio.open_unix_connection(path)
            async with asyncio.timeout(PATIENCE_S):
                writer.write(lines(*frames(1)))
                assert json.loads(await reader.readline())["status"] == "accepted"
                data = lines(*frames(300))
                for start in range(0, len(data), 1000):
                    writer.write(data[start : start + 1000])
                    await asyncio.sleep(0)
                statuses = [json.loads(await reader.readline())["status"] for _ in range(300)]
                assert statuses == ["duplicate"] + ["accepted"] * 299
                writer.write(lines(*frames(1, "last")).rstrip())
                writer.write_eof()
                assert json.loads(await reader.read())["id"] == "last0"
            writer.close()
        assert len(taker.ids) == 301
        assert not path.exists()

    asyncio.run(talk())


def test_a_line_without_an_end_is_cut_off_with_a_word(tmp_path: Path) -> None:
    async def talk() -> None:
        taker, path = Taker(), tmp_path / "reports.sock"
        async with served(taker, unix=str(path)):
            reader, writer = await asyncio.open_unix_connection(path)
            writer.write(b"x" * (1 << 19))
            async with asyncio.timeout(PATIENCE_S):
                assert "at most" in json.loads(await reader.readline())["reason"]
                with contextlib.suppress(ConnectionError):
                    assert await reader.read() == b""
            writer.close()

    asyncio.run(talk())


def test_a_socket_that_a_killed_service_left_is_replaced_and_a_living_one_or_a_file_is_not(
    tmp_path: Path,
) -> None:
    path = tmp_path / "reports.sock"
    left = socket.socket(socket.AF_UNIX)
    left.bind(str(path))
    left.close()
    with contextlib.closing(open_doors(DoorSettings(unix=str(path)))), pytest.raises(BadInput) as caught:
        open_doors(DoorSettings(unix=str(path)))
    assert "another process listens there" in str(caught.value)
    assert not path.exists()
    path.write_text("mine")
    with pytest.raises(BadInput, match="no socket"):
        open_doors(DoorSettings(unix=str(path)))
    assert path.read_text() == "mine"
    with pytest.raises(BadInput, match=r"doors\.unix"):
        open_doors(DoorSettings(unix=str(tmp_path / "none" / "reports.sock")))
    with pytest.raises(BadInput, match=r"doors\.unix"):
        open_doors(DoorSettings(unix=str(tmp_path / ("long" * 40))))
