"""What gets past the door, and what does not: names, pages of other sites, bodies, rates."""

from __future__ import annotations

import asyncio
import json
import re
import socket
from contextlib import closing
from typing import Any

import httpx
import pytest

from service.config import MOST_BATCH, HttpSettings
from service.errors import BadInput
from service.http.address import bind, host_name
from service.http.guard import local_address
from service.http.rate import Buckets
from service.news.request import EXAMPLES

from .door import (
    COMMAND,
    FRAME,
    HOLD,
    TOKENS,
    FakeRun,
    ask,
    bearer,
    in_memory,
    on_a_socket,
    say,
    settings,
)

# ---- names and pages of others


@pytest.mark.parametrize(
    ("host", "status"),
    [
        ("127.0.0.1:8080", 200),
        ("localhost", 200),
        ("LOCALHOST.:9", 200),
        ("[::1]:8080", 200),
        ("drone7.local", 200),
        ("search.example", 200),
        ("evil.example", 421),
        ("127.0.0.1.evil.example", 421),
        ("localhost@evil.example", 421),
        ("127.0.0.1:80:80", 421),
        ("[::1", 421),
        ("127.0.0.1:x", 421),
        ("", 421),
    ],
)
def test_only_our_own_names_are_answered_to(host: str, status: int) -> None:
    """A name that somebody else made resolve to this machine is DNS rebinding."""
    run = FakeRun()
    http = settings(allowed_hosts=["Drone7.local"])
    headers = {"host": host}
    answer = ask(
        "POST", "/api/commands", json=HOLD, headers=headers, http=http, run=run, names=["search.example"]
    )
    assert answer.status_code == status
    assert bool(run.orders) == (status == 200)
    assert ask("GET", "/", headers=headers, http=http, names=["search.example"]).status_code == status


def test_listening_everywhere_the_address_that_was_called_is_a_name_of_ours() -> None:
    async def scenario() -> list[int]:
        everywhere = on_a_socket(FakeRun(), any_address=True, listen="127.0.0.9:0")
        async with everywhere as door, httpx.AsyncClient() as client:
            hosts = ("127.0.0.9", "127.0.0.1", "10.1.2.3", "evil.example")
            asked = [client.get(f"{door.url}/healthz", headers={"host": host}) for host in hosts]
            return [answer.status_code for answer in await asyncio.gather(*asked)]

    assert asyncio.run(scenario()) == [200, 200, 421, 421]


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({}, 200),
        ({"origin": "http://127.0.0.1:8080"}, 200),
        ({"origin": "http://127.0.0.1:8080", "sec-fetch-site": "same-origin"}, 200),
        ({"origin": "https://ops.example", "sec-fetch-site": "cross-site"}, 200),
        ({"origin": "http://127.0.0.1:9999"}, 403),
        ({"origin": "http://127.0.0.1"}, 403),
        ({"origin": "http://localhost:8080"}, 403),
        ({"origin": "https://evil.example"}, 403),
        ({"origin": "http://127.0.0.1:8080.evil.example"}, 403),
        ({"origin": "http://127.0.0.1:8080@evil.example"}, 403),
        ({"origin": "null"}, 403),
        ({"origin": "file://"}, 403),
        ({"origin": "http://[::1"}, 403),
        ({"sec-fetch-site": "cross-site"}, 403),
        ({"sec-fetch-site": "same-site"}, 403),
    ],
)
def test_a_page_of_another_site_neither_commands_nor_reports(headers: dict[str, str], status: int) -> None:
    run = FakeRun()
    http = settings(allowed_origins=["https://ops.example/"])
    for path, body in (("/api/commands", HOLD), ("/api/reports", FRAME)):
        assert ask("POST", path, json=body, headers=headers, http=http, run=run).status_code == status
    assert (len(run.orders), len(run.reports)) == ((1, 1) if status == 200 else (0, 0))


def test_a_page_of_another_site_cannot_even_use_up_our_rate() -> None:
    embedded = {"sec-fetch-site": "cross-site", "sec-fetch-mode": "no-cors", "sec-fetch-dest": "image"}
    followed = {"sec-fetch-site": "cross-site", "sec-fetch-mode": "navigate", "sec-fetch-dest": "document"}
    assert ask("GET", "/api/map.png", headers=embedded).status_code == 403
    assert ask("GET", "/", headers=followed).status_code == 200


