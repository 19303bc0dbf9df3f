"""The webhook over real sockets: told again until it is taken, in order, and never waited for."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from service.config import TellingSettings
from service.errors import BadInput
from service.telling import read_plan
from service.telling.news import Announcement
from service.telling.settings import Hook
from service.telling.webhook import MOST_WAITING, Webhook

PATIENCE_S = 30.0
Request = tuple[dict[str, str], dict[str, object]]


@asynccontextmanager
async def server(answer: Callable[[int], bytes]) -> AsyncIterator[tuple[str, list[Request]]]:
    """A web server that answers its n-th request, from 0, with these bytes, and remembers what it was sent."""
    requests: list[Request] = []

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        try:
            while True:
                head = (await reader.readuntil(b"\r\n\r\n")).decode()
                _, *lines = head.strip().split("\r\n")
                headers = {key.lower(): value for key, value in (line.split(": ", 1) for line in lines)}
                body = json.loads(await reader.readexactly(int(headers["content-length"])))
                requests.append((headers, body))
                writer.write(answer(len(requests) - 1))
                await writer.drain()
        except (asyncio.IncompleteReadError, ConnectionError):
            writer.close()

    async with await asyncio.start_server(serve, "127.0.0.1", 0) as listening:
        port = listening.sockets[0].getsockname()[1]
        yield f"http://127.0.0.1:{port}/secret-path", requests


def status(code: int) -> bytes:
    return f"HTTP/1.1 {code} X\r\nContent-Length: 2\r\n\r\nok".encode()


def news(name: str) -> Announcement:
    return Announcement(
        name, "found", 0.0, "run", "field", "FOUND", (47.0, 8.0), "here", 0.9, 5.0, f"text of {name}"
    )


async def told(hook: Hook, *all_news: Announcement) -> None:
    webhook = Webhook(hook, first_pause_s=0.01)
    working = asyncio.create_task(webhook.run())
    for each in all_news:
        webhook.tell(each)
    async with asyncio.timeout(PATIENCE_S):
        await webhook.told()
    working.cancel()
    await asyncio.wait([working])


def test_news_is_posted_again_until_it_is_taken_and_in_order() -> None:
    async def talk() -> None:
        async with server(lambda n: status(503) if n in (0, 1, 3) else status(200)) as (url, requests):
            await told(Hook(url, "hush"), news("a"), news("b"))
        assert [body["id"] for _, body in requests] == ["a", "a", "a", "b", "b"]
        headers, body = requests[0]
        assert headers["authorization"] == "Bearer hush"
        assert headers["idempotency-key"] == "a"
        assert body == news("a").body()
        assert body["time"] == "1970-01-01T00:00:00.000Z"

    asyncio.run(talk())


def test_what_a_receiver_will_never_take_is_dropped_and_said_without_its_secret(
    caplog: pytest.LogCaptureFixture,
) -> None:
    async def talk() -> None:
        async with server(lambda n: status(403) if n == 0 else status(204)) as (url, requests):
            await told(Hook(url), news("a"), news("b"))
        assert [body["id"] for _, body in requests] == ["a", "b"]

    asyncio.run(talk())
    assert "does not take 'text of a' (it answers 403)" in caplog.text
    assert "secret-path" not in caplog.text


def test_a_redirect_is_not_followed() -> None:
    async def talk() -> None:
        where = b"HTTP/1.1 302 X\r\nLocation: http://127.0.0.1:1/\r\nContent-Length: 0\r\n\r\n"
        async with server(lambda n: where if n == 0 else status(200)) as (url, requests):
            await told(Hook(url), news("a"))
        assert len(requests) == 2  # asked again at the same place

    asyncio.run(talk())


def test_an_answer_that_never_ends_or_never_comes_is_not_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("service.telling.webhook.TIMEOUT_S", 0.2)
    endless = b"HTTP/1.1 200 X\r\nContent-Length: 100000000\r\n\r\n" + b"x" * 100_000

    async def talk() -> None:
        async with server(lambda n: endless) as (url, requests):
            await told(Hook(url), news("a"))
            assert len(requests) == 1  # what it says is not read to its end
        async with server(lambda n: b"" if n == 0 else status(200)) as (url, requests):
            await told(Hook(url), news("a"))
            assert len(requests) == 2

    asyncio.run(talk())


def test_a_receiver_that_is_away_keeps_nobody_waiting(caplog: pytest.LogCaptureFixture) -> None:
    webhook = Webhook(Hook("http://127.0.0.1:9/x"))
    for number in range(MOST_WAITING + 5):
        webhook.tell(news(str(number)))  # returns at once, whatever happens to it
    assert caplog.text.count("is dropped") == 5


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"webhook": "ftp://x/y"}, "telling.webhook is no URL that can be posted to; give https://HOST/PATH"),
        ({"webhook": "http:///y"}, "telling.webhook is no URL"),
        ({"webhook": "http://x:99999/"}, "telling.webhook is no URL"),
        ({"webhook": "https://x/y", "webhook_token_file": "/no/such"}, "webhook token cannot be read"),
        ({"mqtt": "http://x"}, "telling.mqtt = 'http://x' is not a broker"),
        ({"mqtt": "mqtt://x", "mqtt_topic": "a/#"}, "telling.mqtt_topic = 'a/#' is not a topic"),
        ({"tak": "http://x"}, "telling.tak = 'http://x' is no TAK address; give tcp://HOST:8087"),
        ({"tak": "tcp://x", "tak_callsign": " "}, "telling.tak_callsign must have"),
        ({"tak": "tls://x", "tak_ca_file": "/no/such.pem"}, "/no/such.pem: there is no such file"),
    ],
)
def test_wrong_addresses_are_refused_before_anything_starts(settings: dict[str, str], words: str) -> None:
    with pytest.raises(BadInput) as caught:
        read_plan(TellingSettings(**settings))
    assert words in str(caught.value)


def test_nobody_is_told_unless_the_settings_name_somebody(tmp_path: Path) -> None:
    assert not read_plan(TellingSettings()).anybody
    token = tmp_path / "token"
    token.write_text("hush\n")
    plan = read_plan(TellingSettings(webhook="https://x/secret", webhook_token_file=str(token)))
    assert plan.hook == Hook("https://x/secret", "hush")
    assert "secret" not in repr(plan)
    assert "hush" not in repr(plan)
