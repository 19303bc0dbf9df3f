"""The doors beside HTTP: real datagrams, a real Unix socket, a real broker; lines in, receipts out."""

from __future__ import annotations

import asyncio
import contextlib
import getpass
import json
import os
import shutil
import socket
import stat
import subprocess
import time
from collections.abc import AsyncIterator, Iterator, Sequence
from contextlib import asynccontextmanager, contextmanager
from pathlib import Path
from typing import Any

import aiomqtt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from service.config import DoorSettings
from service.doors import Doors, open_doors
from service.doors.lines import answer
from service.errors import BadInput
from service.evidence.intake import JournalLost
from service.evidence.reports import EXAMPLES, Receipt, Report

PATIENCE_S = 30.0


class Taker:
    """Takes every report, once."""

    def __init__(self) -> None:
        self.ids: list[str] = []

    async def submit_all(self, reports: Sequence[Report]) -> list[Receipt]:
        receipts = []
        for report in reports:
            known = report.id in self.ids
            receipts.append(Receipt(id=report.id, status="duplicate" if known else "accepted"))
            if not known:
                self.ids.append(report.id)
        return receipts


def lines(*reports: dict[str, Any]) -> bytes:
    return b"".join(json.dumps(report).encode() + b"\n" for report in reports)


def frames(count: int, prefix: str = "f") -> list[dict[str, Any]]:
    return [{"id": f"{prefix}{number}", "captured_at": 1.0} for number in range(count)]


def said(data: bytes) -> list[dict[str, Any]]:
    return [json.loads(line) for line in data.splitlines()]


@asynccontextmanager
async def served(taker: Taker, **settings: str) -> AsyncIterator[Doors]:
    doors = open_doors(DoorSettings.model_validate(settings))
    serving = asyncio.create_task(doors.serve(taker.submit_all))
    try:
        yield doors
    finally:
        serving.cancel()
        await asyncio.wait([serving])
        doors.close()


# ---- lines


def test_every_line_is_answered_in_its_place_whatever_it_is() -> None:
    data = b'\n{"id": "x"}\nnot JSON\n[]\n\n' + lines(*EXAMPLES.values()) + b'{"id": 3}\n' + b"[" * 5000
    receipts = said(asyncio.run(answer(data, Taker().submit_all)))
    assert [receipt["status"] for receipt in receipts] == ["refused"] * 3 + ["accepted"] * len(EXAMPLES) + [
        "refused"
    ] * 2
    assert receipts[0] == {
        "id": "x",
        "status": "refused",
        "reason": "captured_at: Field required",
        "looks": 0,
        "hits": 0,
    }
    assert [receipt["id"] for receipt in receipts[3:-2]] == [example["id"] for example in EXAMPLES.values()]


@given(
    st.binary(max_size=200)
    | st.lists(st.sampled_from([b'{"id":"a"}', b"\xff", b"\r", b"1e999"])).map(b"\n".join)
)
def test_any_bytes_get_a_receipt_for_each_line(data: bytes) -> None:
    receipts = said(asyncio.run(answer(data, Taker().submit_all)))
    assert len(receipts) == sum(bool(line.strip()) for line in data.split(b"\n"))


def test_many_lines_are_taken_in_part_by_part_and_others_have_their_turn() -> None:
    taker, sizes, turns = Taker(), [], 0

    async def submit_all(reports: Sequence[Report]) -> list[Receipt]:
        sizes.append(len(reports))
        return await taker.submit_all(reports)

    async def talk() -> bytes:
        async def others() -> None:
            nonlocal turns
            while True:
                turns += 1
                await asyncio.sleep(0)

        beside = asyncio.create_task(others())
        receipts = await answer(lines(*frames(1200)) + b"nonsense\n" * 1000, submit_all)
        beside.cancel()
        return receipts

    receipts = said(asyncio.run(talk()))
    assert [each["status"] for each in receipts] == ["accepted"] * 1200 + ["refused"] * 1000
    assert [each["id"] for each in receipts[:1200]] == [f"f{number}" for number in range(1200)]
    assert sizes == [500, 500, 200]
    assert turns >= 4


def test_a_lost_journal_is_told_to_the_sender_who_may_send_again() -> None:
    async def lost(reports: Sequence[Report]) -> list[Receipt]:
        raise JournalLost("the journal j cannot be written: disk full")

    (receipt,) = said(asyncio.run(answer(lines(*frames(1)), lost)))
    assert (receipt["id"], receipt["status"]) == ("f0", "refused")
    assert "disk full" in receipt["reason"]


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


# ---- MQTT


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


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
