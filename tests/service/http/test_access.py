"""Who gets past the door, and who does not: tokens and their scopes."""

from __future__ import annotations

import asyncio
from pathlib import Path

import httpx
import pytest

from service.errors import BadInput
from service.http import Access, Door, open_door, read_access, url_of

from .door import (
    COMMAND,
    FRAME,
    HOLD,
    REPORT,
    TOKENS,
    FakeRun,
    ask,
    bearer,
    both_tokens,
    in_memory,
    settings,
)


def test_on_loopback_no_token_is_needed() -> None:
    assert ask("POST", "/api/commands", json=HOLD).status_code == 200


class Unbound:
    """Stands in for a socket on an address of the network: tests bind to loopback only."""

    def __init__(self, host: str) -> None:
        self.host, self.closed = host, False

    def getsockname(self) -> tuple[str, int]:
        return self.host, 8080

    def close(self) -> None:
        self.closed = True


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "192.168.1.7", "fe80::1%eth0"])
def test_listening_beyond_loopback_without_a_token_is_refused_at_the_start(
    host: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    listener = Unbound(host)
    monkeypatch.setattr("service.http.server.bind", lambda *_: listener)
    with pytest.raises(BadInput, match=r"needs a token.*http\.token_file.*ROISEARCH_HTTP_TOKEN"):
        open_door(settings(listen="drone7.local:8080"), {})
    assert listener.closed
    assert open_door(settings(listen="drone7.local:8080"), both_tokens()).access.needed


def test_the_service_itself_reaches_a_door_on_every_address_by_loopback() -> None:
    urls = [url_of(Unbound(host)) for host in ("0.0.0.0", "::", "127.0.0.9", "fe80::1%eth0")]  # type: ignore[arg-type]
    assert urls == [
        "http://127.0.0.1:8080",
        "http://[::1]:8080",
        "http://127.0.0.9:8080",
        "http://[fe80::1]:8080",
    ]


def test_a_door_on_every_address_says_so_and_any_other_only_its_own() -> None:
    said = [Door(settings(), Unbound(host), ALL).address for host in ("0.0.0.0", "127.0.0.9")]  # type: ignore[arg-type]
    assert said == [
        "http://127.0.0.1:8080 and at every other address of this machine (0.0.0.0)",
        "http://127.0.0.9:8080",
    ]


def test_every_address_of_loopback_is_loopback() -> None:
    for listen in ("127.0.0.1:0", "127.0.0.9:0", "localhost:0", "[::1]:0"):
        open_door(settings(listen=listen), {}).close()


@pytest.mark.parametrize(
    ("token", "status"),
    [
        (None, 401),
        ("", 401),
        ("wrong-token-0123456789", 401),
        (COMMAND[:-1], 401),
        (COMMAND + "x", 401),
        (REPORT, 403),
        (COMMAND, 200),
    ],
)
def test_a_command_needs_the_command_token(token: str | None, status: int) -> None:
    run = FakeRun()
    headers = bearer(token) if token is not None else {}
    answer = ask("POST", "/api/commands", json=HOLD, headers=headers, access=TOKENS, run=run)
    assert answer.status_code == status
    assert run.orders == (["hold"] if status == 200 else [])
    assert ("www-authenticate" in answer.headers) == (status == 401)


VIEW = "view-token-0123456789"
ALL = read_access(settings(), {**both_tokens(), "ROISEARCH_HTTP_VIEW_TOKEN": VIEW}, loopback=False)


def test_a_wrong_token_is_told_from_none() -> None:
    none, wrong = (ask("GET", "/api/state", headers=each, access=ALL) for each in ({}, bearer(VIEW[:-1])))
    assert none.json()["detail"] == "a bearer token is needed"
    assert "none of this service's tokens" in wrong.json()["detail"]


def test_a_picture_is_served_so_that_nothing_in_it_runs() -> None:
    answer = ask("GET", "/api/pictures/a.jpg")
    assert (answer.content, answer.headers["content-type"]) == (b"\xff\xd8\xff\xd9", "image/jpeg")
    assert "sandbox" in answer.headers["content-security-policy"]
    assert answer.headers["x-content-type-options"] == "nosniff"
    assert ask("GET", "/api/pictures/b.jpg").status_code == 404


@pytest.mark.parametrize(
    ("method", "path", "status"),
    [
        ("GET", "/api/state", 200),
        ("GET", "/api/map", 200),
        ("GET", "/api/map.png", 200),
        ("GET", "/api/pictures/a.jpg", 200),
        ("GET", "/api/written?lat=1&lon=2", 200),
        ("GET", "/metrics", 200),
        ("GET", "/docs", 200),
        ("GET", "/openapi.json", 200),
        ("GET", "/readyz", 200),
        ("POST", "/api/commands", 403),
        ("POST", "/api/news", 403),
        ("POST", "/api/news/a/withdraw", 403),
        ("DELETE", "/api/reports", 403),
        ("GET", "/healthz", 200),
    ],
)
def test_a_report_token_and_a_view_token_open_what_there_is_to_see_and_give_no_orders(
    method: str, path: str, status: int
) -> None:
    for token in (REPORT, VIEW):
        assert ask(method, path, headers=bearer(token), access=ALL).status_code == status
    assert ask("POST", "/api/reports", json=FRAME, headers=bearer(VIEW), access=ALL).status_code == 403
    assert ask("POST", "/api/reports", json=FRAME, headers=bearer(REPORT), access=TOKENS).status_code == 200


def test_only_the_page_the_description_and_the_sign_of_life_are_open_without_a_token() -> None:
    open_paths = {
        path
        for path in (
            "/",
            "/healthz",
            "/readyz",
            "/metrics",
            "/docs",
            "/page/main.js",
            "/openapi.json",
            "/tiles/1/0/0",
            "/api/decisions",
            "/api/state",
            "/api/map",
        )
        if ask("GET", path, access=TOKENS).status_code == 200
    }
    assert open_paths == {"/", "/docs", "/page/main.js", "/healthz"}
    assert ask("POST", "/", json={}, access=TOKENS).status_code == 401


def test_another_scheme_than_bearer_and_two_tokens_at_once_are_refused() -> None:
    assert TOKENS.scope_of(f"Basic {COMMAND}") is None
    assert TOKENS.scope_of(COMMAND) is None
    assert TOKENS.scope_of(f"bearer  {COMMAND} ") is not None

    async def twice() -> int:
        async with in_memory(FakeRun(), access=TOKENS) as client:
            pairs = [("authorization", f"Bearer {token}") for token in (COMMAND, COMMAND)]
            return (await client.get("/api/map", headers=httpx.Headers(pairs))).status_code

    assert asyncio.run(twice()) == 401


def test_tokens_are_compared_in_constant_time(monkeypatch: pytest.MonkeyPatch) -> None:
    compared: list[tuple[int, int]] = []

    def compare(a: bytes, b: bytes) -> bool:
        compared.append((len(a), len(b)))
        return a == b

    monkeypatch.setattr("service.http.access.hmac.compare_digest", compare)
    for token in ("", "x", COMMAND, REPORT, "y" * 4000):
        compared.clear()
        TOKENS.scope_of(f"Bearer {token}")
        assert compared == [(32, 32), (32, 32)]


@pytest.mark.parametrize(
    ("content", "words"),
    [("short", "at least 16"), ("", "is empty"), ("two words of a token", "one line"), ("ü" * 16, "ASCII")],
)
def test_a_weak_token_is_refused_without_being_shown(tmp_path: Path, content: str, words: str) -> None:
    file = tmp_path / "token"
    file.write_text(content)
    with pytest.raises(BadInput, match=words) as caught:
        read_access(settings(token_file=str(file)), {}, loopback=True)
    assert not content or content not in str(caught.value)


def test_a_report_token_alone_or_twice_the_same_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "token"
    file.write_text(REPORT + "\n")
    report_only = settings(report_token_file=str(file))
    with pytest.raises(BadInput, match="nobody to give commands"):
        read_access(report_only, {}, loopback=True)
    with pytest.raises(BadInput, match="the same"):
        read_access(report_only, {"ROISEARCH_HTTP_TOKEN": REPORT}, loopback=True)
    with pytest.raises(BadInput, match="cannot be read"):
        read_access(settings(token_file=str(tmp_path / "none")), {}, loopback=True)


def test_a_guest_token_reports_and_does_not_command() -> None:
    access, token = TOKENS.with_guest()
    assert ask("POST", "/api/reports", json=FRAME, headers=bearer(token), access=access).status_code == 200
    assert ask("POST", "/api/commands", json=HOLD, headers=bearer(token), access=access).status_code == 403
    assert Access().with_guest() == (Access(), "")


def test_no_object_of_the_door_shows_a_token(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    file = tmp_path / "token"
    file.write_text(COMMAND)
    file.chmod(0o644)
    given = settings(token_file=str(file))
    door = open_door(given, {"ROISEARCH_HTTP_REPORT_TOKEN": REPORT})
    try:
        shown = f"{door!r} {door.access!r} {given!r} {given.model_dump_json()} {caplog.text}"
    finally:
        door.close()
    assert "every user of this machine can read the token" in caplog.text
    assert COMMAND not in shown
    assert REPORT not in shown