def test_a_configured_site_gets_its_preflight_answered_and_no_other_does() -> None:
    http = settings(allowed_origins=["https://OPS.example/"])
    asked = {"access-control-request-method": "POST", "access-control-request-headers": "authorization"}
    for origin, allowed in (("https://ops.example", "https://ops.example"), ("https://evil.example", None)):
        answer = ask(
            "OPTIONS", "/api/commands", headers={"origin": origin, **asked}, http=http, access=TOKENS
        )
        assert answer.headers.get("access-control-allow-origin") == allowed
    answer = ask("GET", "/api/state", headers={"origin": "https://ops.example"})
    assert "access-control-allow-origin" not in answer.headers


def test_the_address_of_ipv4_is_ours_also_on_a_socket_for_both() -> None:
    for server, ours in (
        ("::ffff:192.0.2.7", "192.0.2.7"),
        ("FE80::1%eth0", "fe80::1"),
        ("192.0.2.7", "192.0.2.7"),
    ):
        assert local_address({"server": (server, 8080)}) == ours
    assert local_address({}) is None


def test_a_port_that_another_has_taken_is_told_before_anything_starts() -> None:
    with closing(bind("127.0.0.1", 0)) as first, pytest.raises(BadInput, match="choose another with --http"):
        bind("127.0.0.1", first.getsockname()[1])


def test_a_host_header_is_read_as_browsers_write_it() -> None:
    assert host_name("[2001:DB8::1]:80") == "2001:db8::1"
    assert host_name("a.b.") == "a.b"
    assert [host_name(text) for text in ("", ":80", "[]", "a:b", "[::1]x")] == [None] * 5


def test_the_page_runs_only_its_own_script_and_in_nobody_elses_frame() -> None:
    answer = ask("GET", "/")
    policy = answer.headers["content-security-policy"]
    assert "script-src 'self';" in policy
    assert "unsafe" not in policy
    assert "default-src 'none'" in policy
    assert "frame-ancestors 'none'" in policy
    assert not re.search(
        r"<script(?![^>]* src=)| on[a-z]+=| style=", answer.text
    )  # inline ones in attributes would not run under this policy
    assert answer.headers["x-frame-options"] == "DENY"


# ---- bodies


@pytest.mark.parametrize(
    "kind", ["text/plain", "application/x-www-form-urlencoded", "multipart/form-data; boundary=x", "", None]
)
def test_a_body_that_is_not_called_json_is_refused(kind: str | None) -> None:
    """What a form or a script of another site can send without asking first is none of these types."""

    async def once() -> int:
        async with in_memory(run) as client:
            headers = {"content-type": kind} if kind is not None else {}
            return (
                await client.post("/api/commands", content=b'{"command":"hold"}', headers=headers)
            ).status_code

    run = FakeRun()
    assert asyncio.run(once()) == 415
    assert run.orders == []


def test_json_with_a_character_set_is_json() -> None:
    async def once() -> int:
        async with in_memory(FakeRun()) as client:
            headers = {"content-type": "Application/JSON; charset=utf-8"}
            return (
                await client.post("/api/commands", content=b'{"command":"hold"}', headers=headers)
            ).status_code

    assert asyncio.run(once()) == 200


@pytest.mark.parametrize(("path", "status"), [("/api/news", 200), ("/api/commands", 415)])
def test_geojson_is_what_it_is_called_where_geojson_is_taken(path: str, status: int) -> None:
    async def once() -> int:
        async with in_memory(FakeRun()) as client:
            headers = {"content-type": "application/geo+json"}
            body = EXAMPLES["a clue at a point"] if path == "/api/news" else {"command": "hold"}
            return (await client.post(path, content=json.dumps(body), headers=headers)).status_code

    assert asyncio.run(once()) == status


def test_news_are_taken_back_by_an_id_with_a_slash() -> None:
    async def once() -> dict[str, Any]:
        async with in_memory(FakeRun()) as client:
            answer: dict[str, Any] = (await client.post("/api/news/team%2F3/withdraw")).json()
            return answer

    assert asyncio.run(once())["id"] == "team/3"


@pytest.mark.parametrize("chunked", [False, True])
def test_a_body_over_the_limit_is_refused_however_it_comes(chunked: bool) -> None:
    async def scenario() -> None:
        run = FakeRun()
        async with (
            on_a_socket(run, max_body_bytes=2000) as door,
            httpx.AsyncClient(base_url=door.url) as client,
        ):
            for size, status in ((1500, 200), (3000, 413)):
                body = b'{"command": "hold"' + b" " * (size - 19) + b"}"

                async def pieces(body: bytes = body) -> Any:
                    for at in range(0, len(body), 100):
                        yield body[at : at + 100]

                content = pieces() if chunked else body
                headers = {"content-type": "application/json"}
                answer = await client.post("/api/commands", content=content, headers=headers)
                assert answer.status_code == status
                assert ("transfer-encoding" in answer.request.headers) == chunked
        assert run.orders == ["hold"]

    asyncio.run(scenario())


