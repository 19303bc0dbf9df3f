"""The MQTT door, with a real broker."""

from __future__ import annotations

import asyncio
import contextlib
import getpass
import os
import shutil
import socket
import subprocess
import time
from collections.abc import AsyncIterator, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import aiomqtt
import pytest

from service.config import DoorSettings
from service.doors import open_doors
from service.doors.mqtt import MOST_BYTES
from service.errors import BadInput
from tests.ports import free_port

from .taking import PATIENCE_S, Taker, frames, lines, said, served

MOSQUITTO = shutil.which("mosquitto", path=f"{os.environ.get('PATH', '')}:/usr/sbin")
needs_mosquitto = pytest.mark.skipif(
    MOSQUITTO is None, reason="NO MOSQUITTO: THE MQTT DOOR HAS NOT BEEN OPENED (apt-get install mosquitto)"
)


@contextmanager
def mosquitto(folder: Path, port: int, *more: str) -> Iterator[None]:
    """Debian's broker on a port."""
    assert MOSQUITTO is not None
    file = folder / "mosquitto.conf"
    file.write_text(
        "\n".join([f"listener {port} 127.0.0.1", "persistence false", f"user {getpass.getuser()}", *more, ""])
    )
    broker = subprocess.Popen([MOSQUITTO, "-c", str(file)], stderr=subprocess.DEVNULL)
    try:
        deadline = time.monotonic() + PATIENCE_S
        while True:
            with socket.socket() as probe:
                if probe.connect_ex(("127.0.0.1", port)) == 0:
                    break
            assert broker.poll() is None
            assert time.monotonic() < deadline
            time.sleep(0.02)
        yield
    finally:
        broker.terminate()
        broker.wait(PATIENCE_S)


async def receipts_of(client: aiomqtt.Client, count: int) -> list[dict[str, Any]]:
    receipts: list[dict[str, Any]] = []
    async with asyncio.timeout(PATIENCE_S):
        async for message in client.messages:
            assert isinstance(message.payload, bytes)
            receipts += said(message.payload)
            if len(receipts) >= count:
                break
    return receipts


async def until_answered(client: aiomqtt.Client, topic: str) -> None:
    """Publish until the service, which may not have subscribed yet, answers."""
    async with asyncio.timeout(PATIENCE_S):
        while True:
            await client.publish(topic, lines(*frames(1)), qos=1)
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(0.3):
                    await anext(aiter(client.messages))
                    return


@needs_mosquitto
def test_reports_published_to_a_broker_are_answered_on_the_topic_of_receipts(tmp_path: Path) -> None:
    port, taker = free_port(), Taker()

    async def talk() -> None:
        with mosquitto(tmp_path, port, "allow_anonymous true"):
            async with (
                served(taker, mqtt=f"mqtt://127.0.0.1:{port}"),
                aiomqtt.Client("127.0.0.1", port) as client,
            ):
                await client.subscribe("roisearch/reports/receipts", qos=1)
                await until_answered(client, "roisearch/reports")
                for frame in frames(200, "m"):
                    await client.publish("roisearch/reports", lines(frame), qos=1)
                await client.publish("roisearch/reports", b"nonsense", qos=1)
                receipts = [each for each in await receipts_of(client, 201) if each["id"] != "f0"]
                assert [each["status"] for each in receipts] == ["accepted"] * 200 + ["refused"]

    asyncio.run(talk())
    assert taker.ids[1:] == [f"m{number}" for number in range(200)]


