"""The page's WebSocket, on a real socket with a client that is not ours: who gets it, and what it tells."""

from __future__ import annotations

import asyncio
import base64
import contextlib
import json
from typing import Any

import httpx
import pytest
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.typing import Subprotocol

from service.http import Door

from .door import COMMAND, REPORT, FakeRun, bearer, both_tokens, on_a_socket


def protocols(token: str) -> list[Subprotocol]:
    """What the page offers."""
    coded = base64.urlsafe_b64encode(token.encode()).decode().rstrip("=")
    return [Subprotocol("roisearch"), Subprotocol("bearer." + coded)]


def watch(door: Door, **options: Any) -> connect:
    port = door.listener.getsockname()[1]
    return connect(f"ws://127.0.0.1:{port}/api/events", **options)


async def refused(door: Door, **options: Any) -> int:
    """The status that a WebSocket is refused with; 101 when it is not."""
    try:
        async with watch(door, **options):
            return 101
    except InvalidStatus as error:
        return error.response.status_code


def test_a_page_of_another_site_and_a_name_of_another_host_get_no_websocket() -> None:
    async def once() -> list[int]:
        async with on_a_socket(FakeRun()) as door:
            port = door.listener.getsockname()[1]
            return [
                await refused(door, origin="http://evil.example"),
                await refused(door, origin="null"),
                await refused(door, origin=f"http://127.0.0.1:{port + 1}"),
                await refused(door, additional_headers={"sec-fetch-site": "cross-site"}),
                await refused(door, origin=f"http://127.0.0.1:{port}"),
                await refused(door),
            ]

    assert asyncio.run(once()) == [403, 403, 403, 403, 101, 101]


@pytest.mark.parametrize(
    ("options", "status"),
    [
        ({}, 401),
        ({"subprotocols": ["roisearch"]}, 401),
        ({"subprotocols": protocols("wrong-token-0123456789")}, 401),
        ({"subprotocols": ["roisearch", "bearer.%%%"]}, 401),
        ({"subprotocols": [*protocols(COMMAND), *protocols(REPORT)[1:]]}, 401),  # two tokens are none
        ({"subprotocols": protocols(REPORT)}, 101),
        ({"subprotocols": protocols(COMMAND)}, 101),
        ({"additional_headers": bearer(COMMAND)}, 101),
        ({"additional_headers": bearer(REPORT)}, 101),
    ],
)
def test_a_websocket_needs_a_token_and_never_in_its_url(options: dict[str, Any], status: int) -> None:
    async def once() -> tuple[int, int]:
        async with on_a_socket(FakeRun(), token_environment=both_tokens()) as door:
            port = door.listener.getsockname()[1]
            with pytest.raises(InvalidStatus) as caught:
                async with connect(f"ws://127.0.0.1:{port}/api/events?token={COMMAND}"):
                    pass
            return await refused(door, **options), caught.value.response.status_code

    assert asyncio.run(once()) == (status, 401)


def test_the_token_is_not_sent_back() -> None:
    async def once() -> str | None:
        async with (
            on_a_socket(FakeRun(), token_environment=both_tokens()) as door,
            watch(door, subprotocols=protocols(COMMAND)) as socket,
        ):
            return socket.subprotocol

    assert asyncio.run(once()) == "roisearch"


async def told(socket: ClientConnection) -> dict[str, Any]:
    message: dict[str, Any] = json.loads(await asyncio.wait_for(socket.recv(), 20))
    return message


def test_a_watcher_is_told_the_scene_and_then_moments_without_end() -> None:
    async def once() -> tuple[list[dict[str, Any]], float]:
        async with on_a_socket(FakeRun()) as door, watch(door) as socket:
            loop = asyncio.get_running_loop()
            said = [await told(socket), await told(socket)]
            began = loop.time()
            said += [await told(socket) for _ in range(4)]
            await socket.send("no JSON")
            await socket.send('["nor", "a", "wish"]')
            said.append(await told(socket))
            return said, loop.time() - began

    said, _ = asyncio.run(once())
    assert [each["type"] for each in said] == ["scene"] + 6 * ["moment"]
    assert said[0]["area"] == "field"
    assert said[0]["replay"] is None
    assert "codes" in said[1]["belief"]
    assert "codes" not in said[2]["belief"]  # nothing has changed


def test_when_the_service_ends_its_watchers_are_told_so_at_once() -> None:
    async def once() -> int | None:
        async with on_a_socket(FakeRun()) as door:
            socket = await watch(door)
            await told(socket)
        with contextlib.suppress(ConnectionClosed):
            while True:
                await told(socket)
        return socket.close_code

    assert asyncio.run(once()) in (1001, 1012)


def test_more_than_enough_watchers_are_sent_away() -> None:
    async def once() -> int | None:
        async with on_a_socket(FakeRun(), commands_per_s=1000) as door, contextlib.AsyncExitStack() as stack:
            for _ in range(16):
                await told(await stack.enter_async_context(watch(door)))
            one_more = await stack.enter_async_context(watch(door))
            with pytest.raises(ConnectionClosed):
                await told(one_more)
            return one_more.close_code

    assert asyncio.run(once()) == 1013


def test_every_way_of_looking_is_answered_over_a_socket() -> None:
    async def once() -> dict[str, httpx.Response]:
        async with on_a_socket(FakeRun()) as door, httpx.AsyncClient(base_url=door.url) as client:
            paths = (
                "/",
                "/docs",
                "/openapi.json",
                "/page/main.js",
                "/page/vendor/leaflet/LICENSE",
                "/healthz",
            )
            paths += (
                "/readyz",
                "/metrics",
                "/api/state",
                "/api/map",
                "/api/map?format=geojson",
                "/api/map.png",
            )
            paths += (
                "/api/decisions?count=1",
                "/api/replay",
                "/api/state?at=3",
                "/tiles/1/0/0",
                "/page/../app.py",
            )
            return {path: await client.get(path) for path in paths}

    answers = asyncio.run(once())
    missing = {path for path, answer in answers.items() if answer.status_code == 404}
    assert missing == {"/api/replay", "/api/state?at=3", "/tiles/1/0/0", "/page/../app.py"}
    assert all(answer.status_code == 200 for path, answer in answers.items() if path not in missing)
    assert answers["/api/map?format=geojson"].headers["content-type"] == "application/geo+json"
    assert "javascript" in answers["/page/main.js"].headers["content-type"]
    assert "live" in answers["/api/replay"].json()["detail"]


def test_the_description_has_examples_and_asks_nobody_else_for_anything() -> None:
    async def once() -> tuple[str, dict[str, Any]]:
        async with on_a_socket(FakeRun()) as door, httpx.AsyncClient(base_url=door.url) as client:
            return (await client.get("/docs")).text, (await client.get("/openapi.json")).json()

    page, api = asyncio.run(once())
    assert "https://" not in page
    assert "<script" not in page
    for path, operations in api["paths"].items():
        assert path in page
        for operation in operations.values():
            body = operation.get("requestBody", {}).get("content", {}).get("application/json")
            assert body is None or body["examples"], path
            answer = operation["responses"]["200"]["content"]
            assert "application/json" not in answer or "example" in answer["application/json"], path
    assert "WS /api/events" in page