def test_an_endless_chunked_body_is_cut_off_at_the_limit() -> None:
    async def scenario() -> bytes:
        async with on_a_socket(FakeRun(), max_body_bytes=2000) as door:
            head = b"POST /api/reports HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\n"
            chunk = b"3e8\r\n" + b"[" * 1000 + b"\r\n"
            return await say(door, head + b"Transfer-Encoding: chunked\r\n\r\n" + chunk * 3)

    assert asyncio.run(scenario()).startswith(b"HTTP/1.1 413 ")


@pytest.mark.parametrize(
    ("data", "status"),
    [
        (b"POST /api/reports HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\n"
         b"Content-Length: 100\r\n\r\n{", b"HTTP/1.1 408 "),
        (b"GET /healthz HTTP/1.1\r\nHost: localhost\r\nX-Slow: ", b""),
        (b"", b""),
    ],
    ids=["body", "headers", "silence"],
)  # fmt: skip
def test_who_is_too_slow_is_hung_up_on(data: bytes, status: bytes) -> None:
    async def scenario() -> bytes:
        async with on_a_socket(FakeRun(), body_timeout_s=0.3) as door:
            return await say(door, data)

    answer = asyncio.run(scenario())
    assert answer.startswith(status)
    assert bool(answer) == bool(status)


def test_a_connection_between_two_requests_is_not_hung_up_on() -> None:
    async def scenario() -> None:
        async with on_a_socket(FakeRun(), body_timeout_s=0.2) as door, httpx.AsyncClient() as client:
            kept = []
            for _ in range(2):
                answer = await client.get(f"{door.url}/healthz")
                kept.append(answer.extensions["network_stream"].get_extra_info("client_addr"))
                await asyncio.sleep(0.6)
        assert kept[0] == kept[1]

    asyncio.run(scenario())


def test_a_batch_over_the_limit_is_refused_whole() -> None:
    run = FakeRun()
    batch = [{**FRAME, "id": f"{n}"} for n in range(11)]
    http = settings(max_batch=10)
    assert ask("POST", "/api/reports", json=batch, http=http, run=run).status_code == 413
    assert run.reports == []
    assert ask("POST", "/api/reports", json=batch[:10], http=http, run=run).status_code == 200
    assert len(run.reports) == 10


# ---- rates


def test_a_bucket_lets_its_rate_through_and_no_more() -> None:
    buckets = Buckets(burst_s=2.0)
    waits = [buckets.take("a", 10.0, 0.0) for _ in range(21)]
    assert waits[:20] == [0.0] * 20
    assert waits[20] == pytest.approx(0.1)
    assert buckets.take("b", 10.0, 0.0) == 0.0
    passed = sum(buckets.take("a", 10.0, 1.0) == 0.0 for _ in range(30))
    assert passed == 10
    assert buckets.take("a", 10.0, 0.5) > 0.0  # a clock that goes back fills nothing


def test_a_batch_of_any_length_is_refused_before_all_of_it_is_checked() -> None:
    many, run = [{**FRAME, "id": "x"}] * MOST_BATCH, FakeRun()
    wrong: list[Any] = [{}] * 5
    http = settings(max_body_bytes=1 << 24)
    answer = ask("POST", "/api/reports", json=[*many, *wrong], http=http, run=run)
    assert answer.status_code == 413
    assert "a batch has at most 500 reports" in answer.text
    assert run.reports == []


def test_others_have_their_turn_while_a_batch_is_checked() -> None:
    """Twenty frames with all the detections that a report may hold take a tenth of a second."""

    async def talk() -> int:
        turns = 0

        async def others() -> None:
            nonlocal turns
            while True:
                turns += 1
                await asyncio.sleep(0)

        async with in_memory(FakeRun(), http=settings(detections_per_s=1e6)) as client:
            beside = asyncio.create_task(others())
            answer = await client.post("/api/reports", json=[{**FRAME, "id": f"{n}"} for n in range(400)])
            beside.cancel()
        assert answer.status_code == 200
        return turns

    assert asyncio.run(talk()) >= 400