@needs_mosquitto
def test_what_the_broker_has_retained_is_no_report_of_today(tmp_path: Path) -> None:
    port, taker = free_port(), Taker()
    yesterdays = {**frames(1)[0], "id": "yesterday", "clock": "boot", "captured_at": 12.0}

    async def talk() -> list[dict[str, Any]]:
        with mosquitto(tmp_path, port, "allow_anonymous true"):
            async with aiomqtt.Client("127.0.0.1", port) as client:
                await client.subscribe("roisearch/reports/receipts", qos=1)
                await client.publish("roisearch/reports", lines(yesterdays), qos=1, retain=True)
                async with served(taker, mqtt=f"mqtt://127.0.0.1:{port}"):
                    (refused,) = await receipts_of(client, 1)
                    await client.publish("roisearch/reports", lines(*frames(1)), qos=1, retain=True)
                    return [refused, *await receipts_of(client, 1)]

    refused, taken = asyncio.run(talk())
    assert refused["status"] == "refused"
    assert "publish reports without retain" in refused["reason"]
    assert (taken["status"], taker.ids) == ("accepted", ["f0"])


@needs_mosquitto
def test_a_message_that_is_too_long_is_refused_without_reading_it(tmp_path: Path) -> None:
    port, taker = free_port(), Taker()

    async def talk() -> list[dict[str, Any]]:
        with mosquitto(tmp_path, port, "allow_anonymous true"):
            async with (
                served(taker, mqtt=f"mqtt://127.0.0.1:{port}"),
                aiomqtt.Client("127.0.0.1", port) as client,
            ):
                await client.subscribe("roisearch/reports/receipts", qos=1)
                await until_answered(client, "roisearch/reports")
                await client.publish("roisearch/reports", lines(*frames(1)) * (MOST_BYTES // 30), qos=1)
                while (last := (await receipts_of(client, 1)))[0]["id"]:
                    pass
                return last

    (receipt,) = asyncio.run(talk())
    assert "a message has at most" in receipt["reason"]
    assert taker.ids == ["f0"]


@contextlib.asynccontextmanager
async def before_5(broker: int) -> AsyncIterator[int]:
    """A broker that knows MQTT 3.1.1 and nothing later, in front of a real one; its port."""

    async def pass_on(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with contextlib.suppress(ConnectionError), contextlib.closing(writer):
            while data := await reader.read(1 << 16):
                writer.write(data)

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        start = await reader.readexactly(9)  # fixed header, 00 04 M Q T T, level
        if start[8] > 4:
            writer.write(b"\x20\x02\x00\x01")  # unacceptable protocol version (3.1.1, table 3.1)
            writer.close()
            return
        theirs, ours = await asyncio.open_connection("127.0.0.1", broker)
        ours.write(start)
        await asyncio.gather(pass_on(reader, ours), pass_on(theirs, writer))

    async with await asyncio.start_server(serve, "127.0.0.1", 0) as server:
        yield server.sockets[0].getsockname()[1]


@needs_mosquitto
def test_a_broker_that_speaks_an_older_mqtt_is_spoken_to_in_that(tmp_path: Path) -> None:
    port, taker = free_port(), Taker()

    async def talk() -> None:
        with mosquitto(tmp_path, port, "allow_anonymous true"):
            async with (
                before_5(port) as old,
                served(taker, mqtt=f"mqtt://127.0.0.1:{old}"),
                aiomqtt.Client("127.0.0.1", port) as client,
            ):
                await client.subscribe("roisearch/reports/receipts", qos=1)
                await until_answered(client, "roisearch/reports")

    asyncio.run(talk())
    assert taker.ids == ["f0"]


@needs_mosquitto
def test_what_is_far_too_long_does_not_even_leave_a_broker_of_today(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    port, taker, longest = free_port(), Taker(), 0
    receive = socket.socket.recv

    def noted(self: socket.socket, size: int, flags: int = 0) -> bytes:
        nonlocal longest
        longest = max(longest, size)
        return receive(self, size, flags)

    async def talk() -> None:
        with mosquitto(tmp_path, port, "allow_anonymous true"):
            async with (
                served(taker, mqtt=f"mqtt://127.0.0.1:{port}"),
                aiomqtt.Client("127.0.0.1", port) as client,
            ):
                await client.subscribe("roisearch/reports/receipts", qos=1)
                await until_answered(client, "roisearch/reports")
                monkeypatch.setattr(socket.socket, "recv", noted)
                await client.publish("roisearch/reports", b"x" * 9_000_000, qos=1)
                await client.publish("roisearch/reports", lines(*frames(1, "after")), qos=1)
                while (await receipts_of(client, 1))[0]["id"] != "after0":
                    pass

    asyncio.run(talk())
    assert longest < 1_000_000  # the client library asks for all that a message has left
    assert taker.ids == ["f0", "after0"]


@needs_mosquitto
def test_a_broker_that_comes_late_or_goes_away_is_called_again_with_name_and_password(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("service.doors.mqtt.RETRY_S", 0.05)
    port, taker = free_port(), Taker()
    secret, passwords = tmp_path / "credentials", tmp_path / "passwords"
    secret.write_text("drone:let me in\n")
    secret.chmod(0o600)
    subprocess.run(["mosquitto_passwd", "-b", "-c", passwords, "drone", "let me in"], check=True)
    passwords.chmod(0o644)
    conf = ("allow_anonymous false", f"password_file {passwords}")

    async def talk() -> None:
        where = {
            "mqtt": f"mqtt://127.0.0.1:{port}",
            "mqtt_credentials_file": str(secret),
            "mqtt_topic": "sar/seen",
        }
        async with served(taker, **where):
            for _ in range(2):
                with mosquitto(tmp_path, port, *conf):
                    async with aiomqtt.Client(
                        "127.0.0.1", port, username="drone", password="let me in"
                    ) as client:
                        await client.subscribe("sar/seen/receipts", qos=1)
                        await until_answered(client, "sar/seen")

    asyncio.run(talk())
    assert taker.ids == ["f0"]


def test_a_broker_that_refuses_the_subscription_is_told_of_and_asked_again(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    asked = asyncio.Event()
    times = 0

    class Refusing:
        def __init__(self, *_: object, **__: object) -> None:
            self.messages = self._messages()

        async def __aenter__(self) -> Refusing:
            return self

        async def __aexit__(self, *_: object) -> None:
            return None

        async def _messages(self) -> AsyncIterator[aiomqtt.Message]:
            await asyncio.get_running_loop().create_future()
            yield aiomqtt.Message("t", b"", 0, retain=False, mid=0, properties=None)

        async def subscribe(self, topic: str, qos: int) -> tuple[int, ...]:
            nonlocal times
            times += 1
            if times > 1:
                asked.set()
            return (0x80,)

    monkeypatch.setattr("service.doors.mqtt.RETRY_S", 0.01)
    monkeypatch.setattr(aiomqtt, "Client", Refusing)

    async def talk() -> None:
        async with served(Taker(), mqtt="mqtt://127.0.0.1:1"), asyncio.timeout(5.0):
            await asked.wait()

    asyncio.run(talk())
    assert "it refuses the subscription to roisearch/reports" in caplog.text


@pytest.mark.parametrize(
    "url", ["mqtt://me:s@cret@host", "http://me:s@cret@host", "me:s@cret@host", "mqtt://m:s@cret@h:x"]
)
def test_a_password_in_the_url_is_refused_and_not_shown(url: str) -> None:
    with pytest.raises(BadInput) as caught:
        open_doors(DoorSettings(mqtt=url))
    said = str(caught.value)
    assert "…@h" in said
    assert "cret" not in said.replace("doors.mqtt_credentials_file", "")
    assert "me:" not in said


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"mqtt": "127.0.0.1:1883"}, "give mqtt://HOST:PORT"),
        ({"mqtt": "mqtt://me:secret@host"}, "doors.mqtt_credentials_file"),
        ({"mqtt": "mqtt://host:port"}, "give mqtt://HOST:PORT"),
        ({"mqtt": "mqtt://host", "mqtt_topic": "all/#"}, "wildcards"),
        ({"mqtt": "mqtt://host", "mqtt_credentials_file": "none"}, "none: the name and password"),
    ],
)
def test_a_broker_that_cannot_be_is_refused_at_the_start(settings: dict[str, str], words: str) -> None:
    with pytest.raises(BadInput) as caught:
        open_doors(DoorSettings.model_validate(settings))
    assert words in str(caught.value)
