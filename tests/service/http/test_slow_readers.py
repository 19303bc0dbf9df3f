"""Those who ask for a map and do not read it: they are hung up on, and keep nobody else from theirs."""

from __future__ import annotations

import asyncio
import socket
from urllib.parse import urlsplit

import pytest

from service.http.server import Impatient

from .door import FakeRun, on_a_socket

ASK = b"GET /api/map HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n"
BYTES = 24_000_000  # more than the sockets of both ends hold
PATIENCE_S = 30.0


class WideRun(FakeRun):
    """A run with a large map."""

    async def map(self) -> bytes:
        return b"[" + b"0," * (BYTES // 2) + b"0]"


async def connected(port: int, host: str = "127.0.0.1") -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
    """A connection from an address of this machine, with small buffers."""
    client = socket.socket()
    client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 65_536)
    client.bind((host, 0))
    client.setblocking(False)
    await asyncio.get_running_loop().sock_connect(client, ("127.0.0.1", port))
    return await asyncio.open_connection(sock=client, limit=4096)


def test_who_does_not_read_its_map_is_hung_up_on_and_its_slot_is_free(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(Impatient, "reading_s", 0.2)

    async def talk() -> None:
        async with on_a_socket(WideRun()) as door:
            port = urlsplit(door.url).port or 0
            slow = [await connected(port) for _ in range(4)]
            for _, writer in slow:
                writer.write(ASK)
            for reader, _ in slow:
                await asyncio.wait_for(reader.read(1), PATIENCE_S)  # it has begun
            await asyncio.sleep(1.0)
            for reader, writer in slow:
                with pytest.raises((ConnectionError, asyncio.IncompleteReadError)):
                    await asyncio.wait_for(reader.readexactly(BYTES), PATIENCE_S)
                writer.close()
            reader, writer = await connected(port)
            writer.write(ASK)
            assert b"200" in await asyncio.wait_for(reader.readline(), PATIENCE_S)
            writer.close()

    asyncio.run(talk())


def test_a_steady_reader_gets_all_of_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Impatient, "reading_s", 0.2)

    async def talk() -> None:
        async with on_a_socket(WideRun()) as door:
            reader, writer = await connected(urlsplit(door.url).port or 0)
            writer.write(ASK)
            read = 0
            while read < BYTES:
                got = len(await asyncio.wait_for(reader.read(400_000), PATIENCE_S))
                assert got > 0
                read += got
            writer.close()

    asyncio.run(talk())


def test_one_address_does_not_take_all_slots_of_maps(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Impatient, "reading_s", 600.0)

    async def talk() -> None:
        async with on_a_socket(WideRun()) as door:
            port = urlsplit(door.url).port or 0
            slow = [await connected(port) for _ in range(9)]
            said = []
            for reader, writer in slow:
                writer.write(ASK)
                said.append(await asyncio.wait_for(reader.readline(), PATIENCE_S))
            assert [b"503" in line for line in said] == [False] * 4 + [True] * 5
            reader, writer = await connected(port, "127.0.0.2")
            writer.write(ASK)
            assert b"200" in await asyncio.wait_for(reader.readline(), PATIENCE_S)
            for _, each in [*slow, (reader, writer)]:
                each.close()

    asyncio.run(talk())