def test_what_is_wrong_in_a_batch_is_told_by_its_number() -> None:
    answer = ask("POST", "/api/reports", json=[FRAME, {**FRAME, "detections": [{"lat": 91}]}])
    assert answer.status_code == 422
    assert [each["loc"] for each in answer.json()["detail"]] == [["body", 1, "detections", 0, "lat"]]


def test_a_batch_larger_than_the_bucket_passes_once_and_is_paid_back() -> None:
    buckets = Buckets(burst_s=2.0)
    assert buckets.take("a", 10.0, 0.0, 50) == 0.0
    assert buckets.take("a", 10.0, 2.0) > 0.0
    assert buckets.take("a", 10.0, 4.0) == 0.0


async def statuses(client: httpx.AsyncClient, count: int, path: str, body: Any) -> list[int]:
    answers = [await client.post(path, json=body) for _ in range(count)]
    for answer in answers:
        assert (answer.status_code == 429) == ("retry-after" in answer.headers)
    return [answer.status_code for answer in answers]


def test_commands_are_limited_and_a_flood_of_them_stops_neither_reports_nor_reading() -> None:
    async def scenario() -> None:
        run = FakeRun()
        async with in_memory(run, http=settings(commands_per_s=1)) as client:
            assert 429 in await statuses(client, 10, "/api/commands", HOLD)
            assert len(run.orders) < 10
            assert set(await statuses(client, 10, "/api/reports", FRAME)) == {200}
            assert (await client.get("/api/state")).status_code == 200
            assert (await client.get("/metrics")).status_code == 200

    asyncio.run(scenario())


def test_a_flood_of_reports_in_batches_is_limited_and_stops_no_command() -> None:
    async def scenario() -> None:
        async with in_memory(FakeRun(), http=settings(reports_per_s=50, max_batch=100)) as client:
            batch = [{**FRAME, "id": f"{n}"} for n in range(60)]
            assert await statuses(client, 3, "/api/reports", batch) == [200, 429, 429]
            assert (await client.post("/api/commands", json=HOLD)).status_code == 200

    asyncio.run(scenario())


def test_five_hundred_reports_a_second_pass_by_default() -> None:
    buckets, http = Buckets(), HttpSettings()
    times = [n / 500 for n in range(5000)]
    assert all(buckets.take("a", http.reports_per_s, now) == 0.0 for now in times)


def test_refused_requests_do_not_use_up_the_rate_of_those_with_a_token() -> None:
    async def scenario() -> int:
        async with in_memory(FakeRun(), http=settings(commands_per_s=1), access=TOKENS) as client:
            assert set(await statuses(client, 20, "/api/commands", HOLD)) == {401}
            return (await client.post("/api/commands", json=HOLD, headers=bearer(COMMAND))).status_code

    assert asyncio.run(scenario()) == 200


def test_a_forwarded_address_in_a_header_does_not_make_another_client() -> None:
    async def scenario() -> list[int]:
        async with on_a_socket(FakeRun(), commands_per_s=1) as door, httpx.AsyncClient() as client:
            return [
                (
                    await client.get(f"{door.url}/readyz", headers={"x-forwarded-for": f"10.0.0.{n}"})
                ).status_code
                for n in range(10)
            ]

    assert 429 in asyncio.run(scenario())


def test_an_answer_does_not_wait_for_the_one_before_to_be_acknowledged() -> None:
    """With Nagle's algorithm, a detector on one connection gets 25 reports a second through, not 500."""

    async def scenario() -> None:
        accepted: asyncio.Queue[int] = asyncio.Queue()

        def note(_: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            wire = writer.get_extra_info("socket")
            accepted.put_nowait(wire.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY))
            writer.close()

        listener = bind("127.0.0.1", 0)
        async with await asyncio.start_server(note, sock=listener):
            _, writer = await asyncio.open_connection(*listener.getsockname())
            assert await accepted.get()
            writer.close()

    asyncio.run(scenario())


@pytest.mark.parametrize("nonsense", [b"\x16\x03\x01\x00\xa5\x01\r\n\r\n", b"\r\n" * 9])
def test_what_a_stranger_does_wrong_is_not_in_the_terminal(
    nonsense: bytes, capfd: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture
) -> None:
    async def knock() -> None:
        async with on_a_socket(FakeRun()) as door:
            await say(door, nonsense, patience_s=1.0)

    asyncio.run(knock())
    assert tuple(capfd.readouterr()) == ("", "")
    assert caplog.records == []
